"""Half a second of flexion: the smallest program with a physiological muscle."""

import math

import mujoco

import mjhill


def main() -> None:
    model = mjhill.load("elbow")
    data = mjhill.at_home(model)
    with mjhill.installed():
        data.ctrl[:] = [0.5, 0.0]  # flexor, extensor
        mujoco.mj_step(model, data, nstep=500)
    angle = math.degrees(data.joint("elbow").qpos[0])
    print(f"after 0.5 s the elbow is flexed to {angle:.1f}°")


if __name__ == "__main__":
    main()
