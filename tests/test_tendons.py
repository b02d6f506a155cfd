import math

import mujoco
import pytest

import mjhill

SLIPPING = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.0005" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <site name="origin" pos="-0.3 0 0.01"/>
    <geom name="roll" type="cylinder" size="0.03 0.1" quat="1 1 0 0" contype="0" conaffinity="0"/>
    <site name="above" pos="0 0 0.05"/>
    <body>
      <joint name="elbow" axis="0 1 0" range="{range}" limited="true"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0" contype="0" conaffinity="0"/>
      <site name="insertion" pos="0.05 0 0.01"/>
    </body>
  </worldbody>
  <tendon><spatial name="path">
    <site site="origin"/><geom geom="roll" sidesite="above"/><site site="insertion"/>
  </spatial></tendon>
</mujoco>
"""


def arm(angles):
    """A muscle over a cylinder at a joint with a range [rad]; it slips off the cylinder at 101°."""
    spec = mujoco.MjSpec.from_string(SLIPPING.format(range=angles))
    muscle = mjhill.Hill(
        max_isometric_force=700, optimal_length=0.0, width_short=0.08, width_long=0.08,
        max_velocity=0.8, hill_shape=0.25, series_stretch=0.008, excitation_tau=0.035,
        activation_tau=0.01, deactivation_tau=0.04,
    )  # fmt: skip
    mjhill.add_muscle(spec, name="biceps", muscle=muscle, tendon="path")
    return spec.compile()


def test_a_path_that_slips_off_its_wrap_is_found_where_it_does():
    model = arm("-2 2")
    [finding] = mjhill.check_tendons(model)
    assert finding.severe
    assert finding.subject == "muscle 'biceps'"
    place = math.radians(float(finding.problem.split("passes ")[1].split("°")[0]))
    data = mujoco.MjData(model)
    lengths = []
    for angle in (place - 0.02, place + 0.02):
        data.qpos[0] = angle
        mujoco.mj_fwdPosition(model, data)
        lengths.append(data.actuator_length[0])
    jump = float(finding.problem.split("jumps by ")[1].split(" mm")[0])
    # to two digits as printed, and what the path grows by in 0.04 rad
    assert 1e3 * abs(lengths[1] - lengths[0]) == pytest.approx(jump, abs=5)
    assert jump > 50


def test_a_path_that_stays_on_its_wrap_is_not():
    assert mjhill.check_tendons(arm("-2 1.7")) == ()


def test_muscles_on_joints_have_no_path_to_slip(pair):
    assert mjhill.check_tendons(pair) == ()
