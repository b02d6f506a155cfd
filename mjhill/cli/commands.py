"""The commands, but for identify and reproduce, which have files of their own."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import click

from mjhill.cli.check import check
from mjhill.cli.identify import identify
from mjhill.cli.printing import json_option, print_paths, print_table, progress_bar, shown
from mjhill.cli.reproduce import reproduce
from mjhill.cli.view import view

_OUT = Path("out")
_SUFFIXES = {"recording": (".csv", ".npz"), "plot": (".png",), "video": (".mp4", ".gif")}


class _Group(click.Group):
    """Turns the errors that mjhill raises for people into one line and an exit code."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except (click.exceptions.Exit, click.exceptions.Abort):
            raise  # --help ends in one, an interrupt in the other; both are RuntimeErrors
        except (ValueError, TypeError, KeyError) as error:
            self._fail(error, code=2)  # the input was wrong
        except (RuntimeError, OSError) as error:
            self._fail(error, code=1)  # the machine or the run was

    @staticmethod
    def _fail(error: Exception, code: int) -> None:
        message = error.args[0] if isinstance(error, KeyError) else error
        click.echo(f"error: {message}", err=True)
        sys.exit(code)


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="mjhill")
def main() -> None:
    """Physiological muscle for MuJoCo: the Hill-based system of Winters & Stark (1987)."""


main.add_command(check)
main.add_command(identify)
main.add_command(reproduce)
main.add_command(view)


def _inputs_option(function: Any) -> Any:
    return click.option(
        "--excite",
        "-e",
        multiple=True,
        metavar="MUSCLE=LEVEL[@START[:END]]",
        help="Neural input of a muscle, 0 to 1; several add up. Without any: the movement of demo.",
    )(function)


@main.command()
@click.option("--output", "-o", type=click.Path(path_type=Path), default=_OUT, help="Folder.")
@json_option
def demo(output: Path, as_json: bool) -> None:
    """Run the elbow through its scripted movement; write video, plot and recording."""
    files = {
        "video": output / "elbow.mp4",
        "plot": output / "elbow.png",
        "recording": output / "elbow.csv",
    }
    output.mkdir(parents=True, exist_ok=True)
    recording = _film("elbow", {}, duration=4.0, files=files)
    _summary(recording, files, as_json)


@main.command("list")
@json_option
def list_(as_json: bool) -> None:
    """List the joints that come with mjhill."""
    from mjhill.joints import JOINTS

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


@main.command()
@click.argument("model")
@click.option("--mjcf", is_flag=True, help="Print the MJCF of the muscles instead.")
@json_option
def info(model: str, mjcf: bool, as_json: bool) -> None:
    """Show the parameters of MODEL, a joint's name or a path, with units and sources."""
    from mjhill.describe import rows
    from mjhill.mjcf import snippet

    if mjcf:
        click.echo(snippet(model))
        return
    print_table(rows(model), as_json, title=model)


