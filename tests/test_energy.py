"""The power of muscles and plant: what contractile elements give, and where it goes."""

from __future__ import annotations

import contextlib
import copy
import io
import pickle
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
from conftest import rest

import mjhill
from mjhill.benchmarks import balance
from mjhill.engine.spec import joint_spec
from mjhill.joints.joint import passive_energy
from mjhill.muscles.readings import isometric_share, series_energy, tension
from mjhill.simulate.reference import plant_torque

SYSTEMS = ("elbow", "wrist", "knee", "ankle", "eye", 0, 1, 2, 3)  # numbers: variants of the elbow


def variant(seed: int) -> mjhill.Joint:
    """The elbow with parameters drawn at random."""
    random = np.random.default_rng(seed)
    elbow = mjhill.JOINTS["elbow"]
    varied = ("max_isometric_force", "width_short", "width_long", "max_velocity", "hill_shape")
    varied += ("series_stretch", "excitation_tau", "activation_tau", "deactivation_tau")
    muscles = {
        name: replace(
            muscle,
            **{each: getattr(muscle, each) * 2 ** random.uniform(-1, 1) for each in varied},
            series_shape=random.uniform(1, 5),
            eccentric_plateau=random.uniform(1.1, 1.8),
            eccentric_slope_ratio=random.uniform(0.5, 6),
            velocity_activation=random.uniform(0, 1),
        )
        for name, muscle in elbow.muscles.items()
    }
    plant = {
        each: getattr(elbow, each) * 2 ** random.uniform(-1, 1)
        for each in ("inertia", "damping", "stiffness")
    }
    return replace(elbow, muscles=muscles, **plant)


def movements(joint: mjhill.Joint) -> list[tuple[dict[str, mjhill.Signal], mjhill.Signal]]:
    """Excitations and torque: steps, pulses, a torque impulse, co-contraction with an impulse."""
    first, second = joint.muscles
    blow = 0.3 * min(muscle.max_isometric_force for muscle in joint.muscles.values())
    step, pulse, constant = mjhill.step, mjhill.pulse, mjhill.constant
    both = step(0.7, 0.02)
    return [
        ({first: step(0.8, 0.02), second: step(0.6, 0.22)}, constant(0)),
        ({first: pulse(1, 0.02, 0.12), second: pulse(1, 0.15, 0.1)}, constant(0)),
        ({first: constant(0.05), second: constant(0.05)}, pulse(blow, 0.1, 0.03)),
        ({first: both + pulse(0.3, 0.15, 0.1), second: both}, pulse(blow, 0.3, 0.03)),
    ]


def joint_of(system: str | int) -> mjhill.Joint:
    return variant(system) if isinstance(system, int) else mjhill.JOINTS[system]


@cache
def recorded(system: str | int, integrator: str, timestep: float) -> list[mjhill.Recording]:
    """The movements of a system."""
    joint = joint_of(system)
    model = joint_spec(joint).compile()
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    model.opt.timestep = timestep
    runs = []
    for excitation, torque in movements(joint):
        data, load = rest(model, joint.home_angle), {joint.name: torque}
        with mjhill.installed():
            run = mjhill.record(model, data, duration=0.4, excitation=excitation, torque=load)
        runs.append(run)
    return runs


def gap(system: str | int, integrator: str, timestep: float, heavier: bool = False) -> float:
    """The largest gap of the movements of a system; ``heavier`` by what damping adds in MuJoCo.

    MuJoCo's single-step integrators damp by the velocity at the end of the step. That is half a
    step later than the force, as if half a step of viscosity were added to the inertia.
    """
    joint = joint_of(system)
    added = 0.5 * timestep * joint.damping if heavier else 0.0
    gaps = []
    for run in recorded(system, integrator, timestep):
        balance = mjhill.energy(run)
        square = balance.kinetic * 2 / joint.inertia
        lacking = np.abs(balance.residual - 0.5 * added * square).max()
        gaps.append(balance.gap * lacking / np.abs(balance.residual).max())
    return max(gaps)


def muscle_gap(system: str | int, integrator: str, timestep: float) -> float:
    return max(mjhill.energy(run).muscle_gap for run in recorded(system, integrator, timestep))


