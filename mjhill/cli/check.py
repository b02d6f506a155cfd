"""The command ``mjhill check``."""

from __future__ import annotations

import sys
import warnings
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from mjhill.cli.printing import json_option, print_json, print_line, print_table

if TYPE_CHECKING:
    import mujoco

SEVERE = 3  # exit code after a severe finding


@click.command()
@click.argument("model")
@json_option
def check(model: str, as_json: bool) -> None:
    """Check MODEL, a joint's name or a path, for problems that make results wrong.

    Exit code 0: no findings, or only notes; 3: a severe finding, results are meaningless; 2: the
    model is not accepted.
    """
    from mjhill.engine.checks import check_model
    from mjhill.engine.tendons import check_tendons
    from mjhill.simulate.load import load

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the table shows severe findings
        loaded = load(model)
        findings = (*check_model(loaded), *check_tendons(loaded))
    looked_at = _looked_at(loaded)
    if as_json:
        shown = [asdict(finding) for finding in findings]
        print_json({"looked_at": looked_at, "findings": shown})
    else:
        for what, value in looked_at.items():
            print_line(f"{what}: {value}")
        if findings:
            rows = [
                {
                    "about": finding.subject,
                    "": "severe" if finding.severe else "note",
                    "finding": finding.problem,
                    "remedy": finding.remedy,
                }
                for finding in findings
            ]
            print_table(rows, False, title=f"Findings on {model}")
        else:
            print_line("no findings")
    if any(finding.severe for finding in findings):
        sys.exit(SEVERE)


def _looked_at(model: mujoco.MjModel) -> dict[str, str | int]:
    """What was checked, for people to read."""
    import mujoco

    from mjhill.engine.layout import elastic_joints, muscle_ids, muscle_names

    muscles = muscle_ids(model)
    on_tendons = int((model.actuator_trntype[muscles] == int(mujoco.mjtTrn.mjTRN_TENDON)).sum())
    gravity = " ".join(f"{value:g}" for value in model.opt.gravity)
    integrator = mujoco.mjtIntegrator(int(model.opt.integrator)).name.removeprefix("mjINT_")
    return {
        "muscles": len(muscle_names(model)),
        "of these on tendons, paths swept": on_tendons,
        "joints with passive elasticity": len(list(elastic_joints(model))),
        "equality constraints": int(model.neq),
        "timestep [s]": f"{model.opt.timestep:g}",
        "integrator": integrator,
        "gravity [m/s²]": gravity,
    }
