"""Moments in which a muscle does what no muscle can: found where there are any, and only there."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from conftest import rest

import mjhill
from mjhill.benchmarks.sweep import cases, solutions
from mjhill.engine.layout import muscle_names
from mjhill.engine.spec import joint_spec
from mjhill.simulate import scripted

# the tendon leaves the wrapping geom at 1.06 rad and is 2 cm longer from one step to the next
SLIPS = """
<mujoco>
  <option timestep="0.001" integrator="implicitfast"><flag gravity="disable"/></option>
  <worldbody>
    <site name="origin" pos="-0.011 -0.059 0.079"/>
    <geom name="wrap" type="{shape}" euler="90 0 0" contype="0" conaffinity="0"/>
    <body><joint name="joint" axis="1 0 0" damping="0.5"/>
      <geom type="capsule" size="0.01" fromto="0 0 0 0.3 0 0" mass="1" contype="0"/>
      <site name="insertion" pos="0.008 -0.064 0.056"/></body>
  </worldbody>
  <tendon><spatial name="tendon"><site site="origin"/><geom geom="wrap"/>
    <site site="insertion"/></spatial></tendon>
</mujoco>"""
PULLER = mjhill.Hill(
    max_isometric_force=781.0,
    optimal_length=0.07,
    width_short=0.05,
    width_long=0.05,
    max_velocity=0.6,
    hill_shape=0.3,
    series_stretch=0.01,
    excitation_tau=0.03,
    activation_tau=0.01,
    deactivation_tau=0.04,
)


def slipping(shape='cylinder" size="0.03 0.1'):
    spec = mujoco.MjSpec.from_string(SLIPS.format(shape=shape))
    mjhill.add_muscle(spec, name="puller", muscle=PULLER, tendon="tendon")
    model = spec.compile()
    return model, rest(model, 0.9)


def test_a_tendon_that_slips_off_its_wrap_is_named_with_muscle_time_and_remedy():
    model, data = slipping()
    inputs = {"excitation": {"puller": 0.1}, "torque": {"joint": 30.0}}
    with mjhill.installed(), pytest.warns(RuntimeWarning) as warned:
        run = mjhill.record(model, data, duration=0.02, **inputs)
    (velocity,) = mjhill.transients(run)
    assert [str(each.message) for each in warned] == [str(velocity)]
    jump = np.argmax(np.diff(run["puller.length"])) + 1
    assert np.diff(run["puller.length"]).max() > 0.01
    # it is pulled out by the jump within a step, and its force is that of the plateau again
    assert run["puller.force"].max() < 0.05 * PULLER.max_isometric_force
    assert (velocity.kind, velocity.muscle, velocity.unit) == ("velocity", "puller", "m/s")
    assert velocity.time == run.time[jump]
    assert velocity.value < -10 * PULLER.max_velocity
    assert velocity.limit == -1.5 * PULLER.max_velocity
    assert "muscle 'puller' did what no muscle can at 0.00" in str(velocity)
    assert "slips off the geom that it wraps" in velocity.cause
    assert "sidesite" in velocity.remedy
    assert "\n" not in str(velocity)


def test_the_same_tendon_that_stays_on_its_wrap_is_no_finding():
    model, data = slipping()
    with mjhill.installed():
        run = mjhill.record(model, data, duration=0.1, excitation={"puller": 0.5})
    assert run["puller.force"].max() > 25
    assert np.ptp(run["puller.length"]) > 0.01
    assert mjhill.transients(run) == ()


def test_findings_survive_saving(tmp_path):
    model, data = slipping()
    with mjhill.installed(), pytest.warns(RuntimeWarning, match="did what no muscle can"):
        run = mjhill.record(model, data, duration=0.02, torque={"joint": 30.0})
    loaded = mjhill.Recording.load(run.save(tmp_path / "run.csv"))
    assert mjhill.transients(loaded) == mjhill.transients(run) != ()


def test_states_of_another_pose_are_refused_before_the_run(pair):
    data = rest(pair)
    data.qpos[0] -= 0.7
    with (
        mjhill.installed(),
        pytest.raises(ValueError, match=r"to \d+\.\d F_max.*mjhill.equilibrate"),
    ):
        mjhill.record(pair, data, duration=0.05)


def test_a_muscle_that_pushes_is_a_finding(elbow):
    spec = joint_spec(elbow)
    actuator = spec.actuator("elbow_flexor")
    actuator.forcerange, actuator.forcelimited = [2, 5], mujoco.mjtLimited.mjLIMITED_TRUE
    model = spec.compile()
    with mjhill.installed(), pytest.warns(RuntimeWarning):
        run = mjhill.record(model, rest(model), duration=0.05)
    (push,) = mjhill.transients(run)
    assert (push.kind, push.value, push.limit, push.samples) == ("push", -2.0, 0.0, 51)
    assert "it pushes, and a muscle only pulls (51 samples from 0 s on" in str(push)
    assert "forcerange" in push.remedy


def test_shortening_faster_than_any_muscle_is_a_finding(pair, muscle):
    with mjhill.installed():
        run = mjhill.record(pair, rest(pair), duration=0.05, excitation={"elbow_flexor": 1.0})
    velocity = run["elbow_flexor.velocity"].copy()
    velocity[20] = 1.6 * muscle.max_velocity
    (found,) = mjhill.transients(
        replace(run, series={**run.series, "elbow_flexor.velocity": velocity})
    )
    assert (found.kind, found.time, found.value) == ("velocity", run.time[20], velocity[20])
    assert "shortens at" in str(found)


def test_a_force_that_is_not_a_number_is_a_finding(pair):
    with mjhill.installed():
        run = mjhill.record(pair, rest(pair), duration=0.05)
    force = run["elbow_flexor.force"].copy()
    force[7] = np.nan
    found = mjhill.transients(replace(run, series={**run.series, "elbow_flexor.force": force}))
    assert {(each.kind, each.time, each.samples) for each in found} == {
        ("force", run.time[7], 1),
        ("push", run.time[7], 1),
    }


def test_a_name_that_would_control_a_terminal_is_escaped(pair, muscle):
    with mjhill.installed():
        run = mjhill.record(pair, rest(pair), duration=0.05)
    series = {
        name.replace("elbow_flexor", "a\x1b[2J\nb"): values for name, values in run.series.items()
    }
    series["a\x1b[2J\nb.force"] = series["a\x1b[2J\nb.force"] + 1e3
    units = {name.replace("elbow_flexor", "a\x1b[2J\nb"): unit for name, unit in run.units.items()}
    bad = replace(run, series=series, units=units, muscles={"a\x1b[2J\nb": muscle})
    (found,) = mjhill.transients(bad)
    assert str(found).isprintable()
    assert r"muscle 'a\x1b[2J\nb'" in str(found)


def test_a_muscle_torn_by_its_joint_is_named_though_its_elements_would_carry_the_force(elbow):
    name = "elbow_extensor"
    slow = replace(elbow.muscles[name], max_velocity=0.01, viscosity=0.01)
    model = joint_spec(replace(elbow, muscles={**elbow.muscles, name: slow})).compile()
    load = {"elbow": 5 * slow.max_isometric_force}
    with mjhill.installed(), pytest.warns(RuntimeWarning, match="did what no muscle can"):
        run = mjhill.record(model, rest(model), duration=0.1, torque=load)
    (found,) = [f for f in mjhill.transients(run) if f.muscle == name and f.kind == "force"]
    assert found.value > found.limit == 3 * slow.max_isometric_force
    assert "times V_max, which tears it" in found.cause


@pytest.mark.parametrize("integrator", ["IMPLICITFAST", "RK4"])
@pytest.mark.parametrize("name", list(mjhill.JOINTS))
def test_the_scripted_movement_of_a_joint_has_no_finding(name, integrator):
    model = mjhill.load(name)
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    with mjhill.installed():
        run = mjhill.record(
            model, mjhill.at_home(model), duration=4.0,
            excitation=scripted.movement(muscle_names(model)),
        )  # fmt: skip
    assert mjhill.transients(run) == ()


@pytest.mark.parametrize("kind", ["physiological", "wide", "slide", "several", "spatial"])
def test_random_systems_in_order_have_no_finding(kind):
    fastest = []
    for number in range(6):
        case = cases.draw(kind, number)
        for integrator in ("IMPLICITFAST", "RK4"):
            solutions.use(case.model, integrator, 1e-3)
            if mjhill.check_model(case.model):
                continue
            with mjhill.installed():
                run = mjhill.record(
                    case.model, solutions.at_start(case), duration=cases.DURATION,
                    excitation=case.excitation, torque=case.torque,
                )  # fmt: skip
            assert mjhill.transients(run) == (), case.name
            fastest += [
                np.abs(run[f"{name}.velocity"]).max() / muscle.max_velocity
                for name, muscle in run.muscles.items()
            ]
    assert max(fastest) > 0.5  # they were driven hard
