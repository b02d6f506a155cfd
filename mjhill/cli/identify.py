"""The command ``mjhill identify``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from mjhill.cli.printing import json_option, print_json, print_paths, print_table, progress_bar
from mjhill.files import check_writable, replacing

_HIDDEN = ("note", "source", "muscle")  # from tables on the screen; the JSON file has them


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
@click.option("--fit", "only", multiple=True, metavar="NAME", help="Fit only this parameter.")
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
    only: tuple[str, ...],
    parameters: Path | None,
    output: Path,
    as_json: bool,
) -> None:
    """Fit the parameters of JOINTS within their bounds, and say how sure each is.

    Without --data: to Table 2 of Winters & Stark (1987) and published passive torques and
    ranges of motion, for all joints if none is named. With --data: to measurements of one joint,
    CSV files with columns time [s], angle [rad or deg], torque [N·m] and one of each muscle's
    name [0 to 1]. The torque is all that acts on the joint from outside, gravity too, and is
    positive towards positive angles.
    """
    if data and len(joints) != 1:
        raise ValueError(f"name the one joint that was measured, got {len(joints)}")
    if not data and (predict or only):
        raise ValueError("--predict and --fit go with --data; the literature is fitted whole")
    names = _known(joints, parameters)
    output.mkdir(parents=True, exist_ok=True)
    files = {
        "parameters": output / "joints.toml",
        "numbers": output / "identify.json",
        "page": output / "report.md",
        **{name: output / f"{name}.png" for name in names},
    }
    for path in files.values():
        check_writable(path)
    if data:
        report = _measured(names[0], data, predict, only, parameters, files)
    else:
        report = _published(names, parameters, files)
    _write(files["numbers"], json.dumps(report, ensure_ascii=False, indent=1))
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


def _published(names: list[str], parameters: Path | None, files: dict[str, Path]) -> dict[str, Any]:
    from mjhill.identification.facts import facts
    from mjhill.identification.literature_fit import (
        check_evidence,
        from_literature,
        published_rows,
        step_rows,
    )
    from mjhill.identification.report import (
        estimate_rows,
        fact_rows,
        markdown,
        plot_literature,
        write_parameters,
    )
    from mjhill.joints.reader import read_joints

    check_evidence(names, parameters)
    results = []
    for index, name in enumerate(names):
        with progress_bar(f"fitting {name}, {index + 1} of {len(names)}") as progress:
            results.append(from_literature(name, parameters, progress))
    write_parameters(files["parameters"], results, parameters)
    # what is reported is what the file holds, to its digits
    written = read_joints(files["parameters"])
    joints = {name: written[name] for name in names}
    with progress_bar("measuring what the fit did not use") as progress:
        held_out = facts(joints, progress)
    for name, joint in joints.items():
        plot_literature(joint, files[name])
    report = {
        "Table 2": [row for joint in joints.values() for row in step_rows(joint)],
        "Passive torques and ranges of motion": [
            row for joint in joints.values() for row in published_rows(joint)
        ],
        "Not used by the fit": fact_rows(held_out),
        "Parameters": [row for result in results for row in estimate_rows(result)],
    }
    _write(files["page"], markdown(report))
    return report


def _measured(
    name: str,
    data: tuple[Path, ...],
    predict: tuple[str, ...],
    only: tuple[str, ...],
    parameters: Path | None,
    files: dict[str, Path],
) -> dict[str, Any]:
    from mjhill.identification.measurement import read_measurement
    from mjhill.identification.movement import from_measurements
    from mjhill.identification.report import (
        estimate_rows,
        plot_predictions,
        prediction_rows,
        write_parameters,
    )
    from mjhill.joints.reader import read_joints

    del files["page"]
    joint = read_joints(parameters)[name]
    measurements = [read_measurement(path, joint) for path in data]
    with progress_bar(f"fitting {name}") as progress:
        result, predictions = from_measurements(
            name, measurements, predict=predict or None, only=only, parameters=parameters,
            progress=progress,
        )  # fmt: skip
    write_parameters(files["parameters"], [result], parameters)
    plot_predictions(name, predictions, files[name])
    return {
        "Measurements": prediction_rows(predictions),
        "Parameters": estimate_rows(result),
    }


def _write(path: Path, text: str) -> None:
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")


def _print(report: dict[str, Any]) -> None:
    for title, rows in report.items():
        shown = [{k: v for k, v in row.items() if k not in _HIDDEN} for row in rows]
        if shown:
            print_table(shown, False, title=title)
