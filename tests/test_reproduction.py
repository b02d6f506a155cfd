import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path

import psutil
import pytest
from click.testing import CliRunner
from small_experiments import HOSTILE, entry

import mjhill
from mjhill.cli import main
from mjhill.report import CATALOGUE, Entry, fingerprint, report_of, reproduce, select, write_report
from mjhill.report.page import difference, duration, number, published
from mjhill.report.part import film_speed

TESTS = Path(__file__).parent


def made(folder):
    return {path.name: path.stat().st_mtime_ns for path in Path(folder).iterdir()}


RISES = (entry("rise", "elbow", "eye", filmed=True), entry("rise", "knee", id="rise_again"))


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A catalogue that ran: two joints filmed, one not, one failure; its folder and outcome."""
    folder = tmp_path_factory.mktemp("finished")
    outcome = reproduce(folder, catalogue=(*RISES, entry("failing")), jobs=2)
    write_report(report_of(outcome), folder)
    return folder, outcome


@pytest.fixture
def folder(finished, tmp_path):
    """A copy of that folder."""
    return Path(shutil.copytree(finished[0], tmp_path / "copy"))


def test_each_part_leaves_numbers_figure_and_film(finished):
    folder, outcome = finished
    names = ["rise-elbow", "rise-eye", "rise_again-knee"]
    assert [part.name for part, _ in outcome.parts] == names
    files = {f"{name}{end}" for name in names for end in (".json", ".png")}
    films = {"rise-elbow.mp4", "rise-eye.mp4"}
    assert set(made(folder)) == files | films | {"report.html", "report.json"}
    numbers = json.loads((folder / "rise-elbow.json").read_text())
    assert numbers["options"] == {"level": 0.5, "duration": 0.05, "exact": False}
    assert numbers["measures"][2]["value"] is None
    assert numbers["seconds"] > 0
    assert all((folder / film).stat().st_size < 200_000 for film in films)


def test_a_failing_part_leaves_the_others_and_says_why(finished):
    _, outcome = finished
    (failure,) = outcome.missing.values()
    assert failure.reason == "ValueError: the elbow would not <b>move</b>"
    assert "in failing" in failure.details
    assert outcome.exit_code == 1


def test_what_is_there_is_not_run_again(folder):
    before = made(folder)
    outcome = reproduce(folder, catalogue=RISES)
    assert (outcome.ran, outcome.exit_code) == ([], 0)
    assert reproduce(folder, catalogue=RISES, video=False).ran == []
    assert made(folder) == before


def test_what_is_to_be_fresh_is_run_again_and_gives_the_same_numbers(finished, folder):
    again = reproduce(folder, catalogue=RISES, only=["rise"], video=False, fresh=True, jobs=1)
    assert again.ran == ["rise-elbow", "rise-eye"]
    for (_, first), (_, second) in zip(finished[1].parts, again.parts, strict=True):
        assert first["measures"] == second["measures"]
        assert first["claims"] == second["claims"]


def test_damaged_numbers_and_lost_files_are_made_again(folder):
    (folder / "rise-elbow.json").write_text("{")
    (folder / "rise-eye.mp4").unlink()
    (folder / "rise_again-knee.png").unlink()
    assert reproduce(folder, catalogue=RISES, video=False).ran == ["rise-elbow", "rise_again-knee"]
    assert reproduce(folder, catalogue=RISES).ran == ["rise-elbow", "rise-eye"]
    assert (folder / "rise-eye.mp4").exists()


def test_a_film_that_fails_leaves_the_numbers_and_is_tried_again(tmp_path, monkeypatch):
    catalogue = (entry("rise", filmed=True),)
    monkeypatch.setenv("MUJOCO_EGL_DEVICE_ID", "99")  # there is none of that number
    outcome = reproduce(tmp_path, catalogue=catalogue)
    assert [part.name for part, _ in outcome.parts] == ["rise-elbow"]
    assert outcome.exit_code == 1
    (problem,) = outcome.problems.values()
    page = write_report(report_of(outcome), tmp_path)["page"].read_text()
    assert "No video" in page
    assert problem.split(":")[0] in page
    monkeypatch.delenv("MUJOCO_EGL_DEVICE_ID")
    assert reproduce(tmp_path, catalogue=catalogue).exit_code == 0


def test_parts_of_another_run_stay_in_the_report(folder):
    outcome = reproduce(folder, catalogue=RISES, only=["rise_again"], joints=["ankle"])
    assert outcome.ran == ["rise_again-ankle"]
    names = ["rise-elbow", "rise-eye", "rise_again-knee", "rise_again-ankle"]
    assert [part.name for part, _ in outcome.parts] == names


def test_a_changed_experiment_is_run_again_and_what_is_older_not_shown(tmp_path, monkeypatch):
    module = tmp_path / "changing_experiment.py"
    shutil.copy(TESTS / "small_experiments.py", module)
    monkeypatch.syspath_prepend(tmp_path)
    changing = Entry("rise", "changing_experiment:rise", ("elbow", "eye"))
    catalogue = (changing, entry("rise", id="same"))
    reproduce(tmp_path / "out", catalogue=catalogue)
    module.write_text(module.read_text().replace("level=0.5", "level=0.4"))
    outcome = reproduce(tmp_path / "out", catalogue=catalogue, joints=["elbow"])
    assert outcome.ran == ["rise-elbow"]
    assert [part.name for part, _ in outcome.parts] == ["rise-elbow", "same-elbow"]
    assert outcome.parts[0][1]["options"]["level"] == 0.4


def test_any_source_or_data_file_of_the_package_counts(tmp_path, monkeypatch):
    shutil.copytree(TESTS.parent / "mjhill", tmp_path / "mjhill")
    monkeypatch.setattr(fingerprint, "_PACKAGE", tmp_path / "mjhill")
    words = []
    for changed in (None, "elements.py", "engine/compiled.py", "literature/facts.toml"):
        if changed is not None:
            with open(tmp_path / "mjhill" / changed, "a", encoding="utf-8") as file:
                file.write("\n")
        fingerprint._own.cache_clear()
        words.append(fingerprint.fingerprint("mjhill.experiments.twitch"))
    fingerprint._own.cache_clear()
    assert len(set(words)) == len(words)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("crashing", "its process ended with exit code 7"),
        ("not_finite", "ValueError: result.measures[0].value is nan; a measure that was not seen"),
        ("nowhere", "AttributeError: module 'small_experiments' has no attribute 'nowhere'"),
    ],
)
def test_what_goes_wrong_in_a_part_is_told_and_leaves_nothing(tmp_path, name, reason):
    outcome = reproduce(tmp_path, catalogue=(entry(name), entry("rise")))
    (failure,) = outcome.missing.values()
    assert failure.reason.startswith(reason)
    assert set(made(tmp_path)) == {"rise-elbow.json", "rise-elbow.png"}


def test_an_experiment_that_is_not_there_fails_alone(tmp_path):
    catalogue = (Entry("lost", "mjhill.experiments.lost:lost", ("elbow",)), entry("rise"))
    outcome = reproduce(tmp_path, catalogue=catalogue)
    (failure,) = outcome.missing.values()
    assert failure.reason == "ModuleNotFoundError: there is no module mjhill.experiments.lost"
    assert outcome.ran == ["rise-elbow"]


INTERRUPTED = """
import sys
from small_experiments import entry
from mjhill.interrupts import handled
from mjhill.report import report_of, reproduce, write_report
catalogue = (entry("rise"), entry("endless"), entry("rise", id="last"))
with handled():
    outcome = reproduce(sys.argv[1], catalogue=catalogue, jobs=1)
    write_report(report_of(outcome), sys.argv[1])
