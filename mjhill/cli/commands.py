"""The commands, except check, identify, reproduce and view, which have their own files."""

from __future__ import annotations

import math
from collections.abc import Collection
from pathlib import Path
from typing import Any

import click

from mjhill.cli.check import check
from mjhill.cli.group import Group
from mjhill.cli.identify import identify
from mjhill.cli.ladder import ladder
from mjhill.cli.printing import (
    json_option,
    print_json,
    print_line,
    print_paths,
    print_table,
    progress_bar,
    shown,
)
from mjhill.cli.reproduce import reproduce
from mjhill.cli.view import view

_OUT = Path("out")
_GRAVITY = "The models of these joints have no gravity, as in the paper."
_SUFFIXES = {"recording": (".csv", ".npz"), "plot": (".png",), "video": (".mp4", ".gif")}


_OUTPUT_HELP = "The {}; by default out/{}-MODEL.{}."
_FRAMES = 1_000_000  # at most in a film: nine hours at 30 per second


@click.group(cls=Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="mjhill")
def main() -> None:
    """Physiological muscle for MuJoCo: the Hill-based system of Winters & Stark (1987)."""


main.add_command(check)
main.add_command(identify)
main.add_command(ladder)
main.add_command(reproduce)
main.add_command(view)


def _inputs_options(function: Any) -> Any:
    torque = click.option(
        "--torque",
        "-t",
        multiple=True,
        metavar="JOINT=N·m[@START[:END]]",
        help="External torque on a joint, on a slide a force in N; several add up.",
    )
    excite = click.option(
        "--excite",
        "-e",
        multiple=True,
        metavar="MUSCLE=EXCITATION[@START[:END]]",
        help="Excitation of a muscle, 0 to 1; several add up. Without --excite and --torque: "
        "the movement of demo.",
    )
    return excite(torque(function))


muscle_option = click.option(
    "--muscle",
    metavar="NAME",
    help="Muscle model in the place of hill, such as hill-rigid.",
)
bins_option = click.option(
    "--bins", type=click.IntRange(min=1), help="Bins of the muscle model huxley; by default 100."
)


@main.command()
@click.option("--output", "-o", type=click.Path(path_type=Path), default=_OUT, help="Folder.")
@json_option
def demo(output: Path, as_json: bool) -> None:
    """Run the scripted movement of the elbow; write video, plot and recording."""
    files = {
        "video": output / "demo-elbow.mp4",
        "plot": output / "demo-elbow.png",
        "recording": output / "demo-elbow.csv",
    }
    output.mkdir(parents=True, exist_ok=True)
    _film("elbow", {}, {}, 4.0, files, as_json)


@main.command("list")
@json_option
def list_(as_json: bool) -> None:
    """List the joints of mjhill."""
    from mjhill.joints.reader import JOINTS

    rows = [
        {
            "joint": joint.name,
            "positive": joint.positive,
            "muscles": ", ".join(joint.muscles),
            "inertia [kg·m²]": joint.inertia,
        }
        for joint in JOINTS.values()
    ]
    print_table(rows, as_json, title="Joints")
    if not as_json:
        print_line(_GRAVITY)


@main.command()
@click.argument("model")
@click.option("--mjcf", is_flag=True, help="Print the MJCF of the muscles.")
@muscle_option
@json_option
def info(model: str, mjcf: bool, muscle: str | None, as_json: bool) -> None:
    """Show the parameters of MODEL, a joint's name or a path, with units and sources."""
    from mjhill.cli.describe import gravity, rows
    from mjhill.engine.mjcf import snippet
    from mjhill.simulate.load import load

    if mjcf:
        click.echo(snippet(load(model, muscle)))
        return
    print_table(rows(model, muscle), as_json, title=model)
    if not as_json:
        print_line(f"Gravity: {gravity(model)}")


