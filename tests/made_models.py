"""Muscle models made on the fly: files that tests put into a copy of the package.

``cascade`` has an array of states: excitation passes ``stages`` first-order lags, and the last
one is the share of the largest force.
"""

CASCADE = '''
"""A muscle whose excitation passes a row of equal lags."""

from dataclasses import dataclass
from math import exp

from mjhill.muscles.model import Muscle, MuscleModel, same_parameters
from mjhill.quantity import quantity

GAIN = 1.0


@dataclass(frozen=True, kw_only=True)
class Cascade(Muscle):
    """Parameters."""

    activation_tau: float = quantity("tau", "s", "of each lag", (1e-4, 1), array="dynprm")
    stages: float = quantity("N", "-", "number of lags", (1, 1000), default=5, array="dynprm")


def step(before, x, tau, dt):
    return before + (x - before) * exp(-dt / tau)


def rates(states, state_rates, staged, u, timestep, activation_tau):
    before = u
    for k in range(len(states)):
        if staged:
            state_rates[k] = (before - states[k]) / activation_tau
        else:
            after = step(before, states[k], activation_tau, timestep)
            state_rates[k] = (after - states[k]) / timestep
        before = states[k]


def derivatives(states, state_rates, u, activation_tau):
    before = u
    for k in range(len(states)):
        state_rates[k] = (before - states[k]) / activation_tau
        before = states[k]


def tension(states, max_isometric_force):
    return GAIN * states[len(states) - 1] * max_isometric_force


def steady(u, stages):
    return [u] * round(stages)


def series(track):
    yield "force", "force", track.force
    yield "length", "length", track.length
    yield "length_rate", "rate", track.length_rate
    work = track.work(track.force, -track.length)
    yield "power", "power", track.power(work, 0.0)
    yield "work", "energy", work


def none(max_isometric_force):
    zero = 0.0 * max_isometric_force
    return zero, zero, zero


def lengthening(max_isometric_force):
    return max_isometric_force, 0.0 * max_isometric_force


def compliance(max_isometric_force):
    return 1.0 + 0.0 * max_isometric_force


MODEL = MuscleModel(
    name="cascade",
    tag=198790.0,
    meaning="a row of lags",
    parameters=Cascade,
    states=(),
    bins="stages",
    rates=rates,
    force=tension,
    derivatives=derivatives,
    tension=tension,
    steady=steady,
    series=series,
    readings={},
    at_full_force=none,
    lengthening=lengthening,
    compliance=compliance,
    max_velocity=None,
    from_hill=same_parameters(Cascade),
    sources="made for a test",
)
'''

RUN = """
import json, sys, warnings
import mujoco, numpy as np
import mjhill
from mjhill.engine.spec import joint_spec
from mjhill.engine.code_cache import cache_folder


def at_work(name):
    joint = mjhill.JOINTS["elbow"].with_muscles(name)
    flexor, extensor = joint.muscles
    model = joint_spec(joint).compile()

    def start():
        data = mujoco.MjData(model)
        data.qpos[0] = joint.home_angle
        mjhill.equilibrate(model, data)
        return data

    found = {"na": model.na, "findings": len(mjhill.check_model(model))}
    for integrator in ("implicitfast", "RK4"):
        model.opt.integrator = getattr(mujoco.mjtIntegrator, "mjINT_" + integrator.upper())
        runs = {}
        for backend in ("compiled", "python"):
            with mjhill.installed(backend):
                run = mjhill.record(model, start(), duration=0.3, excitation={flexor: 0.2})
                runs[backend] = run["elbow.angle"]
        exact = mjhill.reference.simulate(joint, {flexor: 0.2}, duration=0.3)
        found[integrator] = {
            "apart": float(np.abs(runs["compiled"] - runs["python"]).max()),
            "off": float(np.abs(runs["compiled"] - exact["elbow.angle"]).max()),
            "moved": float(np.ptp(exact["elbow.angle"])),
            "gap": mjhill.energy(run).gap,
        }
    with mjhill.installed():
        data = mujoco.MjData(model)
        data.ctrl[:] = 0.3, 0.1
        mjhill.equilibrate(model, data)
        found["steady"] = np.unique(data.act.round(12)).tolist()
        mujoco.mj_forward(model, data)
        found["force"] = -data.actuator_force[0] / joint.muscles[flexor].max_isometric_force
    found["read"] = mjhill.read_muscle(model, flexor) == joint.muscles[flexor]
    return found


found = {name: at_work(name) for name in sys.argv[1:]}
print(json.dumps({**found, "cached": len(list(cache_folder().glob("*.code")))}))
"""
