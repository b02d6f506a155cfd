"""Both kinds of muscle on the same tasks: measures, table, cost, files."""

import dataclasses
import json
import math

import mujoco
import numpy as np
import pytest
from test_render import frames_of

import mjhill
from mjhill.analysis import responses
from mjhill.comparison import Comparison, compare, step_cost, write
from mjhill.comparison import table as trials
from mjhill.comparison.cost import bare_spec
from mjhill.comparison.native import read_spec
from mjhill.comparison.report import views_of

TIME = np.linspace(0.0, 2.0, 2001)


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return compare("elbow")


def test_rise_and_overshoot_of_a_second_order_step_are_those_of_the_textbook() -> None:
    ratio, natural = 0.5, 20.0
    damped = natural * math.sqrt(1 - ratio**2)
    phase = damped * TIME
    decay = np.exp(-ratio * natural * TIME)
    values = 3 + 2 * (1 - decay * (np.cos(phase) + ratio * natural / damped * np.sin(phase)))
    expected = math.exp(-math.pi * ratio / math.sqrt(1 - ratio**2))
    assert responses.overshoot(values) == pytest.approx(expected, rel=1e-3)
    first_order = 1 - np.exp(-TIME / 0.1)
    assert responses.rise_time(TIME, first_order) == pytest.approx(0.1 * math.log(9), rel=1e-4)
    assert responses.settling_time(TIME, first_order) == pytest.approx(0.1 * math.log(20), abs=2e-3)


def test_a_step_that_goes_down_is_measured_like_one_that_goes_up() -> None:
    up = 1 - np.exp(-TIME / 0.1)
    assert responses.rise_time(TIME, -5 * up) == pytest.approx(responses.rise_time(TIME, up))


def test_a_response_that_goes_nowhere_has_no_rise_time() -> None:
    with pytest.raises(ValueError, match="ends where it starts"):
        responses.rise_time(TIME, np.ones_like(TIME))


def test_half_life_counts_from_the_peak_and_is_none_where_it_was_not_seen() -> None:
    decay = np.where(TIME < 0.5, TIME / 0.5, np.exp(-(TIME - 0.5) / 0.3))
    assert responses.half_life(TIME, decay) == pytest.approx(0.3 * math.log(2), rel=1e-3)
    assert responses.half_life(TIME[:600], decay[:600]) is None


def test_the_second_order_fit_finds_the_spring_and_damper_of_a_simulated_joint() -> None:
    model = mujoco.MjModel.from_xml_string(
        """
        <mujoco>
          <option timestep="0.0005" integrator="implicitfast" gravity="0 0 0"/>
          <worldbody>
            <body>
              <inertial pos="0 0 0" mass="1" diaginertia="0.06 0.06 0.06"/>
              <joint name="hinge" axis="0 1 0" stiffness="30" damping="1.5"/>
            </body>
          </worldbody>
        </mujoco>
        """
    )
    hit = mjhill.pulse(5.0, 0.0, 0.02)
    run = mjhill.record(model, mujoco.MjData(model), duration=0.3, torque={"hinge": hit})
    angle, velocity, load = (run[f"hinge.{name}"] for name in ("angle", "velocity", "applied"))
    fit = responses.second_order_fit(run.time, angle, velocity, load, inertia=0.06)
    # MuJoCo's half step is what is left
    assert fit.stiffness == pytest.approx(30.0, rel=0.01)
    assert fit.damping == pytest.approx(1.5, rel=0.01)
    free = responses.second_order_fit(run.time, angle, velocity, load, inertia=None)
    assert free == pytest.approx((30.0, 1.5, 0.06), rel=0.02)
    assert trials.inertia(model, 0.3) == pytest.approx(0.06)


def test_the_pair_is_found_by_what_it_does_to_the_joint() -> None:
    pair = trials.find_pair(mjhill.load("elbow"))
    assert (pair.joint, pair.coordinate) == ("elbow", "angle")
    assert (pair.agonist, pair.antagonist) == ("elbow_flexor", "elbow_extensor")
    strength = mjhill.JOINTS["elbow"].muscles["elbow_flexor"].max_isometric_force
    assert (pair.max_force, pair.max_load) == pytest.approx((strength, strength))


