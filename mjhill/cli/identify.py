"""The command ``mjhill identify``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from mjhill.cli.printing import (
    json_option,
    print_json,
    print_line,
    print_paths,
    print_table,
    progress_bar,
)
from mjhill.files import check_writable

_HIDDEN = ("note", "notes", "source", "muscle", "the bound is")  # from tables on the screen
_DETAIL = ("Table 2", "Passive torques and ranges of motion", "Facts")  # only in the files


@click.command()
@click.argument("joints", nargs=-1)
@click.option(
    "--data", "-d", multiple=True, type=click.Path(path_type=Path),
    help="A measurement of the one joint named, .csv; may be given several times.",
)  # fmt: skip
@click.option(
    "--predict", multiple=True, type=click.Choice(["angle", "torque"]),
    help="What to compare with the data, once for all or once for each; by default torque where "
    "the joint is held still, angle elsewhere.",
)  # fmt: skip
@click.option(
    "--fix", multiple=True, metavar="NAME=VALUE",
    help="Keep a parameter at a value in a fit to the literature; hill_shape is that of every "
    "muscle, elbow_flexor.hill_shape that of one.",
)  # fmt: skip
@click.option(
    "--start", type=click.Choice(["relaxed", "held"]), default="relaxed", show_default=True,
    help="How a joint starts a step of Table 2: both muscles relaxed, or held there by the "
    "antagonist, which is then switched off.",
)  # fmt: skip
@click.option("--fit", "only", multiple=True, metavar="NAME", help="Fit only this parameter.")
@click.option(
    "--torque", multiple=True, type=float, metavar="N·m",
    help="Constant external torque, for data without a column of it; once for all or once for "
    "each.",
)  # fmt: skip
@click.option(
    "--decimal", multiple=True, type=click.Choice([".", ","]),
    help="Sign between a number's digits in the data, once for all or once for each; by default "
    "what the cells say.",
)  # fmt: skip
@click.option(
    "--hold", "inputs", flag_value="hold", default=None,
    help="Inputs hold each value until the next sample, as digital stimulators do. By default "
    "each input is taken as it looks: held if it has plateaus and jumps.",
)  # fmt: skip
@click.option(
    "--join", "inputs", flag_value="join",
    help="Inputs go in straight lines from sample to sample, as EMG envelopes nearly do.",
)  # fmt: skip
@click.option(
    "--delay", is_flag=True,
    help="Fit a delay too, 0 to 100 ms, by which the excitations act later than measured.",
)  # fmt: skip
@click.option(
    "--parameters", type=click.Path(path_type=Path),
    help="Parameter file with bounds; by default the one that comes with mjhill.",
)  # fmt: skip
@click.option(
    "--output", "-o", type=click.Path(path_type=Path), default=Path("out", "identify"),
    show_default=True, help="Folder.",
)  # fmt: skip
@json_option
def identify(
    joints: tuple[str, ...],
    data: tuple[Path, ...],
    predict: tuple[str, ...],
    fix: tuple[str, ...],
    start: str,
    only: tuple[str, ...],
    torque: tuple[float, ...],
    decimal: tuple[str, ...],
    inputs: str | None,
    delay: bool,
    parameters: Path | None,
    output: Path,
    as_json: bool,
) -> None:
    """Fit the parameters of JOINTS within their bounds, and say how sure each is.

    Without --data: to Table 2 of Winters & Stark (1987), to published passive torques and ranges
    of motion and to published facts, save those held out to test the fit; for all joints if none
    is named. With --data: to measurements of one joint,
    CSV files with columns time [s], angle [deg], torque [N·m] and one of each muscle's name
    [0 to 1 or %]; units may be others, and without one they are s, rad, N·m and 0 to 1. Lines
    about the device may come first. The torque is all that acts on the joint from outside,
    gravity too, and is positive towards positive angles.

    A fit that explains less than half of the variance of a measurement has failed: the exit
    code is 1, and only the figure is written, of measured beside predicted.
    """
    from mjhill.identification import write

    if data and len(joints) != 1:
        raise ValueError(f"name the one joint that was measured, got {len(joints)}")
    if not data and (predict or only or torque or decimal or inputs or delay):
        raise ValueError(
            "--predict, --fit, --torque, --decimal, --hold, --join and --delay go with --data; the "
            "literature is fitted whole"
        )
    if data and (fix or start != "relaxed"):
        raise ValueError("--fix and --start are about the literature; leave them out with --data")
    fixed = _fixed(fix)
    names = _known(joints, parameters)
    files = _files(names, output, measured=bool(data))
    if data:
        options = {
            "predict": predict or None,
            "torque": torque or None,
            "decimal": decimal or None,
            "inputs": inputs,
            "delay": delay,
        }
        results = [_measured(names[0], data, files, only=only, parameters=parameters, **options)]
    else:
        results = _from_literature(names, parameters, fixed, start)
    what = "writing" if data else "measuring the facts"
    with progress_bar(what) as progress:
        report = write(results, output, parameters=parameters, progress=progress)
    if as_json:
        print_json(report)
        return
    _print(report)
    print_paths(files)


def _known(joints: tuple[str, ...], parameters: Path | None) -> list[str]:
    from mjhill.joints.reader import read_joints

    known = read_joints(parameters)
    for name in joints:
        if name not in known:
            raise ValueError(f"unknown joint {name!r}; there are: {', '.join(known)}")
    return list(dict.fromkeys(joints)) or list(known)


def _files(names: list[str], output: Path, *, measured: bool) -> dict[str, Path]:
    """The files to be written, checked before the long work."""
    from mjhill.identification.report import output_files

    output.mkdir(parents=True, exist_ok=True)
    files = output_files(names, output, measured=measured)
    for path in files.values():
        check_writable(path)
    return files


def _fixed(options: tuple[str, ...]) -> dict[str, float]:
    """Values by name, from options ``NAME=VALUE``."""
    fixed = {}
    for option in options:
        name, _, value = option.partition("=")
        try:
            fixed[name] = float(value)
        except ValueError:
            raise ValueError(
                f"--fix must be NAME=VALUE, such as velocity_activation=0, got {option!r}"
            ) from None
    return fixed


def _from_literature(
    names: list[str], parameters: Path | None, fixed: dict[str, float], start: str
) -> list[Any]:
    from mjhill import identification
    from mjhill.identification.literature_fit import check_evidence

    check_evidence(names, parameters, fixed)
    results = []
    for index, name in enumerate(names):
        with progress_bar(f"fitting {name}, {index + 1} of {len(names)}") as progress:
            results.append(
                identification.identify(
                    name, parameters=parameters, fixed=fixed, start=start, progress=progress
                )
            )
    return results


def _measured(name: str, data: tuple[Path, ...], files: dict[str, Path], **options: Any) -> Any:
    """A fit to measurements; the figure of one that failed is written."""
    from mjhill import identification
    from mjhill.identification.plots import plot_predictions

    try:
        with progress_bar(f"fitting {name}") as progress:
            return identification.identify(name, data, progress=progress, **options)
    except identification.FitError as failure:
        plot_predictions(name, failure.result.predictions, files[name])
        raise RuntimeError(
            f"{failure}; {files[name]} shows it, and no parameter file was written"
        ) from failure


def _print(report: dict[str, Any]) -> None:
    for title, rows in report.items():
        shown = [{k: v for k, v in row.items() if k not in _HIDDEN} for row in rows]
        if shown and title not in _DETAIL:
            print_table(shown, False, title=title)
    for row in report.get("Measurements", []):
        for note in row["notes"]:
            print_line(f"note: {row['measurement']}: {note}")
