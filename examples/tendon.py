"""A muscle on a spatial tendon: it wraps a pulley and lifts a weight across two joints.

Nothing in the muscle assumes a hinge. On a tendon its force is in newtons and its lengths in
metres, measured from the pose qpos0.
"""

import mujoco

import mjhill

DURATION = 2.0  # [s]
EXCITATION = 0.4  # [-]

ARM = """
<mujoco model="two-joint arm">
  <option timestep="0.001" integrator="implicitfast"/>
  <worldbody>
    <site name="origin" pos="0.03 0 -0.02"/>
    <body>
      <joint name="shoulder" axis="0 -1 0" damping="1" range="-60 120"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3" mass="1.5"/>
      <body pos="0 0 -0.3">
        <joint name="elbow" axis="0 -1 0" damping="0.5" range="0 140"/>
        <geom name="pulley" type="cylinder" size="0.02 0.02" zaxis="0 1 0" mass="0.01"/>
        <geom type="capsule" size="0.015" fromto="0 0 0 0 0 -0.25" mass="1"/>
        <site name="insertion" pos="0.015 0 -0.05"/>
        <site name="front" pos="0.05 0 0"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="biceps">
      <site site="origin"/><geom geom="pulley" sidesite="front"/><site site="insertion"/>
    </spatial>
  </tendon>
</mujoco>
"""

# estimates of the size of a biceps brachii, to show the units
BICEPS = mjhill.Hill(
    max_isometric_force=600.0,  # [N]
    optimal_length=-0.03,  # [m] shorter than in the straight arm
    width_short=0.07,  # [m]
    width_long=0.07,  # [m]
    max_velocity=1.0,  # [m/s]
    hill_shape=0.3,
    series_stretch=0.01,  # [m]
    excitation_tau=0.038,  # [s]
    activation_tau=0.011,  # [s]
    deactivation_tau=0.044,  # [s]
)


def main() -> None:
    spec = mujoco.MjSpec.from_string(ARM)
    mjhill.add_muscle(spec, name="biceps", muscle=BICEPS, tendon="biceps")
    model = spec.compile()
    data = mujoco.MjData(model)
    mjhill.equilibrate(model, data)
    with mjhill.installed():
        run = mjhill.record(model, data, duration=DURATION, excitation={"biceps": EXCITATION})
    print(f"peak tendon force {run['biceps.force'].max():.0f} N")
    print(f"largest series stretch {1e3 * run['biceps.stretch'].max():.1f} mm")


if __name__ == "__main__":
    main()