def test_models_without_an_antagonistic_pair_are_refused() -> None:
    spec = read_spec("elbow")
    spec.delete(spec.actuators[1])
    for key in spec.keys:
        spec.delete(key)
    with pytest.raises(ValueError, match="a muscle for each direction"):
        trials.find_pair(spec.compile())
    with pytest.raises(ValueError, match="has 0 joints"):
        trials.find_pair(mujoco.MjModel.from_xml_string("<mujoco/>"))


def test_the_table_is_complete_and_finite(comparison: Comparison) -> None:
    assert {row.task for row in comparison.rows} == set(comparison.recordings)
    assert set(comparison.recordings) == {"step", "pulses", "impulse 0.1", "impulse 0.5"}
    for row in comparison.rows:
        for value in (row.mjhill, row.native):
            assert value is not None, row
            assert math.isfinite(value), row


def test_both_models_start_alike_and_the_joint_is_at_rest_until_the_impulse(
    comparison: Comparison,
) -> None:
    for sides in comparison.recordings.values():
        ours, native = sides["mjhill"], sides["native"]
        assert ours["elbow.angle"][0] == native["elbow.angle"][0]
        np.testing.assert_array_equal(ours["elbow_flexor.u"], native["elbow_flexor.u"])
    for task in ("impulse 0.1", "impulse 0.5"):
        for run in comparison.recordings[task].values():
            # the constant load balances to the last bits, which an unstable posture would show
            before = run["elbow.angle"][run.time < trials.QUIET]
            assert np.ptp(before) < 1e-6


def test_ours_holds_its_own_posture_at_the_first_level_without_help(comparison: Comparison) -> None:
    ours = comparison.recordings["impulse 0.1"]["mjhill"]
    assert abs(ours["elbow.applied"][0]) < 1e-3 * comparison.pair.max_load


def test_cocontraction_stiffens_the_joint_through_the_series_element(
    comparison: Comparison,
) -> None:
    found = {(row.task, row.quantity): row for row in comparison.rows}
    low, high = (found[f"impulse {each}", "stiffness, first 50 ms"] for each in (0.1, 0.5))
    assert high.mjhill > 2 * low.mjhill
    # a rigid tendon has no short-range stiffness
    assert high.mjhill > 5 * high.native


def test_excitation_delays_the_force_that_a_single_lag_does_not(comparison: Comparison) -> None:
    row = next(row for row in comparison.rows if "10 % of F_max" in row.quantity)
    assert row.ratio > 2


