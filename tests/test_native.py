"""MuJoCo's muscle in the place of ours: its curves and times are where they were put."""

import math

import mujoco
import numpy as np
import pytest

import mjhill
from mjhill.comparison.match import matching, read_native
from mjhill.comparison.native import (
    muscle_delay,
    native_delay,
    native_model,
    native_muscle,
    native_spec,
)

SLOW = dict(excitation_tau=0.03, activation_tau=0.012, deactivation_tau=0.05)
MUSCLE = mjhill.Hill(
    max_isometric_force=40.0,
    optimal_length=0.03,
    width_short=0.05,
    width_long=0.08,
    max_velocity=0.6,
    hill_shape=0.3,
    series_stretch=0.01,
    eccentric_plateau=1.4,
    **SLOW,
)
HALF = math.sqrt(math.log(2))

PLANT = """
<mujoco>
  <option timestep="0.0002"/>
  <worldbody>
    <body>
      <joint name="slide" type="slide" axis="1 0 0" ref="0.2"/>
      <geom size="0.05"/>
      <site name="end"/>
    </body>
    <site name="start" pos="-0.5 0 0"/>
  </worldbody>
  <tendon>
    <spatial name="path"><site site="start"/><site site="end"/></spatial>
  </tendon>
</mujoco>
"""


def plant(muscle: mjhill.Hill = MUSCLE, **target: str) -> mujoco.MjSpec:
    spec = mujoco.MjSpec.from_string(PLANT)
    mjhill.add_muscle(spec, name="m", muscle=muscle, **(target or {"tendon": "path"}))
    return spec


def tension(
    model: mujoco.MjModel, length: float, velocity: float, activation: float = 1.0
) -> float:
    """Tension [N] of the native muscle at a length from qpos0 [m] and a lengthening velocity."""
    data = mujoco.MjData(model)
    data.qpos[0] += length
    data.qvel[0] = velocity
    data.act[0] = activation
    mujoco.mj_forward(model, data)
    return -float(data.actuator_force[0])


def activation_time(model: mujoco.MjModel, start: float, end: float) -> float:
    """Simulated time [s] for 1 - 1/e of the way from one activation to another."""
    data = mujoco.MjData(model)
    data.act[0], data.ctrl[0] = start, end
    while abs(data.act[0] - end) > math.exp(-1) * abs(start - end):
        mujoco.mj_step(model, data)
    return float(data.time)


@pytest.fixture(scope="module", params=[{"tendon": "path"}, {"joint": "slide"}])
def native(request: pytest.FixtureRequest) -> mujoco.MjModel:
    return native_spec(plant(**request.param)).compile()


def test_force_at_the_optimum_is_the_maximum_isometric_force(native: mujoco.MjModel) -> None:
    assert tension(native, MUSCLE.optimal_length, 0.0) == pytest.approx(40.0, rel=1e-9)
    assert tension(native, MUSCLE.optimal_length, 0.0, 0.25) == pytest.approx(10.0, rel=1e-9)


def test_force_is_half_where_the_gaussian_is(native: mujoco.MjModel) -> None:
    for deviation in (-HALF * MUSCLE.width_short, HALF * MUSCLE.width_long):
        length = MUSCLE.optimal_length + deviation
        assert tension(native, length, 0.0) == pytest.approx(20.0, rel=1e-9)


def test_force_vanishes_at_the_unloaded_velocity_and_not_before(native: mujoco.MjModel) -> None:
    optimum = MUSCLE.optimal_length
    assert tension(native, optimum, -MUSCLE.max_velocity) == pytest.approx(0.0, abs=1e-9)
    assert tension(native, optimum, -0.9 * MUSCLE.max_velocity) > 0.1


def test_fast_lengthening_reaches_the_eccentric_plateau(native: mujoco.MjModel) -> None:
    for velocity in (0.4 * MUSCLE.max_velocity, 5 * MUSCLE.max_velocity):
        assert tension(native, MUSCLE.optimal_length, velocity) == pytest.approx(56.0, rel=1e-9)


def test_there_is_no_passive_force(native: mujoco.MjModel) -> None:
    assert tension(native, MUSCLE.optimal_length + 0.1, 0.0, activation=0.0) == 0.0


def test_activation_goes_63_percent_of_a_full_step_in_the_same_time() -> None:
    native = native_spec(plant()).compile()
    ours = plant().compile()
    for start, end in ((0.0, 1.0), (1.0, 0.0)):
        data = mujoco.MjData(ours)
        data.act[:2], data.ctrl[0] = start, end
        with mjhill.installed():
            while abs(data.act[1] - end) > math.exp(-1):
                mujoco.mj_step(ours, data)
        # two steps: each simulation stops at the first past the mark, Euler lags by half of one
        assert activation_time(native, start, end) == pytest.approx(data.time, abs=4e-4)


@pytest.mark.parametrize("level", [0.3, 1.0])
def test_the_closed_form_of_the_native_delay_is_that_of_mujoco(level: float) -> None:
    native = native_spec(plant()).compile()
    rise, fall = native.actuator_dynprm[0, :2]
    expected = rise * native_delay(level, rising=True)
    assert activation_time(native, 0.0, level) == pytest.approx(expected, abs=4e-4)
    expected = fall * native_delay(level, rising=False)
    assert activation_time(native, level, 0.0) == pytest.approx(expected, abs=4e-4)