@main.command()
@click.argument("model")
@_inputs_option
@click.option("--torque", "-t", multiple=True, metavar="JOINT=N·m[@START[:END]]")
@click.option("--duration", "-d", default=4.0, show_default=True, help="Length [s].")
@click.option("--output", "-o", type=click.Path(path_type=Path), help="Recording, .csv or .npz.")
@click.option("--plot", "-p", type=click.Path(path_type=Path), help="Picture, .png.")
@json_option
def run(
    model: str,
    excite: tuple[str, ...],
    torque: tuple[str, ...],
    duration: float,
    output: Path | None,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Run MODEL, a joint's name or a path, and record it."""
    files = {"recording": output or _OUT / f"{Path(model).stem}.csv"}
    if plot:
        files["plot"] = plot
    _make_default_folder(files)
    recording = _film(model, _parse(excite), duration, files, torque=_parse(torque))
    _summary(recording, files, as_json)


@main.command()
@click.argument("model")
@_inputs_option
@click.option("--duration", "-d", default=4.0, show_default=True, help="Length [s].")
@click.option("--output", "-o", type=click.Path(path_type=Path), help="Film, .mp4 or .gif.")
@click.option("--fps", default=30.0, show_default=True, help="Frames per second.")
@click.option("--speed", default=1.0, show_default=True, help="1 is real time, less is slow.")
@click.option("--size", nargs=2, type=int, default=(1280, 720), show_default=True)
@click.option("--camera", help="Camera of the model.")
@json_option
def video(model: str, excite: tuple[str, ...], as_json: bool, **options: Any) -> None:
    """Film MODEL, a joint's name or a path, without a screen."""
    output = options.pop("output") or _OUT / f"{Path(model).stem}.mp4"
    files = {"video": output}
    _make_default_folder(files)
    duration = options.pop("duration")
    recording = _film(model, _parse(excite), duration, files, **options)
    _summary(recording, files, as_json)


@main.command()
@click.argument("model", default="elbow")
@click.option("--output", "-o", type=click.Path(path_type=Path), default=_OUT / "compare")
@click.option("--video/--no-video", default=True, show_default=True)
@click.option("--cost/--no-cost", default=True, show_default=True, help="Time the steps too.")
@json_option
def compare(model: str, output: Path, video: bool, cost: bool, as_json: bool) -> None:
    """Compare MODEL's muscles with MuJoCo's own on the same plant and inputs."""
    from dataclasses import asdict, replace

    from mjhill import comparison

    with progress_bar("comparing") as progress:
        result = comparison.compare(model, progress=progress)
    if cost:
        with progress_bar("timing steps") as progress:
            result = replace(result, cost=comparison.step_cost(model, progress=progress))
    with progress_bar("writing") as progress:
        paths = comparison.write(result, output, video=video, progress=progress)
    if as_json:
        click.echo(json.dumps(result.as_dict(), ensure_ascii=False))
        return
    print_table([asdict(match) for match in result.matching], False, title="What is matched")
    rows = [{**asdict(row), "ratio": row.ratio} for row in result.rows]
    print_table(rows, False, title="What differs")
    if result.cost:
        print_table([result.cost.as_dict()], False, title="Cost of a step [µs]", across=False)
    print_paths({path.name: path for path in paths})


@main.command()
@click.argument("names", nargs=-1)
@click.option(
    "--count",
    type=click.IntRange(1),
    help="sweep: systems of each kind; fuzz, checks: models; endurance: steps.",
)
@click.option("--kind", multiple=True, help="sweep, fuzz: kind of model; may be given again.")
@click.option("--case", metavar="KIND:NUMBER", help="sweep, fuzz, checks: one model again.")
@json_option
def bench(
    names: tuple[str, ...],
    count: int | None,
    kind: tuple[str, ...],
    case: str | None,
    as_json: bool,
) -> None:
    """Measure accuracy, cost, threads, start and video, or those of NAMES.

    By name only, on two cores: sweep, random systems against the reference solver (2 minutes);
    fuzz, 100,000 models with anything that is accepted (10 minutes); checks, sound and unsound
    models past check_model (4 minutes); endurance, 10⁸ steps (3 minutes).
    """
    from mjhill import bench as benchmarks

    long = names[0] if len(names) == 1 and names[0] in benchmarks.LONG else ""
    if (count or kind or case) and not long:
        listed = ", ".join(benchmarks.LONG)
        raise click.UsageError(
            f"--count, --kind and --case go with mjhill bench and one of {listed}"
        )
    with progress_bar("measuring") as progress:
        if long:
            results = {long: benchmarks.run_long(long, kind, count, case, progress)}
        else:
            results = benchmarks.run(names, progress)
    if as_json:
        click.echo(json.dumps({name: result.rows for name, result in results.items()}))
        return
    click.echo(benchmarks.versions())
    for result in results.values():
        print_table(result.rows, False, title=result.title)
        for note in result.notes:
            click.echo(f"  {note}")


def _film(
    model: str,
    excitation: dict[str, Any],
    duration: float,
    files: dict[str, Path],
    torque: dict[str, Any] | None = None,
    **video: Any,
) -> Any:
    """Run a model from its home pose and write what ``files`` names."""
    from mjhill import scripted
    from mjhill.files import check_writable

    for kind, path in files.items():
        if path.suffix not in _SUFFIXES[kind]:
            wanted = " or ".join(_SUFFIXES[kind])
            raise ValueError(f"{kind} {str(path)!r} must end in {wanted}")
        check_writable(path)
    with progress_bar("running") as progress:
        loaded, recording = scripted.run(model, excitation, torque or {}, duration, progress)
    if "recording" in files:
        recording.save(files["recording"])
    if "plot" in files:
        from mjhill.plots import plot_recording

        plot_recording(recording, files["plot"], title=model)
    if "video" in files:
        from mjhill.rendering import View, render

        with progress_bar("filming") as progress:
            render(
                View(loaded, recording, Path(model).stem),
                files["video"],
                progress=lambda done, total: progress(done / total),
                **video,
            )
    return recording


def _make_default_folder(files: dict[str, Path]) -> None:
    if any(path.parent == _OUT for path in files.values()):
        _OUT.mkdir(exist_ok=True)


def _parse(items: tuple[str, ...]) -> dict[str, Any]:
    """Signals from ``NAME=LEVEL[@START[:END]]``."""
    from mjhill.signals import Signal, as_signal, pulse, step

    signals: dict[str, Signal] = {}
    for item in items:
        name, found, text = item.partition("=")
        level, at, span = text.partition("@")
        start, colon, end = span.partition(":")
        try:
            if not found:
                raise ValueError
            if colon:
                begin = float(start)
                signal = pulse(float(level), begin, float(end) - begin)
            else:
                signal = step(float(level), float(start)) if at else as_signal(float(level))
        except ValueError:
            raise ValueError(
                f"input {item!r} must read NAME=LEVEL, NAME=LEVEL@START or NAME=LEVEL@START:END, "
                "such as elbow_flexor=0.5@0.1:0.3 (times in s, END after START)"
            ) from None
        signals[name] = signals[name] + signal if name in signals else signal
    return signals


def _summary(recording: Any, files: dict[str, Path], as_json: bool) -> None:
    from mjhill.scripted import summary

    numbers = summary(recording)
    if as_json:
        paths = {name: str(path) for name, path in files.items()}
        click.echo(json.dumps({"files": paths, **numbers}, ensure_ascii=False))
        return
    for name, value in numbers.items():
        click.echo(f"{name}: {shown(value)}")
    print_paths(files)
