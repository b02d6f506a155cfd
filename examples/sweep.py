"""A thousand elbows on every core: how far a flexion goes, by strength and input.

Parameters are arrays of the model, so mujoco.batch varies them with no help from mjhill.
"""

import mujoco.batch
import numpy as np

import mjhill

STRENGTHS = np.linspace(20, 100, 32)  # [N·m]
INPUTS = np.linspace(0.05, 1.0, 32)  # [-]
STEPS = 800  # of 1 ms


def main() -> None:
    model = mjhill.load("elbow")
    strength, level = (grid.ravel() for grid in np.meshgrid(STRENGTHS, INPUTS))
    array, slot = mjhill.muscle_model("hill").slots["max_isometric_force"]
    flexor = model.actuator("elbow_flexor").id
    with mjhill.installed():
        batch = mujoco.batch.Batch(model, nsim=len(level))
        batch.reset(keyframe=model.key("home").id)
        batch.expand(f"actuator_{array}")[:, flexor, slot] = strength
        batch.ctrl[:, 0] = level
        batch.step(nstep=STEPS)
    angles = np.degrees(batch.qpos[:, 0])
    print(f"{len(angles)} elbows flexed to between {angles.min():.0f}° and {angles.max():.0f}°")


if __name__ == "__main__":
    main()
