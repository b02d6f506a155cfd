import dataclasses

import mujoco
import mujoco.batch
import mujoco.rollout
import numpy as np
import pytest
from conftest import PLAIN_XML, rest

import mjhill
from mjhill.engine.spec import joint_spec

INTEGRATORS = ["EULER", "RK4", "IMPLICIT", "IMPLICITFAST", "DISCRETE"]


def use(model, integrator):
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")


def tendon_spec(muscle):
    """A muscle on a spatial tendon that crosses a ball joint and wraps a sphere."""
    spec = mujoco.MjSpec.from_string("""
    <mujoco>
      <option gravity="0 0 -9.81" timestep="0.001"/>
      <worldbody>
        <site name="origin" pos="0.05 0.01 0.3"/>
        <body>
          <joint name="shoulder" type="ball" damping="0.05"/>
          <geom type="capsule" size="0.02" fromto="0 0 0 0.2 0 -0.2" mass="0.5"/>
          <geom name="wrap" type="sphere" size="0.03" mass="0"/>
          <site name="insertion" pos="0.1 0 -0.1"/>
          <site name="side" pos="0.06 0 0.06"/>
        </body>
      </worldbody>
      <tendon>
        <spatial name="path">
          <site site="origin"/><geom geom="wrap" sidesite="side"/><site site="insertion"/>
        </spatial>
      </tendon>
    </mujoco>""")
    linear = dataclasses.replace(
        muscle, max_isometric_force=150.0, optimal_length=-0.02, width_short=0.05,
        width_long=0.05, series_stretch=0.012, max_velocity=0.9,
    )  # fmt: skip
    mjhill.add_muscle(spec, name="deltoid", muscle=linear, tendon="path")
    return spec


