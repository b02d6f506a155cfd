import re

import browser
import pytest
from small_experiments import entry

from mjhill.report import report_of, reproduce, write_report

pytestmark = pytest.mark.skipif(
    browser.find() is None, reason="no Chromium or Chrome; apt-get install chromium"
)

WIDTHS = {"desktop": 1280, "tablet": 768, "phone": 375, "small phone": 320}

# contrast of each text with what is behind it, by the formula of WCAG 2
CONTRASTS = """
(() => {
  const rgb = text => text.match(/[\\d.]+/g).map(Number);
  const light = ([r, g, b]) => [r, g, b].map(c => c / 255)
    .map(c => c <= .04045 ? c / 12.92 : ((c + .055) / 1.055) ** 2.4)
    .reduce((sum, c, i) => sum + c * [.2126, .7152, .0722][i], 0);
  const behind = node => {
    for (; node; node = node.parentElement) {
      const colour = rgb(getComputedStyle(node).backgroundColor);
      if (colour.length < 4 || colour[3] > 0) return colour;
    }
    return [255, 255, 255];
  };
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const found = [];
  while (texts.nextNode()) {
    const node = texts.currentNode.parentElement;
    if (!texts.currentNode.data.trim() || !node.checkVisibility()) continue;
    const [a, b] = [rgb(getComputedStyle(node).color), behind(node)].map(light);
    found.push([(Math.max(a, b) + .05) / (Math.min(a, b) + .05), texts.currentNode.data.trim()]);
  }
  return found.sort((a, b) => a[0] - b[0])[0];
})()
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    catalogue = (entry("rise", "elbow", "wrist_rotation", filmed=True), entry("failing"))
    return write_report(report_of(reproduce(folder, catalogue=catalogue)), folder)["page"]


@pytest.fixture(scope="module")
def page():
    with browser.Browser(browser.find()) as started:
        yield started


@pytest.mark.parametrize("width", WIDTHS.values(), ids=WIDTHS)
def test_nothing_is_wider_than_the_window(page, report, width):
    page.open(report, width=width, phone=width < 700)
    assert page.run("innerWidth") == width
    assert page.run("document.documentElement.scrollWidth") <= width
    # tables may be wider, inside boxes that scroll and that a keyboard reaches
    wide = """[...document.querySelectorAll("body *")].filter(node =>
      !node.closest(".scroll, .sheet, .unseen, .skip")
      && node.getBoundingClientRect().right > innerWidth + 0.5).map(node => node.outerHTML)"""
    assert page.run(wide) == []
    assert page.run("[...document.querySelectorAll('.scroll')].every(n => n.tabIndex === 0)")
    assert page.run("[...document.querySelectorAll('table')].every(n => n.closest('.scroll'))")


def test_the_page_asks_for_nothing_and_the_browser_has_no_complaint(page, report):
    page.open(report, width=1280)
    page.wait("[...document.images].every(image => image.complete)")
    asked = [url for url in page.events if not url.startswith("data:")]
    assert asked == [report.as_uri()]
    assert page.complaints == []


def test_figures_and_videos_load_and_play(page, report):
    page.open(report, width=1280)
    figures = page.run("[...document.images].map(n => [n.naturalWidth, n.width, n.height, n.alt])")
    assert len(figures) == 2
    for natural, width, height, alternative in figures:
        assert natural == 1800
        assert width / height == pytest.approx(9 / 4, rel=0.01)
        assert alternative
    page.wait("[...document.querySelectorAll('video')].every(video => video.readyState >= 1)")
    sizes = (
        "[...document.querySelectorAll('video')].map(n =>"
        " [n.videoWidth, n.videoHeight, n.duration])"
    )
    films = page.run(sizes)
    assert [film[:2] for film in films] == [[640, 360]] * 2
    assert all(1 < film[2] <= 4.1 for film in films)
    page.run("document.querySelector('video').play()")
    page.wait("document.querySelector('video').currentTime > 0.2")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_text_can_be_read_against_its_ground(page, report, scheme):
    page.open(report, width=1280, scheme=scheme)
    ground = page.run("getComputedStyle(document.body).backgroundColor")
    red = int(re.findall(r"\d+", ground)[0])
    assert red > 200 if scheme == "light" else red < 50
    contrast, text = page.run(CONTRASTS)
    assert contrast >= 4.5, text


def test_a_link_of_the_summary_leads_to_its_claim(page, report):
    page.open(report, width=1280)
    page.run("document.querySelectorAll('#claims a.verdict')[1].click()")
    page.wait("scrollY > 0")
    target = page.run("document.querySelector(':target').textContent")
    assert "Torque rises" in target
    assert page.run("document.querySelector(':target').id") == "rise-wrist_rotation-claim-1"


def test_on_a_phone_a_figure_fits_and_can_be_seen_in_full_size(page, report):
    page.open(report, width=375, phone=True)
    assert page.run("document.images[0].width") <= 375
    page.run("document.querySelector('.enlarge input').click()")
    assert page.run("document.images[0].width") == 900
    assert page.run("document.documentElement.scrollWidth") <= 375


def test_the_page_prints(page, report, tmp_path):
    page.open(report, width=1280, scheme="dark", media="print")
    assert page.run("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    page.pdf(tmp_path / "report.pdf")
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")


def test_every_control_and_picture_has_a_name(page, report):
    page.open(report, width=1280)
    page.call("Accessibility.enable")
    nodes = page.call("Accessibility.getFullAXTree")["nodes"]
    named = {"link", "image", "Video", "checkbox", "region", "table", "navigation", "article"}
    roles = set()
    for node in nodes:
        role = node.get("role", {}).get("value")
        if role in named and not node["ignored"]:
            roles.add(role)
            assert node["name"]["value"].strip(), node
    assert roles >= {"link", "image", "region", "table", "navigation"}
