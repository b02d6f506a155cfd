import dataclasses
import math

import mujoco
import numpy as np
import pytest

import mjhill
from mjhill.engine.spec import joint_spec
from mjhill.simulate.reference import rest_state, simulate

CASES = {
    "step": ({"elbow_flexor": mjhill.step(0.5, 0.05)}, 0.0),
    "pulses": (
        {
            "elbow_flexor": mjhill.pulse(1.0, 0.05, 0.1),
            "elbow_extensor": mjhill.pulse(0.8, 0.15, 0.08),
        },
        0.0,
    ),
    "sinusoids": (
        {
            "elbow_flexor": mjhill.sinusoid(0.2, 2.0) + 0.2,
            "elbow_extensor": mjhill.sinusoid(0.2, 2.0, math.pi) + 0.2,
        },
        0.0,
    ),
    "torque": ({"elbow_flexor": 0.1, "elbow_extensor": 0.1}, mjhill.pulse(10.0, 0.1, 0.05)),
    "co-contraction": (
        {"elbow_flexor": mjhill.step(0.6, 0.05), "elbow_extensor": mjhill.step(0.6, 0.05)},
        mjhill.sinusoid(3.0, 4.0),
    ),
}


def start(joint, case):
    # a co-contracting joint hardly moves, so it starts where nothing else moves it
    return rest_state(joint, joint.rest_angle if case == "co-contraction" else joint.home_angle)


def run(joint, case, integrator, timestep, duration=0.6):
    excitation, torque = CASES[case]
    model = joint_spec(joint).compile()
    model.opt.timestep = timestep
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    data = mujoco.MjData(model)
    state = start(joint, case)
    data.qpos[0], data.qvel[0], data.act[:] = state[0], state[1], state[2:]
    with mjhill.installed():
        return mjhill.record(
            model, data, duration=duration, excitation=excitation, torque={"elbow": torque},
            every=round(1e-3 / timestep) or 1,
        )  # fmt: skip


def exact(joint, case, sample=1e-3, duration=0.6):
    excitation, torque = CASES[case]
    return simulate(
        joint, excitation, torque=torque, duration=duration, sample=sample,
        start=start(joint, case),
    )  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_mujoco_agrees_with_the_reference(elbow, case):
    truth = exact(elbow, case)
    movement = np.ptp(truth["elbow.angle"])
    # MuJoCo's own half step is left under single-step integrators; RK4 leaves its cap on
    # stiffness, which is to cost less than 0.05 degrees
    rk4 = math.radians(0.05) / movement
    for integrator, allowed in (("EULER", 5e-3), ("IMPLICITFAST", 5e-3), ("RK4", rk4)):
        result = run(elbow, case, integrator, 1e-3)
        np.testing.assert_allclose(result.time, truth.time, atol=1e-9)
        assert np.abs(result["elbow.angle"] - truth["elbow.angle"]).max() < allowed * movement
        for name in elbow.muscles:
            force = truth[f"{name}.force"]
            difference = np.abs(result[f"{name}.force"] - force).max()
            assert difference < 4 * allowed * max(force.max(), 1.0)


@pytest.mark.parametrize("integrator", ["EULER", "IMPLICIT", "IMPLICITFAST", "DISCRETE"])
def test_single_step_integrators_converge_with_first_order(elbow, integrator):
    truth = exact(elbow, "step")
    errors = [
        np.abs(run(elbow, "step", integrator, h)["elbow.angle"] - truth["elbow.angle"]).max()
        for h in (1e-3, 5e-4, 2.5e-4)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((orders > 0.8) & (orders < 1.6))


def test_rk4_converges_with_high_order_down_to_the_accuracy_of_the_reference(elbow):
    errors = []
    for timestep in (2e-3, 1e-3):
        truth = exact(elbow, "step", sample=timestep)
        result = run(elbow, "step", "RK4", timestep)
        errors.append(np.abs(result["elbow.angle"] - truth["elbow.angle"]).max())
    assert errors[1] < 2e-5
    assert errors[0] / errors[1] > 4


def test_reference_is_independent_of_its_tolerance(elbow):
    excitation, torque = CASES["pulses"]
    tight, loose = (
        simulate(elbow, excitation, torque=torque, duration=0.4, rtol=r, atol=r * 1e-2)
        for r in (1e-10, 1e-7)
    )
    assert np.abs(tight["elbow.angle"] - loose["elbow.angle"]).max() < 1e-5


def test_reference_does_not_step_over_a_short_pulse(elbow):
    impulse = simulate(elbow, {"elbow_flexor": mjhill.pulse(1.0, 0.2, 0.002)}, duration=0.4)
    tau = elbow.muscles["elbow_flexor"].excitation_tau
    assert impulse["elbow_flexor.n"].max() == pytest.approx(1 - math.exp(-0.002 / tau), rel=1e-3)


def test_reference_ends_at_the_balance_of_torques(elbow):
    final = simulate(elbow, {"elbow_flexor": 0.3}, duration=4.0, sample=0.1)
    total = final["elbow_flexor.force"][-1] - final["elbow_extensor.force"][-1]
    from mjhill.simulate.reference import plant_torque

    assert total + plant_torque(elbow, final["elbow.angle"][-1]) == pytest.approx(0.0, abs=1e-4)


def test_electrical_stimulation_acts_sooner_in_both_solvers(elbow):
    stimulated = dataclasses.replace(
        elbow,
        muscles={
            name: dataclasses.replace(m, electrical_stimulation=True)
            for name, m in elbow.muscles.items()
        },
    )
    truth = exact(stimulated, "step")
    assert truth["elbow_flexor.force"][100] > 1.3 * exact(elbow, "step")["elbow_flexor.force"][100]
    result = run(stimulated, "step", "EULER", 1e-3)
    error = np.abs(result["elbow.angle"] - truth["elbow.angle"]).max()
    assert error < 5e-3 * np.ptp(truth["elbow.angle"])


def test_reference_refuses_bad_input(elbow):
    with pytest.raises(ValueError, match="unknown muscle 'biceps'; there are: elbow_flexor"):
        simulate(elbow, {"biceps": 0.5}, duration=1.0)
    with pytest.raises(ValueError, match="duration must be positive, got 0"):
        simulate(elbow, {}, duration=0)
    with pytest.raises(ValueError, match="level must be finite, got nan"):
        simulate(elbow, {"elbow_flexor": float("nan")}, duration=1.0)
