"""The command ``mjhill reproduce``."""

from __future__ import annotations

import sys
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

LENGTH = "all take 1 to 2 minutes on two cores; finished parts are not run again"


@click.command()
@click.option(
    "--only", multiple=True, metavar="ID", help="Run only this experiment; several are possible."
)
@click.option(
    "--joint", "joints", multiple=True, metavar="NAME",
    help="Run on this joint; by default each experiment runs on its own joints.",
)  # fmt: skip
@click.option("--video/--no-video", default=True, show_default=True)
@click.option("--fresh", is_flag=True, help="Run finished parts again.")
@click.option(
    "--jobs", "-j", type=click.IntRange(min=1),
    help="How many to run at once; by default one for each core, at most 4.",
)  # fmt: skip
@click.option(
    "--output", "-o", type=click.Path(path_type=Path), default=Path("out", "reproduce"),
    show_default=True, help="Folder.",
)  # fmt: skip
@json_option
def reproduce(
    only: tuple[str, ...],
    joints: tuple[str, ...],
    video: bool,
    fresh: bool,
    jobs: int | None,
    output: Path,
    as_json: bool,
) -> None:
    """Run the experiments of Winters & Stark (1987) and show which of the paper's claims hold.

    All of them take 1 to 2 minutes on two cores. The folder gets numbers, figures and videos, and
    a page, report.html, that shows them all. Finished parts are not run again, unless sources or
    parameters have changed. The exit code is 1 if something failed, and 130 after an interruption;
    finished parts are kept and reported.
    """
    from mjhill.report import CATALOGUE, report_of, select, write_report
    from mjhill.report import reproduce as run

    parts = len(select(CATALOGUE, only, joints))
    print_line(f"{parts} of {len(select(CATALOGUE))} parts; {LENGTH}", err=True)
    with progress_bar("reproducing") as progress:
        outcome = run(
            output, only=only, joints=joints, video=video, fresh=fresh, jobs=jobs,
            progress=progress,
        )  # fmt: skip
    report = report_of(outcome)
    paths = write_report(report, output)
    if as_json:
        print_json(report)
    else:
        _print(report)
        print_paths(paths)
    sys.exit(outcome.exit_code)


def _print(report: dict[str, Any]) -> None:
    rows = [
        {
            "experiment": part["id"],
            "joint": part["joint"],
            "claims": len(part["claims"]),
            "hold": [claim["holds"] for claim in part["claims"]].count(True),
            "time [s]": float(part["seconds"]),
        }
        for part in report["parts"]
    ]
    print_table(rows, False, title="Winters & Stark (1987)")
    count = report["claims"]
    print_line(f"claims: {', '.join(f'{number} {word}' for word, number in count.items())}")
    for part in report["missing"]:
        print_line(f"missing: {part['id']}, {part['joint']}: {part['reason']}", err=True)
    for part in report["problems"]:
        print_line(f"problem: {part['name']}: {part['problem']}", err=True)
