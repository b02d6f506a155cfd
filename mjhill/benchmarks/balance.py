"""How far the energy balance of each joint closes in the movement of ``mjhill demo``.

``python -m mjhill.benchmarks.balance`` prints the table of docs/energy.md.
"""

from __future__ import annotations

from functools import cache

import mujoco

from mjhill.engine.equilibrium import at_home
from mjhill.engine.install import installed
from mjhill.engine.layout import muscle_names
from mjhill.joints.reader import JOINTS
from mjhill.simulate.energy import energy
from mjhill.simulate.load import load
from mjhill.simulate.run import record
from mjhill.simulate.scripted import movement

DURATION = 2.4  # [s], step and pulse pair
CASES = (  # integrator and timestep [s]
    ("implicitfast", 1e-3),
    ("implicitfast", 0.5e-3),
    ("rk4", 1e-3),
)


@cache
def gaps(joint: str, integrator: str, timestep: float) -> tuple[float, float]:
    """Largest residual of the whole and of the muscles alone, in units of the largest term [-]."""
    model = load(joint)
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model.opt.timestep = timestep
    with installed():
        run = record(
            model,
            at_home(model),
            duration=DURATION,
            excitation=movement(muscle_names(model)),
        )
    balance = energy(run)
    return balance.gap, balance.muscle_gap


def rows() -> list[tuple[str, list[tuple[float, float]]]]:
    """Both gaps of every joint in every case, in percent."""
    found = []
    for joint in JOINTS:
        pairs = [gaps(joint, *case) for case in CASES]
        found.append((joint, [(100 * whole, 100 * muscles) for whole, muscles in pairs]))
    return found


def main() -> None:
    """Print the table as Markdown."""
    print("| residual [%] |" + "".join(f" {name}, {1e3 * h:g} ms |" for name, h in CASES))
    print("|" + "---|" * (len(CASES) + 1))
    for joint, cells in rows():
        shown = (f" {whole:.2g} / {muscles:.2g} |" for whole, muscles in cells)
        print(f"| {joint} |" + "".join(shown))


if __name__ == "__main__":
    main()