@main.command()
@click.argument("model")
@_inputs_options
@muscle_option
@bins_option
@click.option("--duration", "-d", default=4.0, show_default=True, help="Duration [s].")
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    help=_OUTPUT_HELP.format("recording, .csv or .npz", "run", "csv"),
)
@click.option("--plot", "-p", type=click.Path(path_type=Path), help="Picture, .png.")
@json_option
def run(
    model: str,
    excite: tuple[str, ...],
    torque: tuple[str, ...],
    muscle: str | None,
    bins: int | None,
    duration: float,
    output: Path | None,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Run MODEL, a joint's name or a path, and record it."""
    files = {"recording": output or _OUT / f"run-{Path(model).stem}.csv"}
    if plot:
        files["plot"] = plot
    _film(model, _parse(excite), _parse(torque), duration, files, as_json, muscle, bins)


@main.command()
@click.argument("model")
@_inputs_options
@muscle_option
@bins_option
@click.option("--duration", "-d", default=4.0, show_default=True, help="Duration [s].")
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    help=_OUTPUT_HELP.format("film, .mp4 or .gif", "video", "mp4"),
)
@click.option("--fps", default=30.0, show_default=True, help="Frames per second.")
@click.option(
    "--speed", default=1.0, show_default=True, help="1 is real time, 0.1 is ten times slower."
)
@click.option("--size", nargs=2, type=int, default=(1280, 720), show_default=True)
@click.option("--camera", help="Name of a camera of the model.")
@json_option
def video(
    model: str,
    excite: tuple[str, ...],
    torque: tuple[str, ...],
    muscle: str | None,
    bins: int | None,
    duration: float,
    output: Path | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Film MODEL, a joint's name or a path, without a screen."""
    _check_frames(duration, options["fps"], options["speed"])
    files = {"video": output or _OUT / f"video-{Path(model).stem}.mp4"}
    _film(model, _parse(excite), _parse(torque), duration, files, as_json, muscle, bins, **options)


@main.command()
@click.argument("models", nargs=-1, metavar="[MODEL]...")
@click.option("--output", "-o", type=click.Path(path_type=Path), default=_OUT / "compare",
              show_default=True, help="Folder; each model gets a folder in it.")  # fmt: skip
@click.option("--video/--no-video", default=True, show_default=True)
@click.option(
    "--cost/--no-cost", default=True, show_default=True, help="Also measure the time of a step."
)
@muscle_option
@json_option
def compare(
    models: tuple[str, ...],
    output: Path,
    video: bool,
    cost: bool,
    muscle: str | None,
    as_json: bool,
) -> None:
    """Compare each MODEL's muscles with MuJoCo's own on the same plant and inputs.

    A MODEL is a joint's name or a path; the default is the elbow. --json prints a list with one
    item for each model.
    """
    from mjhill import comparison

    models = tuple(dict.fromkeys(models)) or ("elbow",)
    folders = _folders(models, output)
    for model in models:
        comparison.check(model, muscle)  # before the first comparison, which takes time
    results = []
    for model in models:
        result, paths = _compare(model, folders[model], video, cost, muscle)
        if as_json:
            results.append({**result.as_dict(), "files": list(map(str, paths))})
        else:
            _print_comparison(result, paths, "" if len(models) == 1 else f"{model}: ")
    if as_json:
        print_json(results)


@main.command()
@click.argument("names", nargs=-1)
@click.option(
    "--count",
    type=click.IntRange(1),
    help="sweep: systems of each kind; fuzz, checks: models; endurance: steps; intervals: fits.",
)
@click.option(
    "--kind", multiple=True,
    help="sweep, fuzz: kind of model; intervals: kind of inputs; several are possible; "
    "literature: variants or facts.",
)  # fmt: skip
@click.option(
    "--case", metavar="KIND:NUMBER",
    help="sweep, fuzz, checks: run one model again; intervals: one fit, JOINT:KIND:RATE:NUMBER.",
)  # fmt: skip
@json_option
def bench(
    names: tuple[str, ...],
    count: int | None,
    kind: tuple[str, ...],
    case: str | None,
    as_json: bool,
) -> None:
    """Run the benchmarks NAMES: accuracy, balance, cost, threads, start, video; by default all.

    All of them take about 5 minutes on two cores. Most of that is video, which a graphics card
    makes faster. The tables show goals and whether they were met.

    More benchmarks, one at a time, with their time on two cores: sweep, random systems against
    the reference solver (2 minutes); fuzz, 100,000 random models (5 minutes); checks, check_model
    on sound and unsound models (3 minutes); endurance, 10⁸ steps (2 minutes); literature, the
    joints fitted in other ways (8 minutes); intervals, 900 simulated measurements fitted back
    (15 minutes).
    """
    from mjhill import benchmarks

    long = names[0] if len(names) == 1 and names[0] in benchmarks.LONG else ""
    if (count or kind or case) and not long:
        listed = ", ".join(benchmarks.LONG)
        raise click.UsageError(
            f"--count, --kind and --case need exactly one of these benchmarks: {listed}"
        )
    chosen = names if long else benchmarks.check_names(names)
    if not (count or case):
        length = benchmarks.length(chosen)
        print_line(f"{', '.join(chosen)}: {length} on two cores", err=True)
    with progress_bar("measuring") as progress:
        if long:
            results = {long: benchmarks.run_long(long, kind, count, case, progress)}
        else:
            results = benchmarks.run(names, progress)
    if as_json:
        print_json({name: result.rows for name, result in results.items()})
        return
    print_line(benchmarks.versions())
    for result in results.values():
        print_table(result.rows, False, title=result.title)
        for note in result.notes:
            print_line(f"  {note}")


def _folders(models: tuple[str, ...], output: Path) -> dict[str, Path]:
    """The folder of each model."""
    folders = {model: output / Path(model).stem for model in models}
    for model, folder in folders.items():
        alike = [other for other in models if folders[other] == folder and other != model]
        if alike:
            raise ValueError(
                f"{model} and {alike[0]} would both be written to {folder}; compare each "
                "of them with another --output"
            )
    return folders


def _compare(
    model: str, folder: Path, video: bool, cost: bool, muscle: str | None
) -> tuple[Any, list[Path]]:
    """Compare one model and write the files."""
    from dataclasses import replace

    from mjhill import comparison

    with progress_bar(f"comparing {model}") as progress:
        result = comparison.compare(model, muscle=muscle, progress=progress)
    if cost:
        with progress_bar(f"timing steps of {model}") as progress:
            result = replace(
                result, cost=comparison.step_cost(model, muscle=muscle, progress=progress)
            )
    with progress_bar(f"writing {model}") as progress:
        return result, comparison.write(result, folder, video=video, progress=progress)


def _print_comparison(result: Any, paths: list[Path], of: str) -> None:
    from dataclasses import asdict

    matches = [asdict(match) for match in result.matching]
    print_table(matches, False, title=f"{of}What is matched")
    rows = [{**asdict(row), "ratio": row.ratio} for row in result.rows]
    print_table(rows, False, title=f"{of}What differs")
    if result.cost:
        print_table([result.cost.as_dict()], False, f"{of}Cost of a step [µs]", across=False)
    print_paths({path.name: path for path in paths})


def _film(
    model: str,
    excitation: dict[str, Any],
    torque: dict[str, Any],
    duration: float,
    files: dict[str, Path],
    as_json: bool,
    muscle: str | None = None,
    bins: int | None = None,
    **video: Any,
) -> None:
    """Run a model from its home pose, write the ``files`` and print a summary."""
    from mjhill.files import check_writable
    from mjhill.simulate import scripted
    from mjhill.simulate.load import load

    for kind, path in files.items():
        if path.suffix not in _SUFFIXES[kind]:
            wanted = " or ".join(_SUFFIXES[kind])
            raise ValueError(f"{kind} {str(path)!r} must end in {wanted}")
    loaded = load(model, muscle, bins)
    for path in files.values():
        if path.parent == _OUT:
            _OUT.mkdir(exist_ok=True)
        check_writable(path)
    replaced = [path for path in files.values() if path.exists()]
    with progress_bar("running") as progress:
        recording = scripted.run_loaded(loaded, excitation, torque, duration, progress)
    if "recording" in files:
        recording.save(files["recording"])
    if "plot" in files:
        from mjhill.draw.plot import plot_recording

        plot_recording(recording, files["plot"], title=model)
    if "video" in files:
        from mjhill.draw import View, render

        with progress_bar("filming") as progress:
            render(
                View(loaded, recording, Path(model).stem),
                files["video"],
                progress=lambda done, total: progress(done / total),
                **video,
            )
    _summary(recording, files, replaced, as_json)


def _check_frames(duration: float, fps: float, speed: float) -> None:
    frames = fps * duration / speed if speed > 0 else 0.0  # render rejects other speeds
    if math.isfinite(duration) and frames > _FRAMES:
        raise ValueError(
            f"a film of {duration:g} s at speed {speed:g} and {fps:g} frames per second "
            f"has {frames:.4g} frames; at most {_FRAMES:,} are allowed: lower --duration or "
            "--fps, or raise --speed"
        )


def _parse(items: tuple[str, ...]) -> dict[str, Any]:
    """Signals by name, from ``NAME=VALUE[@START[:END]]``."""
    from mjhill.simulate.signals import Signal, as_signal, pulse, step

    signals: dict[str, Signal] = {}
    for item in items:
        name, found, text = item.partition("=")
        value, at, span = text.partition("@")
        start, colon, end = span.partition(":")
        try:
            if not found:
                raise ValueError
            if colon:
                begin = float(start)
                signal = pulse(float(value), begin, float(end) - begin)
            else:
                signal = step(float(value), float(start)) if at else as_signal(float(value))
        except ValueError:
            raise ValueError(
                f"input {item!r} must be NAME=VALUE, NAME=VALUE@START or NAME=VALUE@START:END, "
                "such as elbow_flexor=0.5@0.1:0.3 (times in s, END after START)"
            ) from None
        signals[name] = signals[name] + signal if name in signals else signal
    return signals


def _summary(
    recording: Any, files: dict[str, Path], replaced: Collection[Path], as_json: bool
) -> None:
    from mjhill.simulate.scripted import summary

    numbers = summary(recording)
    if as_json:
        paths = {name: str(path) for name, path in files.items()}
        print_json({"files": paths, "replaced": list(map(str, replaced)), **numbers})
        return
    for name, value in numbers.items():
        print_line(f"{name}: {shown(value)}")
    print_paths(files, replaced)