sys.exit(outcome.exit_code)
"""


def ended(folder, number, whole_group):
    """Exit code and words of a run that gets a signal while a part is at work in a process."""
    at_work = folder.with_name(f"{folder.name}.at_work")
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, str(folder)],
        env={**os.environ, "PYTHONPATH": f"{TESTS}:{TESTS.parent}", "AT_WORK": str(at_work)},
        start_new_session=True,  # a group of its own, to which Ctrl-C goes as in a terminal
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        until = time.monotonic() + 60
        while not at_work.exists():
            assert time.monotonic() < until
            assert process.poll() is None
            time.sleep(0.05)
        group = psutil.Process(process.pid).children(recursive=True)
        assert group
        (os.killpg if whole_group else os.kill)(process.pid, number)
        _, errors = process.communicate(timeout=30)
    finally:
        process.kill()
        process.communicate()
    _, alive = psutil.wait_procs(group, timeout=10)
    assert alive == []
    return process.returncode, errors


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_killed_run_leaves_no_process_and_no_half_file(tmp_path, number):
    code, _ = ended(tmp_path, number, whole_group=False)
    assert code == (143 if number == signal.SIGTERM else -number)
    assert set(made(tmp_path)) == {"rise-elbow.json", "rise-elbow.png"}


def test_ctrl_c_keeps_what_is_finished_and_leaves_no_process(tmp_path):
    assert ended(tmp_path, signal.SIGINT, whole_group=True) == (130, "")
    assert set(made(tmp_path)) == {
        "rise-elbow.json",
        "rise-elbow.png",
        "report.html",
        "report.json",
    }
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["interrupted"]
    reasons = {part["name"]: part["reason"] for part in report["missing"]}
    assert reasons == dict.fromkeys(
        ["endless-elbow", "last-elbow"], "interrupted before it was done"
    )
    assert "Interrupted: what is not here" in (tmp_path / "report.html").read_text()


def test_an_interruption_does_not_hide_what_was_there_before(finished, folder):
    def interrupt(share):
        raise KeyboardInterrupt

    outcome = reproduce(folder, catalogue=RISES, fresh=True, progress=interrupt)
    assert outcome.exit_code == 130
    assert outcome.parts == finished[1].parts
    assert not outcome.missing
    assert not list(folder.glob(".*"))


def test_progress_rises_to_one(tmp_path):
    shares = []
    reproduce(tmp_path, catalogue=(entry("rise", "elbow", "eye"),), progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len(set(shares)) > 2


class Page(HTMLParser):
    """What a page loads, where it links to, and its text without markup."""

    def __init__(self, text):
        super().__init__()
        self.loads, self.links, self.ids, self.tags, self.text = [], [], [], [], ""
        self.feed(text)
        self.text = re.sub(r"[ \n]+", " ", self.text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        for name, value in attributes:
            if name in {"src", "srcset", "poster", "data", "action"} or (tag, name) == (
                "link",
                "href",
            ):
                self.loads.append(value)
            elif name == "href":
                self.links.append(value)
            elif name == "id":
                self.ids.append(value)

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def page(finished):
    return Page((finished[0] / "report.html").read_text())


def test_the_page_loads_nothing_from_elsewhere(finished, page):
    assert page.loads
    assert all(value.startswith("data:") for value in page.loads)
    text = (finished[0] / "report.html").read_text()
    assert not re.search(r"https?://|url\(|@import", text)


def test_links_lead_to_places_in_the_page_and_no_place_stands_twice(page):
    assert len(page.ids) == len(set(page.ids))
    assert {link.removeprefix("#") for link in page.links} <= set(page.ids)


def test_text_of_an_experiment_is_text_and_nothing_else(page):
    assert "script" not in page.tags
    assert "b" not in page.tags
    assert HOSTILE in page.text
    assert "49" not in page.text.replace(HOSTILE, "").split()
    assert "the elbow would not <b>move</b>" in page.text


def test_every_measure_and_claim_is_in_the_page_and_in_the_json(finished, page):
    folder, outcome = finished
    report = json.loads((folder / "report.json").read_text())
    assert len(report["parts"]) == len(outcome.parts) == 3
    for part, numbers in zip(report["parts"], outcome.parts, strict=True):
        assert numbers[1].items() <= part.items()
        assert part["command"] in page.text
        for claim in part["claims"]:
            assert f"{claim['sentence']} {claim['section']}" in page.text
            assert claim["evidence"] in page.text
        for measure in part["measures"]:
            assert measure["name"] in page.text
            assert measure["note"] in page.text
            if measure["value"] is not None:
                assert number(measure["value"]) in page.text
    assert report["claims"] == {"hold": 3, "do not hold": 3, "not decided": 3}
    assert "3 of 9 claims hold" in page.text
    assert "11 % above" in page.text.replace("\N{NARROW NO-BREAK SPACE}", " ")
    assert report["missing"][0]["command"] == "mjhill reproduce --only failing --joint elbow"


def test_the_catalogue_has_the_joints_it_names_and_each_experiment_once():
    assert len({entry.id for entry in CATALOGUE}) == len(CATALOGUE)
    for part in select(CATALOGUE):
        assert part.joint in mjhill.JOINTS
        assert part.entry.path == f"mjhill.experiments.{part.entry.id}:{part.entry.id}"


def test_an_experiment_that_needs_its_own_joints_is_left_out_or_refused_on_others():
    assert all(part.entry.id != "synergists" for part in select(CATALOGUE, joints=["knee"]))
    with pytest.raises(ValueError, match="synergists runs on elbow only"):
        select(CATALOGUE, ["synergists"], ["knee"])


def test_joints_asked_for_replace_those_of_each_experiment():
    parts = select(CATALOGUE, ["step", "twitch"], ["hip", "eye", "hip"])
    assert [part.name for part in parts] == ["twitch-hip", "twitch-eye", "step-hip", "step-eye"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--only", "dance"), "unknown experiment 'dance'; there are: synergists, twitch"),
        (("--joint", "wing"), "unknown joint 'wing'; there are: elbow"),
    ],
)
def test_unknown_names_end_in_exit_code_2_and_write_nothing(tmp_path, arguments, message):
    result = CliRunner().invoke(main, ["reproduce", *arguments, "-o", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert message in result.stderr
    assert not (tmp_path / "out").exists()


def test_the_command_runs_an_experiment_of_the_paper_once(tmp_path):
    pytest.importorskip("mjhill.experiments.tetanus")
    command = ["reproduce", "--only", "tetanus", "--joint", "eye", "--no-video", "-o", "out"]
    first = CliRunner().invoke(main, [*command, "--json"])
    assert first.exit_code == 0, first.stderr
    (part,) = json.loads(first.stdout)["parts"]
    assert (part["id"], part["joint"]) == ("tetanus", "eye")
    assert part["measures"]
    before = made("out")
    again = CliRunner().invoke(main, command)
    assert "report.html" in again.stdout
    assert made("out")["tetanus-eye.json"] == before["tetanus-eye.json"]


def test_a_run_is_shown_slowly_enough_and_no_longer_than_four_seconds():
    assert film_speed(4.0) == 1
    assert film_speed(0.2) == 0.05
    for run in (0.001, 0.3, 1.0, 1.1, 7.0, 100.0):
        assert 1 < run / film_speed(run) <= 4.0 or run < 0.02


def test_numbers_read_as_in_print():
    written = {
        0: "0",
        12.3456: "12.35",
        -0.5: "\N{MINUS SIGN}0.5",
        1234.5: "1234",
        0.012: "0.012",
        100: "100",
    }
    assert {value: number(value) for value in written} == written
    assert number(1.7e-5) == "1.7\u202f\N{MULTIPLICATION SIGN}\u202f10⁻⁵"
    assert number(9.99999e-4) == "1\u202f\N{MULTIPLICATION SIGN}\u202f10⁻³"
    assert published((2, 3), "°") == "2 to 3°"
    assert published(None, "s") == ""


def test_differences_are_taken_to_the_nearest_end_of_a_range():
    cases = {
        (2.5, (2, 3)): "within",
        (1.0, (2, 3)): "50 % below",
        (3.3, (2, 3)): "10 % above",
        (5.0, (5, 5)): "equal",
        (-5.5, (-5, -5)): "10 % below",
        (20.0, (5, 5)): "4 times",
        (None, (5, 5)): "",
        (1.0, None): "",
    }
    shown = {case: difference(*case).replace("\u202f", " ") for case in cases}
    assert shown == cases
    assert [duration(s) for s in (0.42, 14.2, 200, 120)] == [
        "0.42 s",
        "14 s",
        "3 min 20 s",
        "2 min",
    ]


def test_ctrl_c_reaches_the_parent_alone(tmp_path):
    outcome = reproduce(tmp_path, catalogue=(entry("signalled"), entry("rise")), jobs=2)
    assert outcome.exit_code == 0
    assert outcome.ran == ["signalled-elbow", "rise-elbow"]


def test_ctrl_c_while_a_process_starts_is_quiet_and_leaves_no_process(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, str(tmp_path)],
        env={**os.environ, "PYTHONPATH": f"{TESTS}:{TESTS.parent}", "AT_WORK": os.devnull},
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
    )
    until = time.monotonic() + 60
    # the folder is there before the process is
    while not list(tmp_path.glob(".endless*")) and time.monotonic() < until:
        time.sleep(0.001)
    try:
        os.killpg(process.pid, signal.SIGINT)
        assert process.communicate(timeout=30) == (None, "")
    finally:
        process.kill()
    assert process.returncode == 130
    group = [p for p in psutil.process_iter() if p.pid != os.getpid() and in_group(p, process.pid)]
    assert psutil.wait_procs(group, timeout=10)[1] == []


def in_group(process, group):
    try:
        return os.getpgid(process.pid) == group
    except ProcessLookupError:
        return False
