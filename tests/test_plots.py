"""Pictures of recordings: what is drawn, and what is refused."""

import itertools

import numpy as np
import pytest

from mjhill.draw import plot as plots
from mjhill.draw.bellies import MUSCLE_COLOURS
from mjhill.draw.plot import plot_overlay, plot_recording
from mjhill.simulate.recording import Recording

TIME = np.linspace(0.0, 1.0, 50)
UNITS = {
    "angle": "rad", "position": "m", "velocity": "rad/s", "applied": "N·m",
    "u": "-", "n": "-", "a": "-", "force": "N·m", "stretch": "rad",
}  # fmt: skip


def recording(joints=("knee",), muscles=("front", "back"), native=False, scale=1.0) -> Recording:
    series = {}
    for i, joint in enumerate(joints):
        series[f"{joint}.angle"] = scale * np.sin(TIME + i)
        series[f"{joint}.velocity"] = scale * np.cos(TIME + i)
    for i, muscle in enumerate(muscles):
        for name in (
            ("u", "a", "force") if native else ("u", "n", "a", "velocity", "stretch", "force")
        ):
            series[f"{muscle}.{name}"] = scale * (0.1 + i + np.cos(3 * TIME))
    units = {name: UNITS[name.rpartition(".")[2]] for name in series}
    return Recording(TIME, series, units, {"model": "leg"})


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list:
    """The figures that are drawn, in order."""
    from matplotlib.figure import Figure

    drawn: list[Figure] = []
    save = Figure.savefig

    def keep(figure: Figure, *arguments: object, **options: object) -> None:
        drawn.append(figure)
        save(figure, *arguments, **options)

    monkeypatch.setattr(Figure, "savefig", keep)
    return drawn


def labels(figure) -> list[str]:
    return [axis.get_ylabel() for axis in figure.axes]


def boxes(figure) -> list:
    """What must neither meet nor be cut off: axes with their labels, and the legend."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    return [item.get_tightbbox(renderer) for item in (*figure.axes, *figure.legends)]


def test_a_recording_becomes_stacked_axes_with_units(tmp_path, figures) -> None:
    path = plot_recording(recording(), tmp_path / "run.png")
    assert path.read_bytes().startswith(b"\x89PNG")
    assert labels(figures[0]) == [
        "angle [°]",
        "joint velocity [°/s]",
        "u, n, a [-]",
        "muscle torque [N·m]",
        "CE shortening [°/s]",
        "SE stretch [°]",
    ]
    assert figures[0].axes[-1].get_xlabel() == "time [s]"
    assert figures[0].legends[0].get_title().get_text() == "leg"


def test_angles_are_drawn_in_degrees(tmp_path, figures) -> None:
    run = recording()
    plot_recording(run, tmp_path / "run.png", muscles=[])
    line = figures[0].axes[0].lines[0]
    np.testing.assert_allclose(line.get_ydata(), np.degrees(run["knee.angle"]))


def test_a_muscle_has_one_colour_on_all_axes(tmp_path, figures) -> None:
    plot_recording(recording(), tmp_path / "run.png")
    for axis in figures[0].axes[3:]:
        assert [line.get_color() for line in axis.lines] == list(MUSCLE_COLOURS[:2])
    chosen = [handle.get_color() for handle in figures[0].legends[0].legend_handles]
    assert chosen == list(MUSCLE_COLOURS[:2])


def test_a_muscle_keeps_its_colour_when_it_is_drawn_alone(tmp_path, figures) -> None:
    plot_recording(recording(), tmp_path / "run.png", joints=[], muscles=["back"])
    assert {line.get_color() for axis in figures[0].axes for line in axis.lines} == {
        MUSCLE_COLOURS[1]
    }


def test_a_native_muscle_is_drawn_without_what_it_lacks(tmp_path, figures) -> None:
    plot_recording(recording(native=True), tmp_path / "run.png")
    assert labels(figures[0])[2:] == ["u, n, a [-]", "muscle torque [N·m]"]


def test_an_overlay_gives_each_recording_a_style(tmp_path, figures) -> None:
    runs = {"ours": recording(), "theirs": recording(native=True, scale=2.0)}
    plot_overlay(runs, tmp_path / "both.png", title="Both")
    figure = figures[0]
    assert labels(figure) == [
        "angle [°]", "joint velocity [°/s]", "activation a [-]", "muscle torque [N·m]",
    ]  # fmt: skip
    for axis in figure.axes:
        styles = {line.get_linestyle() for line in axis.lines}
        assert styles == {"-", "--"}
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == ["front", "back", "ours", "theirs"]


def test_nothing_overlaps_and_nothing_is_cut_off(tmp_path, figures) -> None:
    runs = {"ours": recording(("hip", "knee")), "theirs": recording(("hip", "knee"))}
    plot_overlay(runs, tmp_path / "both.png", title="Both muscles\non one leg")
    plot_recording(recording(), tmp_path / "run.png")
    for figure in figures:
        frame, found = figure.bbox, boxes(figure)
        for box in found:
            assert frame.x0 <= box.x0 < box.x1 <= frame.x1
            assert frame.y0 <= box.y0 < box.y1 <= frame.y1
        for one, other in itertools.combinations(found, 2):
            # half a pixel of rounding
            assert min(one.y1, other.y1) - max(one.y0, other.y0) < 0.5


def test_a_constant_activation_is_not_magnified(tmp_path, figures) -> None:
    run = recording()
    flat = {**run.series, "front.a": np.full_like(TIME, 0.1), "back.a": np.full_like(TIME, 0.1)}
    flat_run = Recording(TIME, flat, run.units)
    plot_overlay({"flat": flat_run}, tmp_path / "flat.png", joints=[])
    low, high = figures[0].axes[0].get_ylim()
    assert low <= 0
    assert high >= 0.1


def test_unknown_names_are_answered_with_the_known_ones(tmp_path) -> None:
    with pytest.raises(ValueError, match="no joint 'hip'; there are: knee"):
        plot_recording(recording(), tmp_path / "run.png", joints=["hip"])
    with pytest.raises(ValueError, match="no muscle 'side'; there are: front, back"):
        plot_overlay({"ours": recording()}, tmp_path / "run.png", muscles=["side"])


def test_wrong_requests_leave_no_file(tmp_path) -> None:
    with pytest.raises(ValueError, match=r"must end in \.png"):
        plot_recording(recording(), tmp_path / "run.pdf")
    with pytest.raises(ValueError, match="nothing to draw"):
        plot_recording(recording(), tmp_path / "run.png", joints=[], muscles=[])
    with pytest.raises(ValueError, match="1 to 4 recordings, got 0"):
        plot_overlay({}, tmp_path / "run.png")
    with pytest.raises(FileNotFoundError, match="does not exist"):
        plot_recording(recording(), tmp_path / "missing" / "run.png")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_drawing_leaves_the_old_picture(tmp_path, monkeypatch) -> None:
    path = plot_recording(recording(), tmp_path / "run.png")
    before = path.read_bytes()

    def fail(*_: object) -> None:
        raise RuntimeError("no")

    monkeypatch.setattr(plots, "_draw_axis", fail)
    with pytest.raises(RuntimeError):
        plot_recording(recording(scale=2), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
