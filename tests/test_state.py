import mujoco
import numpy as np
import pytest
from conftest import rest

import mjhill
from mjhill.elements import velocity_scale
from mjhill.engine.spec import joint_spec

STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


def test_a_saved_state_is_restored_and_continued_bit_for_bit(pair):
    data = rest(pair)
    data.ctrl[:] = 0.6, 0.1
    saved = np.empty(mujoco.mj_stateSize(pair, STATE))
    with mjhill.installed():
        mujoco.mj_step(pair, data, nstep=100)
        mujoco.mj_getState(pair, data, saved, STATE)
        mujoco.mj_step(pair, data, nstep=200)
        other = mujoco.MjData(pair)
        mujoco.mj_setState(pair, other, saved, STATE)
        other.ctrl[:] = data.ctrl
        mujoco.mj_step(pair, other, nstep=200)
    np.testing.assert_array_equal(other.act, data.act)
    np.testing.assert_array_equal(other.qpos, data.qpos)
    assert other.time == data.time


@pytest.mark.parametrize("timestep", [1e-4, 1e-3, 1e-2])
def test_a_reset_is_a_valid_state_that_settles_without_a_jerk(pair, timestep):
    pair.opt.timestep = timestep
    pair.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SPRING)
    data = mujoco.MjData(pair)
    # lengthened by the passive torque, at less than V_max: eccentric plateau and viscosity
    most = [
        (
            m.activation_floor * m.eccentric_plateau
            + m.viscosity / velocity_scale(m.activation_floor, m.velocity_activation)
        )
        * m.max_isometric_force
        for m in _muscles(pair)
    ]
    with mjhill.installed():
        for _ in range(20):
            mujoco.mj_forward(pair, data)
            assert np.all(-data.actuator_force <= most)
            mujoco.mj_step(pair, data)


def _muscles(model):
    return [mjhill.read_muscle(model, name) for name in mjhill.muscle_names(model)]


def test_a_keyframe_holds_the_muscle_states(elbow):
    spec = joint_spec(elbow)
    data = rest(spec.compile(), angle=1.0, elbow_flexor=0.3)
    spec.add_key(name="held", qpos=data.qpos, act=data.act, ctrl=data.ctrl)
    model = spec.compile()
    restored = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, restored, 0)
    np.testing.assert_array_equal(restored.act, data.act)
    with mjhill.installed():
        mujoco.mj_forward(model, restored)
    np.testing.assert_allclose(restored.act_dot, 0, atol=1e-9)


def test_equilibrated_muscles_stay_while_the_joint_is_held(pair):
    data = rest(pair, angle=1.3, elbow_flexor=0.5, elbow_extensor=0.2)
    with mjhill.installed():
        mujoco.mj_forward(pair, data)
    np.testing.assert_allclose(data.act_dot, 0, atol=1e-9)
    muscle = mjhill.read_muscle(pair, "elbow_flexor")
    beyond = -1.3 - muscle.optimal_length
    width = muscle.width_long if beyond > 0 else muscle.width_short
    share = np.exp(-((beyond / width) ** 2))
    assert -data.actuator_force[0] == pytest.approx(0.5 * share * muscle.max_isometric_force)


def test_equilibrate_refuses_a_control_that_is_not_finite(pair):
    data = mujoco.MjData(pair)
    data.ctrl[1] = np.inf
    with pytest.raises(ValueError, match=r"data.ctrl\[1\] must be finite, got inf"):
        mjhill.equilibrate(pair, data)


def test_lengths_are_measured_from_qpos0_whatever_the_reference_angle(elbow):
    spec = joint_spec(elbow)
    plain = spec.compile()
    shifted_spec = joint_spec(elbow)
    shifted_spec.joints[0].ref = 0.4
    shifted_spec.joints[0].springref = float(shifted_spec.joints[0].springref) + 0.4
    shifted = shifted_spec.compile()
    forces = []
    for model, offset in ((plain, 0.0), (shifted, 0.4)):
        data = rest(model, angle=1.0 + offset)
        data.ctrl[:] = 0.5, 0.1
        with mjhill.installed():
            mujoco.mj_step(model, data, nstep=50)
        forces.append([*data.actuator_force, data.qpos[0] - offset])
    np.testing.assert_allclose(forces[0], forces[1], rtol=1e-10)


@pytest.mark.parametrize("integrator", ["EULER", "IMPLICIT", "IMPLICITFAST", "DISCRETE"])
def test_transition_derivatives_are_those_of_the_whole_step(pair, integrator):
    pair.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    data = rest(pair, angle=1.0, elbow_flexor=0.4, elbow_extensor=0.2)
    data.ctrl[:] = 0.7, 0.1
    with mjhill.installed():
        mujoco.mj_step(pair, data, nstep=40)
        a = np.zeros((2 + pair.na, 2 + pair.na))
        b = np.zeros((2 + pair.na, pair.nu))
        mujoco.mjd_transitionFD(pair, data, 1e-6, True, a, b, None, None)
        state = np.concatenate([data.qpos, data.qvel, data.act])
        control = data.ctrl.copy()
        a_whole = np.array([_slope(pair, data, state, control, k, 0) for k in range(8)]).T
        b_whole = np.array([_slope(pair, data, state, control, k, 1) for k in range(2)]).T
    scale = np.abs(a_whole).max(axis=1, keepdims=True)
    np.testing.assert_allclose(a / scale, a_whole / scale, atol=1e-5)
    np.testing.assert_allclose(b, b_whole, rtol=1e-5, atol=1e-7)


def _slope(model, data, state, control, index, which):
    """Central difference of one whole step in one state or control."""
    ends = []
    for sign in (1, -1):
        other = mujoco.MjData(model)
        x, u = state.copy(), control.copy()
        (x, u)[which][index] += sign * 1e-6
        other.qpos[0], other.qvel[0], other.act[:], other.ctrl[:] = x[0], x[1], x[2:], u
        mujoco.mj_step(model, other)
        ends.append(np.concatenate([other.qpos, other.qvel, other.act]))
    return (ends[0] - ends[1]) / 2e-6