def trajectory(model, backend, steps=400):
    data = mujoco.MjData(model)
    rows = []
    with mjhill.installed(backend):
        for k in range(steps):
            data.ctrl[:] = [0.6, 0.3][: model.nu] if k < steps // 2 else 0.1
            mujoco.mj_step(model, data)
            rows.append(np.concatenate([data.qpos, data.qvel, data.act, data.actuator_force]))
    return np.array(rows)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_python_and_compiled_callbacks_move_in_lockstep(pair, integrator):
    use(pair, integrator)
    python, compiled = (trajectory(pair, backend) for backend in ("python", "compiled"))
    assert np.abs(python[:, 0]).max() > 0.5
    # exp and fused operations may differ in the last bits; the motion does not amplify them
    np.testing.assert_allclose(compiled, python, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_back_ends_agree_for_a_tendon_across_a_ball_joint(muscle, integrator):
    model = tendon_spec(muscle).compile()
    use(model, integrator)
    python, compiled = (trajectory(model, backend) for backend in ("python", "compiled"))
    assert np.ptp(python[:, -1]) > 5.0
    np.testing.assert_allclose(compiled, python, rtol=1e-8, atol=1e-9)


def test_a_muscle_on_a_tendon_only_pulls(muscle):
    model = tendon_spec(muscle).compile()
    assert trajectory(model, "compiled")[:, -1].max() <= 0.0


def test_every_option_of_the_muscle_is_served_alike_by_both_back_ends(elbow, muscle):
    unusual = dataclasses.replace(
        muscle, electrical_stimulation=True, velocity_activation=0.6, eccentric_slope_ratio=5.0,
        width_short=0.8, series_limit=1.2, viscosity=0.02, activation_floor=0.01,
    )  # fmt: skip
    model = joint_spec(
        dataclasses.replace(elbow, muscles={**elbow.muscles, "elbow_flexor": unusual})
    )
    model = model.compile()
    python, compiled = (trajectory(model, backend) for backend in ("python", "compiled"))
    np.testing.assert_allclose(compiled, python, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("backend", ["python", "compiled"])
def test_forward_twice_gives_the_same_twice_and_changes_no_state(pair, backend):
    data = rest(pair)
    data.ctrl[:] = 0.7, 0.2
    data.qvel[:] = 2.0
    spec = mujoco.mjtState.mjSTATE_INTEGRATION
    before, after = np.empty((2, mujoco.mj_stateSize(pair, spec)))
    results = []
    mujoco.mj_getState(pair, data, before, spec)
    with mjhill.installed(backend):
        for _ in range(2):
            mujoco.mj_forward(pair, data)
            results.append(np.concatenate([data.act_dot, data.qacc, data.qfrc_passive]))
    mujoco.mj_getState(pair, data, after, spec)
    np.testing.assert_array_equal(results[0], results[1])
    np.testing.assert_array_equal(before, after)


def delayed_spec(elbow, **settings):
    spec = joint_spec(elbow)
    for actuator in spec.actuators:
        actuator.delay, actuator.nsample = 0.01, 20
        for name, value in settings.items():
            setattr(actuator, name, value)
    return spec


@pytest.mark.parametrize("interp", [0, 1])
def test_a_delayed_control_reaches_the_muscle_late_in_both_back_ends(elbow, interp):
    model = delayed_spec(elbow, interp=interp).compile()
    onset = {}
    for backend in ("python", "compiled"):
        data = rest(model)
        data.ctrl[:] = 1.0, 0.0
        with mjhill.installed(backend):
            excited = []
            for _ in range(30):
                mujoco.mj_step(model, data)
                excited.append(data.act[0])
        onset[backend] = excited
    first = int(np.argmax(np.array(onset["python"]) > 0))
    assert 8 <= first <= 11
    np.testing.assert_allclose(onset["compiled"], onset["python"], rtol=1e-12)


@pytest.mark.parametrize("backend", ["python", "compiled"])
def test_controls_are_clamped_as_the_engine_clamps_them(pair, backend):
    rates = []
    with mjhill.installed(backend):
        for value, disabled in ((1.0, 0), (7.0, 0), (7.0, 1)):
            pair.opt.disableflags = disabled * int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
            data = rest(pair)
            data.ctrl[0] = value
            mujoco.mj_forward(pair, data)
            rates.append(data.act_dot[0])
    assert rates[0] == rates[1] == rates[2] > 0


@pytest.mark.parametrize("backend", ["python", "compiled"])
def test_a_narrower_control_range_is_respected(pair, backend):
    pair.actuator_ctrlrange[0] = 0.0, 0.25
    data = rest(pair)
    data.ctrl[0] = 1.0
    with mjhill.installed(backend):
        mujoco.mj_step(pair, data, nstep=2000)
    assert data.act[0] == pytest.approx(0.25)


@pytest.mark.parametrize("backend", ["python", "compiled"])
def test_a_bad_control_excites_nothing_and_warns(pair, backend):
    data = rest(pair)
    data.ctrl[0] = np.nan
    with mjhill.installed(backend):
        mujoco.mj_forward(pair, data)
    assert data.act_dot[0] == 0.0
    assert data.warning[mujoco.mjtWarning.mjWARN_BADCTRL].number > 0


def test_disabled_actuation_leaves_the_muscle_as_it_is(pair):
    data = rest(pair)
    data.ctrl[:] = 1.0
    pair.opt.disableflags = int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    act = data.act.copy()
    with mjhill.installed():
        mujoco.mj_step(pair, data, nstep=10)
    np.testing.assert_array_equal(data.act, act)


def test_batch_gives_the_same_bits_on_any_number_of_threads(pair):
    final = []
    with mjhill.installed():
        for threads in (1, 2, 3):
            batch = mujoco.batch.Batch(pair, nsim=16, nthread=threads)
            batch.qpos = np.linspace(0.3, 2.2, 16)[:, None]
            batch.ctrl = np.linspace(0, 1, 32).reshape(16, 2)
            batch.step(nstep=300)
            final.append(batch.state.copy())
        data = mujoco.MjData(pair)
        data.qpos[0], data.ctrl[:] = 2.2, np.linspace(0, 1, 32).reshape(16, 2)[-1]
        mujoco.mj_step(pair, data, nstep=300)
    np.testing.assert_array_equal(final[0], final[1])
    np.testing.assert_array_equal(final[0], final[2])
    assert np.ptp(final[0], axis=0).max() > 0.5
    np.testing.assert_array_equal(batch.qpos[-1], data.qpos)
    np.testing.assert_array_equal(batch.act[-1], data.act)


def test_batch_sweeps_a_parameter_of_the_muscle(pair):
    with mjhill.installed():
        batch = mujoco.batch.Batch(pair, nsim=3, nthread=2)
        batch.expand("actuator_gainprm")[:, 0, 1] = [20.0, 40.0, 60.0]
        batch.ctrl = [0.5, 0.0]
        batch.step(nstep=1500)
    angles = batch.qpos[:, 0]
    assert angles[0] < angles[1] < angles[2]


def test_rollout_runs_several_models_in_one_process_on_all_threads(pair, elbow):
    weak = joint_spec(elbow).compile()
    weak.actuator_gainprm[:, 1] *= 0.5
    models = [pair, weak, pair, weak]
    initial = np.zeros((4, mujoco.mj_stateSize(pair, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    control = np.tile([0.5, 0.1], (4, 200, 1))
    with mjhill.installed():
        one, _ = mujoco.rollout.rollout(models, [mujoco.MjData(pair)], initial, control)
        two, _ = mujoco.rollout.rollout(
            models, [mujoco.MjData(pair), mujoco.MjData(pair)], initial, control
        )
    np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(one[0], one[2])
    assert np.abs(one[0] - one[1]).max() > 1e-2


def test_a_model_without_muscles_is_untouched():
    model = mujoco.MjModel.from_xml_string(PLAIN_XML)
    results = []
    for install in (False, True):
        data = mujoco.MjData(model)
        data.qvel[0] = 1.0
        if install:
            with mjhill.installed():
                mujoco.mj_step(model, data, nstep=100)
        else:
            mujoco.mj_step(model, data, nstep=100)
        results.append(data.qpos[0])
    assert results[0] == results[1]


def test_a_sleeping_tree_gathers_no_passive_torque(elbow):
    spec = joint_spec(elbow)
    spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    model = spec.compile()
    for backend in ("python", "compiled"):
        data = rest(model, angle=elbow.rest_angle + 0.5)
        with mjhill.installed(backend):
            mujoco.mj_forward(model, data)
            awake = data.qfrc_passive[0]
            mujoco.mj_step(model, data, nstep=5)
        assert abs(data.qfrc_passive[0]) <= 1.5 * abs(awake)