@pytest.mark.parametrize(("excitation", "activation"), [(0.03, 0.012), (0.02, 0.02), (1e-6, 0.05)])
def test_the_delay_of_two_lags_is_where_their_step_response_is(
    excitation: float, activation: float
) -> None:
    muscle = mjhill.Hill(
        max_isometric_force=1.0,
        optimal_length=0.0,
        width_short=1.0,
        width_long=1.0,
        max_velocity=1.0,
        hill_shape=0.3,
        series_stretch=0.1,
        excitation_tau=excitation,
        activation_tau=activation,
        deactivation_tau=activation,
    )
    time = np.linspace(0, 0.3, 300_001)
    # by superposition of many small delays, that is, convolution of the lags' impulse responses
    first = -np.expm1(-time / excitation)
    response = np.zeros_like(time)
    decay = math.exp(-time[1] / activation)
    for i in range(1, len(time)):
        response[i] = decay * response[i - 1] + (1 - decay) * 0.5 * (first[i] + first[i - 1])
    expected = float(np.interp(1 - math.exp(-1), response, time))
    assert muscle_delay(muscle, rising=True) == pytest.approx(expected, rel=1e-3)


def test_electrical_stimulation_has_one_lag() -> None:
    values = {name: getattr(MUSCLE, name) for name in MUSCLE.__dataclass_fields__}
    stimulated = mjhill.Hill(**{**values, "electrical_stimulation": True})
    assert muscle_delay(stimulated, rising=True) == pytest.approx(0.012)
    assert muscle_delay(stimulated, rising=False) == pytest.approx(0.05)


def test_everything_but_the_muscle_is_kept() -> None:
    ours, native = mjhill.load("elbow"), native_model("elbow")
    assert [native.actuator(i).name for i in range(2)] == ["elbow_flexor", "elbow_extensor"]
    np.testing.assert_array_equal(native.actuator_gear, ours.actuator_gear)
    np.testing.assert_array_equal(native.actuator_trnid, ours.actuator_trnid)
    np.testing.assert_array_equal(native.actuator_ctrlrange, ours.actuator_ctrlrange)
    np.testing.assert_array_equal(native.jnt_user, ours.jnt_user)
    np.testing.assert_array_equal(native.key_qpos, ours.key_qpos)
    assert (native.na, ours.na) == (2, 6)


def test_keyframes_keep_the_activation_of_ours_and_the_states_of_others() -> None:
    spec = mujoco.MjSpec.from_string(PLANT)
    other = dict(
        target="slide", trntype=mujoco.mjtTrn.mjTRN_JOINT, dyntype=mujoco.mjtDyn.mjDYN_FILTER
    )
    spec.add_actuator(name="first", **other)
    mjhill.add_muscle(spec, name="m", muscle=MUSCLE, tendon="path")
    spec.add_actuator(name="last", **other)
    spec.add_key(name="home", act=[7.0, 0.1, 0.2, 0.3, 8.0])
    native = native_spec(spec).compile()
    assert native.key_act[0].tolist() == [7.0, 0.2, 8.0]
    assert len(spec.keys[0].act) == 5, "the model given stays as it is"


def test_the_table_states_what_matches_and_what_cannot() -> None:
    rows = [row for row in matching("elbow") if row.muscle == "elbow_flexor"]
    matched = [row for row in rows if not row.how.startswith("not matched")]
    assert len(matched) >= 8
    for row in matched:
        assert (row.mjhill is None) == (row.native is None)
        if row.mjhill is not None:
            assert row.native == pytest.approx(row.mjhill, rel=1e-9), row.quantity
    missed = {row.quantity for row in rows} - {row.quantity for row in matched}
    assert any("series element" in quantity for quantity in missed)
    assert any("half of that velocity" in quantity for quantity in missed)
    assert any("states" in quantity for quantity in missed)


def test_native_parameters_read_back_as_they_were_chosen() -> None:
    chosen = native_muscle(MUSCLE)
    found = read_native(native_spec(plant()).compile(), "m")
    assert found.__dict__ == pytest.approx(chosen.__dict__, rel=1e-12)


def test_a_native_model_can_be_made_while_python_callbacks_are_installed() -> None:
    with mjhill.installed("python"):
        assert native_model("elbow").na == 2


def test_a_model_without_our_muscles_is_refused() -> None:
    with pytest.raises(ValueError, match="no mjhill muscle"):
        native_spec(mujoco.MjSpec.from_string(PLANT))


def test_an_unknown_model_and_a_binary_one_are_refused(tmp_path) -> None:
    with pytest.raises(ValueError, match="unknown model 'elbwo'"):
        native_model("elbwo")
    binary = tmp_path / "model.mjb"
    mujoco.mj_saveModel(mjhill.load("elbow"), str(binary), None)
    with pytest.raises(ValueError, match=r"binary model cannot be changed"):
        native_model(binary)