@pytest.mark.parametrize("end", [-0.02, 0.2, 1.5])
def test_series_energy_is_the_work_that_stretches_the_element(muscle, end):
    stretch = np.linspace(0.0, end, 20001)  # the last end is past the limit
    force = [tension(muscle, each) for each in stretch.tolist()]
    expected = np.trapezoid(force, stretch)
    assert series_energy(muscle, stretch)[-1] == pytest.approx(expected, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("end", [-1.1, 0.9, -6.0, 5.0])
def test_passive_energy_is_the_work_that_bends_the_joint(elbow, end):
    passive = replace(elbow.passive, exponent_limit=2.0)
    joint = replace(elbow, passive=passive, stiffness=0.0)
    deviation = np.linspace(0.0, end, 20001)
    torque = [plant_torque(joint, joint.rest_angle + each) for each in deviation.tolist()]
    expected = -np.trapezoid(torque, deviation)
    assert passive_energy(passive, deviation)[-1] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("system", SYSTEMS)
def test_contractile_work_is_stretch_of_the_series_element_and_work_on_the_joint(system):
    coarse, fine = (muscle_gap(system, "IMPLICITFAST", timestep) for timestep in (1e-3, 5e-4))
    assert coarse < 3e-4
    assert fine < 0.35 * coarse  # second order


@pytest.mark.parametrize(
    ("system", "integrator"),
    [("elbow", "IMPLICITFAST"), ("elbow", "EULER"), ("knee", "IMPLICITFAST")],
)
def test_power_closes_to_what_damping_adds_at_1_ms_and_with_first_order(system, integrator):
    found = [gap(system, integrator, timestep) for timestep in (1e-3, 5e-4, 2.5e-4)]
    joint = joint_of(system)
    # MuJoCo's own: as if half a step of damping were inertia, which moves as the limb does
    assert found[0] < max(3e-3, 0.5e-3 * joint.damping / joint.inertia)
    assert found[1] < 0.55 * found[0]
    assert found[2] < 0.55 * found[1]


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_first_order_part_is_the_inertia_that_implicit_damping_adds(system):
    coarse, fine = (
        gap(system, "IMPLICITFAST", timestep, heavier=True) for timestep in (1e-3, 5e-4)
    )
    assert coarse < 3e-3
    assert fine < 0.35 * coarse  # second order


@pytest.mark.parametrize("system", ["elbow", "knee"])
def test_under_rk4_power_closes_to_a_millionth_at_a_quarter_of_a_millisecond(system):
    coarse, fine = (gap(system, "RK4", timestep) for timestep in (1e-3, 2.5e-4))
    assert coarse < 1e-4
    assert fine < 1e-6


def test_energy_needs_every_step(pair):
    with mjhill.installed():
        run = mjhill.record(pair, rest(pair), duration=0.1, every=2)
    with pytest.raises(ValueError, match="energy needs a recording of every step"):
        mjhill.energy(run)


# a slide that holds an arm of hinge, hinge and ball, with a muscle over all of them
LIMB = """
<mujoco>
  <option timestep="{timestep}" integrator="{integrator}" density="{density}"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <site name="origin" pos="0.03 0 0.3"/>
    <body><joint name="shift" type="slide" axis="1 0 0" damping="20" stiffness="100"/>
      <joint name="shoulder" axis="0 1 0" damping="0.2" stiffness="1 0.5 0.7" springref="20"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3" mass="1"/>
      <body pos="0 0 -0.3" gravcomp="{gravcomp}">
        <joint name="elbow" axis="0 1 0" damping="0.1 0.05"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.25" mass="0.7"/>
        <site name="insertion" pos="0.02 0 -0.1"/>
        <body name="hand" pos="0 0 -0.25"><joint name="wrist" type="ball" damping="0.02"
          stiffness="{ball}"/>
          <geom type="box" size="0.02 0.04 0.05" pos="0.01 0 -0.05" mass="0.3"/>
        </body></body></body>
  </worldbody>
  <tendon><spatial name="tendon" stiffness="{spring}" damping="{damper}">
    <site site="origin"/><site site="insertion"/></spatial></tendon>
  <equality>{equality}</equality>
</mujoco>"""
PLAIN = {
    "density": 0, "gravcomp": 0, "ball": 0, "spring": 0, "damper": 0, "equality": "",
    "motor": False, "push": False, "torque": {},
}  # fmt: skip
LIMBS = {
    "gravity": {},
    "gravity compensated": {"gravcomp": 0.5},
    "springs": {"ball": 2, "spring": 50, "damper": 3},
    "fluid": {"density": 1000},
    "motor": {"motor": True},
    "push": {"push": True},
    "torque": {"torque": {"elbow": mjhill.pulse(2, 0.1, 0.1), "shift": mjhill.step(3, 0.1)}},
    "constraint": {"equality": '<joint joint1="elbow" polycoef="0.5 0 0 0 0"/>'},
}


def limb(integrator: str, timestep: float, changes: dict) -> mjhill.Recording:
    """A movement of the limb with some of its parts."""
    parts = {**PLAIN, **changes}
    spec = mujoco.MjSpec.from_string(LIMB.format(integrator=integrator, timestep=timestep, **parts))
    puller = mjhill.Hill(
        max_isometric_force=300, optimal_length=0, width_short=0.1, width_long=0.1,
        max_velocity=0.8, hill_shape=0.3, series_stretch=0.02, excitation_tau=0.03,
        activation_tau=0.01, deactivation_tau=0.04, velocity_activation=0.3,
    )  # fmt: skip
    mjhill.add_muscle(spec, name="puller", muscle=puller, tendon="tendon")
    passive = mjhill.Passive(k1_pos=0.1, k2_pos=3, k1_neg=0.1, k2_neg=3)
    mjhill.add_passive(spec, joint="elbow", passive=passive)
    excitation = {"puller": mjhill.step(0.5, 0.05)}
    if parts["motor"]:
        motor = spec.add_actuator(name="motor", target="elbow", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
        excitation["motor"] = mjhill.sinusoid(1.0, 2.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:3] = 0.01, 0.3, 0.5
    data.qpos[3:7] = 0.9, 0.3, 0.1, 0.3
    mujoco.mj_normalizeQuat(model, data.qpos)
    if parts["push"]:
        data.xfrc_applied[model.body("hand").id] = 1, 2, 0, 0.1, 0, 0
    mjhill.equilibrate(model, data)
    with mjhill.installed():
        return mjhill.record(
            model, data, duration=0.4, excitation=excitation, torque=parts["torque"]
        )


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
@pytest.mark.parametrize("changes", LIMBS.values(), ids=LIMBS)
def test_power_of_a_limb_closes_with_whatever_acts_on_it(changes, integrator):
    coarse, fine = (mjhill.energy(limb(integrator, h, changes)).gap for h in (1e-3, 5e-4))
    assert coarse < 4e-3
    assert fine < 0.55 * coarse  # first order


@pytest.mark.parametrize("what", ["gravity", "gravity compensated", "springs", "fluid", "push"])
def test_power_of_a_limb_closes_to_a_millionth_under_rk4(what):
    coarse, fine = (mjhill.energy(limb("RK4", h, LIMBS[what])).gap for h in (1e-3, 5e-4))
    assert coarse < 1e-6
    assert fine < 0.2 * coarse  # third order at least


def test_every_term_of_a_limb_matters():
    changes = {key: value for part in LIMBS.values() for key, value in part.items()}
    found = mjhill.energy(limb("implicitfast", 1e-3, changes))
    assert found.gap < 0.01
    terms = [
        *found.contractile.values(), *found.series.values(), sum(found.elastic.values()),
        found.kinetic, found.gravity, found.springs, found.damping, found.external,
        found.constraint, found.other,
    ]  # fmt: skip
    assert set(found.elastic) == {"shift", "shoulder", "elbow"}
    for term in terms:
        assert np.abs(term).max() > 2 * np.abs(found.residual).max()


def test_the_energy_of_a_spring_that_stiffens_is_what_mujoco_has():
    run = limb("implicitfast", 1e-3, {})
    bend = run["shoulder.angle"] - np.radians(20)
    stored = 0.5 * bend**2 + 0.5 * bend**3 / 3 + 0.7 * bend**4 / 4
    np.testing.assert_allclose(run["shoulder.passive_energy"], stored, rtol=1e-12)
    model = mujoco.MjModel.from_xml_string("""<mujoco><option gravity="0 0 0"/><worldbody><body>
      <joint axis="0 1 0" stiffness="1 0.5 0.7" springref="20"/><geom size="0.1"/></body>
      </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qpos[0] = run["shoulder.angle"][-1]
    mujoco.mj_forward(model, data)
    mujoco.mj_energyPos(model, data)
    assert stored[-1] == pytest.approx(data.energy[0], rel=1e-12)


def test_work_that_a_forcerange_withholds_is_a_term(elbow):
    spec = joint_spec(elbow)
    actuator = spec.actuator("elbow_flexor")
    actuator.forcerange, actuator.forcelimited = [-5, 0], mujoco.mjtLimited.mjLIMITED_TRUE
    model = spec.compile()
    excitation = {"elbow_flexor": mjhill.step(1.0, 0.02)}
    with mjhill.installed(), pytest.warns(RuntimeWarning, match="its forcerange"):
        run = mjhill.record(model, rest(model), duration=0.4, excitation=excitation)
    found = mjhill.energy(run)
    assert found.withheld["elbow_flexor"][-1] > 0.1 * found.contractile["elbow_flexor"][-1] > 0.1
    assert not found.withheld["elbow_extensor"].any()
    assert found.gap < 3e-3
    assert found.muscle_gap < 3e-4


def test_loss_to_viscosity_is_the_work_that_a_muscle_without_it_would_give_more(elbow):
    """At a prescribed force-velocity point both follow from Hill's relation."""
    muscle = replace(elbow.muscles["elbow_flexor"], viscosity=0.2)
    joint = replace(elbow, muscles={**elbow.muscles, "elbow_flexor": muscle})
    model = joint_spec(joint).compile()
    model.opt.timestep = 2.5e-4
    with mjhill.installed():
        run = mjhill.record(
            model, rest(model), duration=0.3, excitation={"elbow_flexor": mjhill.step(1.0, 0.02)}
        )
    name = "elbow_flexor"
    found = mjhill.energy(run)
    velocity, a = run[f"{name}.velocity"], run[f"{name}.a"]
    active = [isometric_share(muscle, *pair) for pair in zip(a, run[f"{name}.length"], strict=True)]
    active = np.maximum(active, 0)
    scale = 1 - muscle.velocity_activation + muscle.velocity_activation * active
    w = velocity / muscle.max_velocity / scale
    without = muscle.max_isometric_force * active * muscle.hill_shape * (1 - w)
    without /= muscle.hill_shape + w
    shortening = (w > 0.02) & (run.time > 0.1)
    power = np.diff(found.viscosity[name]) / np.diff(run.time)
    expected = (without - run[f"{name}.force"]) * velocity
    np.testing.assert_allclose(power[shortening[1:]], expected[1:][shortening[1:]], rtol=0.05)
    assert shortening.sum() > 50


def test_a_balance_prints_its_terms_and_can_be_copied(pair):
    with mjhill.installed():
        run = mjhill.record(pair, rest(pair), duration=0.1, excitation={"elbow_flexor": 0.5})
    found = mjhill.energy(run)
    for other in (copy.deepcopy(found), pickle.loads(pickle.dumps(found))):
        assert str(other) == str(found)
    lines = str(found).splitlines()
    assert lines[0] == "energy balance of 0.1 s [J]"
    end = found.at_end()
    assert end["lost to damping"] == found.damping[-1]
    assert f"{end['lost to damping']:.6f}" in str(found)
    assert lines[-1].startswith("largest residual: 0.")
    assert "constraint" not in str(found)  # there are none
    with pytest.raises(TypeError, match="cannot be changed"):
        found.series["elbow_flexor"] = 0


def test_a_saved_recording_has_the_same_balance(pair, tmp_path):
    with mjhill.installed():
        run = mjhill.record(pair, rest(pair), duration=0.1, excitation={"elbow_flexor": 0.5})
    for suffix in (".csv", ".npz"):
        loaded = mjhill.Recording.load(run.save(tmp_path / f"run{suffix}"))
        assert str(mjhill.energy(loaded)) == str(mjhill.energy(run))


def test_a_recording_that_is_none_of_record_has_no_balance(elbow):
    exact = mjhill.reference.simulate(elbow, {}, duration=0.01)
    with pytest.raises(ValueError, match="needs a recording that mjhill.record made"):
        mjhill.energy(exact)


PAGE = (Path(__file__).parent.parent / "docs" / "energy.md").read_text(encoding="utf-8")
NUMBER = r"-?\d+\.\d+"


def test_the_program_of_the_page_prints_what_the_page_says():
    (program,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert len([line for line in program.splitlines() if line]) <= 10
    (text,) = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(program, {})
    said, found = text.splitlines(), printed.getvalue().splitlines()
    assert [re.sub(NUMBER, "", line).split() for line in said] == [
        re.sub(NUMBER, "", line).split() for line in found
    ]
    for one, other in zip(said, found, strict=True):
        assert list(map(float, re.findall(NUMBER, one))) == pytest.approx(
            list(map(float, re.findall(NUMBER, other))), rel=1e-3, abs=2e-6
        )


def test_the_table_of_residuals_is_what_is_measured():
    (table,) = re.findall(r"<!-- balance.*?-->\n(.*?)<!-- end -->", PAGE, re.DOTALL)
    _, _, *written = table.splitlines()
    for line, (joint, pairs) in zip(written, balance.rows(), strict=True):
        name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        assert name == joint
        for cell, pair in zip(cells, pairs, strict=True):
            # two digits; the smallest under RK4 hang on the last bits of exp
            assert list(map(float, cell.split(" / "))) == pytest.approx(pair, rel=0.1, abs=2e-5)


def test_the_page_lists_every_series_of_muscles_and_models(elbow):
    changes = {key: value for part in LIMBS.values() for key, value in part.items()}
    run = limb("implicitfast", 1e-3, changes)
    quantities = {name.partition(".")[2] for name in run if name.startswith("puller.")}
    quantities = {re.sub("^arm_.*", "arm_<joint>", quantity) for quantity in quantities}
    whole = {name for name in run if name.startswith("model.")}
    rows = [row for row in PAGE.splitlines() if row.startswith("| `")]
    listed = {name for row in rows for name in re.findall(r"`([^`]+)`", row.split("|")[1])}
    assert listed >= quantities | whole
    assert listed - quantities - whole == {"tension", "force", "velocity", "push"} - quantities
