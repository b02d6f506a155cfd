"""The command ``mjhill ladder``."""

from __future__ import annotations

import click

from mjhill.cli.printing import json_option, print_json, print_line, print_table


@click.command()
@click.option("--joint", "joints", multiple=True, default=("elbow", "ankle", "eye"))
@click.option("--model", "models", multiple=True, help="Only this rung; several are possible.")
@json_option
def ladder(joints: tuple[str, ...], models: tuple[str, ...], as_json: bool) -> None:
    """Compare models of muscle with ``hill``, each on the same joint in the same tasks."""
    from mjhill.ladder import RUNGS, TASKS
    from mjhill.ladder import ladder as run

    cells = [cell for joint in joints for cell in run(joint, models=models or RUNGS)]
    if as_json:
        print_json([cell.as_dict() for cell in cells])
        return
    for joint in joints:
        rows = []
        for model in models or RUNGS:
            own = {cell.task: cell for cell in cells if (cell.joint, cell.model) == (joint, model)}
            errors = {task: own[task].error for task in TASKS}
            values = {t: "cannot" if e is None else f"{e:.2f}" for t, e in errors.items()}
            rows.append({"model": model, **values})
        print_table(rows, False, title=f"{joint}: r.m.s. difference to hill [% of range]")
    for line in dict.fromkeys(f"{c.model} cannot: {c.cannot}" for c in cells if c.cannot):
        print_line(line, err=True)