def test_a_table_holds_in_json(comparison: Comparison) -> None:
    cost = step_cost("elbow", rounds=1, steps=2)
    whole = dataclasses.replace(comparison, cost=cost)
    table = json.loads(json.dumps(whole.as_dict(), allow_nan=False))
    assert len(table["rows"]) == len(comparison.rows)
    assert table["cost"]["ratio"] == pytest.approx(cost.ratio)
    assert comparison.as_dict()["cost"] is None


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"excitation": 0.0}, r"excitation must be in \(0, 1\], got 0.0"),
        ({"cocontraction": (0.1, 1.5)}, r"cocontraction must be in \(0, 1\], got 1.5"),
        ({"cocontraction": (0.1, 0.1)}, "two different"),
        ({"impulse": math.nan}, "impulse must be positive and finite"),
    ],
)
def test_arguments_out_of_range_are_refused(wrong: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        compare("elbow", **wrong)


def test_progress_goes_to_the_end() -> None:
    shares: list[float] = []
    step_cost("elbow", rounds=2, steps=1, progress=shares.append)
    assert shares == [0.5, 1.0]


@pytest.mark.parametrize("backend", ["compiled", "python"])
def test_cost_is_positive_for_each_kind_and_leaves_nothing_installed(backend: str) -> None:
    cost = step_cost("elbow", rounds=3, steps=5, backend=backend)
    assert min(cost.bare, cost.native, cost.mjhill) > 0
    assert cost.muscles == 2
    assert mjhill.installed_backend() is None


def test_the_integrator_can_be_chosen_by_name() -> None:
    assert step_cost("elbow", rounds=1, steps=2, integrator="RK4").integrator == "rk4"
    assert step_cost("elbow", rounds=1, steps=2).integrator == "implicitfast"
    with pytest.raises(ValueError, match="unknown integrator 'rk5'; there are: euler, rk4"):
        step_cost("elbow", rounds=1, steps=2, integrator="rk5")


@pytest.mark.parametrize("name", ["rounds", "steps"])
def test_a_cost_of_nothing_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must be at least 1, got 0"):
        step_cost("elbow", **{name: 0})


def test_the_bare_plant_has_motors_as_strong_as_the_muscles_and_no_states() -> None:
    model = bare_spec(read_spec("elbow")).compile()
    assert (model.nu, model.na) == (2, 0)
    data = mujoco.MjData(model)
    for index, (name, sign) in enumerate((("elbow_flexor", 1), ("elbow_extensor", -1))):
        data.ctrl[:] = 0.0
        data.ctrl[index] = 1.0
        mujoco.mj_forward(model, data)
        strength = mjhill.JOINTS["elbow"].muscles[name].max_isometric_force
        assert data.qfrc_actuator[0] == pytest.approx(sign * strength)


def test_all_files_are_written_whole(comparison: Comparison, tmp_path) -> None:
    folder = tmp_path / "new" / "folder"
    paths = write(comparison, folder, video=False)
    assert sorted(paths) == sorted(folder.iterdir())
    assert {path.suffix for path in paths} == {".json", ".csv", ".png"}
    again = mjhill.Recording.load(folder / "impulse_0.5_native.csv")
    kept = comparison.recordings["impulse 0.5"]["native"]
    np.testing.assert_array_equal(again["elbow.angle"], kept["elbow.angle"])
    assert json.loads((folder / "comparison.json").read_text())["model"] == "elbow"


def test_a_folder_that_cannot_be_written_is_an_error_and_stays_as_it_is(
    comparison: Comparison, tmp_path
) -> None:
    taken = tmp_path / "taken"
    taken.write_text("mine")
    for folder in (taken, taken / "deeper"):
        with pytest.raises(OSError, match="taken"):
            write(comparison, folder)
    assert taken.read_text() == "mine"
    film = tmp_path / "film"
    (film / "comparison.mp4").mkdir(parents=True)
    with pytest.raises(OSError, match=r"comparison\.mp4"):
        write(comparison, film)
    assert (film / "comparison.mp4").is_dir()


def test_the_video_shows_both_models_side_by_side(comparison: Comparison, tmp_path) -> None:
    views = views_of(comparison)
    assert [(view.model.na, view.title) for view in views] == [
        (6, "mjhill"),
        (2, "MuJoCo <muscle>"),
    ]
    for view, recording in zip(views, comparison.recordings["pulses"].values(), strict=True):
        assert view.recording is recording


def test_the_video_is_rendered_at_a_quarter_of_the_speed(comparison: Comparison, tmp_path) -> None:
    def cut(run: mjhill.Recording) -> mjhill.Recording:
        first = slice(0, 101)
        series = {name: values[first] for name, values in run.series.items()}
        return dataclasses.replace(run, time=run.time[first], series=series)

    short = {
        task: {side: cut(run) for side, run in sides.items()}
        for task, sides in comparison.recordings.items()
    }
    shares: list[float] = []
    paths = write(
        dataclasses.replace(comparison, recordings=short), tmp_path, progress=shares.append
    )
    assert paths[-1] == tmp_path / "comparison.mp4"
    duration = short["pulses"]["mjhill"].time[-1]
    frames = frames_of(paths[-1])
    assert len(frames) == pytest.approx(30 * duration / 0.25, abs=1)
    left, right = np.split(frames[-1].astype(float), 2, axis=1)
    assert left.std() > 1
    assert right.std() > 1
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
