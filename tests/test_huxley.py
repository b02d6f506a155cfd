"""Huxley's muscle: bins of bonds beside the closed form of 1957 and the true equations."""

import dataclasses

import mujoco
import numpy as np
import pytest
from click.testing import CliRunner

import mjhill
from mjhill.cli import main
from mjhill.engine.spec import joint_spec
from mjhill.muscles import bonds, steady_tension
from mjhill.muscles.huxley import MODEL, positions

ELBOW = mjhill.JOINTS["elbow"].with_muscles("huxley")
FLEXOR = dataclasses.replace(
    ELBOW.muscles["elbow_flexor"], width_short=1000.0, width_long=1000.0
)  # as strong at every length
FULL = FLEXOR.max_isometric_force
ROUNDING = 1e-12  # MuJoCo adds a rate times a timestep
V_MAX = float(MODEL.ask(MODEL.max_velocity, FLEXOR))


def stretched(muscle, velocity, duration, *, timestep=1e-3, u=1.0, before=1.0):
    """Force and states of a muscle alone whose length grows at a velocity [rad/s]."""
    states, length, forces = np.array(MODEL.ask(MODEL.steady, muscle, u=before, length=0.0)), 0, []
    for _ in range(round(duration / timestep)):
        length += velocity * timestep
        rates = np.zeros_like(states)
        MODEL.ask(
            MODEL.rates, muscle, states=states, state_rates=rates, staged=False, u=u, n=states[0],
            a=states[1], s=states[2], d=states[3], length=length, length_rate=velocity,
            timestep=timestep,
        )  # fmt: skip
        states = states + timestep * rates
        assert (states[4:] >= -ROUNDING).all()
        assert (states[4:] <= 1 + ROUNDING).all()
        forces.append(float(MODEL.ask(MODEL.tension, muscle, s=states[2], length=length)))
    return np.array(forces), states


def true_force(muscle, velocity, duration, *, u, before):
    """The same from the true equations, in small steps."""
    states, length, forces = np.array(MODEL.ask(MODEL.steady, muscle, u=before, length=0.0)), 0, []
    timestep = 1e-5
    for step in range(round(duration / timestep)):
        rates = np.zeros_like(states)
        MODEL.ask(
            MODEL.derivatives, muscle, states=states, state_rates=rates, u=u, n=states[0],
            a=states[1], s=states[2], length=length, length_rate=velocity,
        )  # fmt: skip
        states, length = states + timestep * rates, length + velocity * timestep
        if (step + 1) % 100 == 0:
            forces.append(float(MODEL.ask(MODEL.tension, muscle, s=states[2], length=length)))
    return np.array(forces)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.25, 0.5, 0.75])
def test_steady_shortening_has_the_force_of_the_closed_form(share):
    velocity = share * V_MAX
    found, _ = stretched(FLEXOR, -velocity, 0.15 + 0.02 / share, timestep=5e-4)
    last = found[-len(found) // 4 :] / FULL
    rates = (FLEXOR.attachment_rate, FLEXOR.detachment_rate, FLEXOR.pushing_detachment_rate)
    exact = bonds.steady_force(velocity / FLEXOR.bond_reach, *rates)
    assert abs(last.mean() - exact) < 0.01
    assert np.ptp(last) < 0.01


@pytest.mark.parametrize("u", [0.05, 0.4, 1.0])
def test_the_isometric_force_does_not_depend_on_where_the_bins_lie(u):
    lengths = np.linspace(0.0, 5 * FLEXOR.bond_reach, 41)
    forces = [steady_tension(FLEXOR, u, length) / FULL for length in lengths.tolist()]
    assert np.abs(np.array(forces) - u).max() < 0.002


@pytest.mark.parametrize(
    ("velocity", "u", "before", "duration"),
    [
        (0.0, 1.0, 0.3, 0.04),
        (-5.0, 1.0, 0.3, 0.04),
        (-5.0, 0.05, 0.3, 0.04),
        # while they hold: when stretched bonds let go, the moment is sensitive to everything
        (2.0, 0.3, 0.3, 0.02),
        (8.0, 1.0, 1.0, 0.01),
    ],
)
def test_a_step_lands_where_the_true_equations_go(velocity, u, before, duration):
    found, _ = stretched(FLEXOR, velocity, duration, u=u, before=before)
    exact = true_force(FLEXOR, velocity, duration, u=u, before=before)
    assert np.abs(found - exact).max() < 0.01 * FULL


def test_more_bins_and_shorter_steps_converge():
    def run(bins, timestep):
        muscles = {name: dataclasses.replace(one, bins=bins) for name, one in ELBOW.muscles.items()}
        model = joint_spec(dataclasses.replace(ELBOW, muscles=muscles)).compile()
        model.opt.timestep = timestep
        data = mujoco.MjData(model)
        data.qpos[0] = ELBOW.home_angle
        inputs = {"elbow_flexor": mjhill.step(0.5, 0.05) + 0.05, "elbow_extensor": 0.05}
        with mjhill.installed():
            mjhill.equilibrate(model, data)
            return mjhill.record(model, data, duration=0.4, excitation=inputs)

    fine = run(400, 1e-4)

    def off(bins, timestep):
        one = run(bins, timestep)
        exact = np.interp(one.time, fine.time, fine["elbow.angle"])
        error = np.sqrt(np.square(one["elbow.angle"] - exact).mean())
        return error / np.ptp(fine["elbow.angle"])

    assert off(100, 1e-3) < 0.01
    assert off(200, 1e-3) < 0.5 * off(70, 5e-3)


def test_bonds_that_break_when_stretched_limit_the_force_of_lengthening():
    unbroken = dataclasses.replace(
        FLEXOR, stretched_detachment_rate=0.0, longest_bond=20.0, bins=430.0
    )
    velocity = 0.2 * V_MAX
    held, _ = stretched(FLEXOR, velocity, 0.3)
    grown, _ = stretched(unbroken, velocity, 0.3)
    assert held.max() < 2.2 * FULL
    assert grown[-1] > 3.0 * FULL


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_a_fast_stretch_goes_on_at_a_steady_force(share):
    """No bonds are left where the window ends, so none are lost there all at once."""
    found, _ = stretched(FLEXOR, share * V_MAX, 0.4)
    last = found[-100:] / FULL
    assert np.ptp(last) < 0.15
    assert last.mean() > 1.0


def test_activation_can_scale_force_in_the_place_of_attachment():
    scaled = dataclasses.replace(FLEXOR, activation_scales_force=True)
    for u in (0.05, 0.4, 1.0):
        assert steady_tension(scaled, u, 0.3) == pytest.approx(u * FULL, rel=2e-3)
    slow, _ = stretched(FLEXOR, -0.4 * V_MAX, 0.1, u=0.3, before=0.3)
    fast, _ = stretched(scaled, -0.4 * V_MAX, 0.1, u=0.3, before=0.3)
    # where activation scales force, V_max is the same at every activation
    assert fast[-1] > 1.5 * slow[-1]


def test_bins_fill_the_window_once():
    x, width = positions(0.123, 100, 5.0, 0.02)
    assert np.allclose(np.diff(np.sort(x)), width)
    assert x.min() >= -1.5
    assert x.max() < 5.0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"bins": 10}, r"bins must be in \[50"),
        ({"bins": 100.5}, "bins must be a whole number, got 100.5"),
        ({"longest_bond": 20.0}, "bins must be 215 or more for a window up to longest_bond = 20"),
        ({"attachment_rate": -1.0}, "attachment_rate must be in"),
        ({"detachment_rate": 0.0}, "detachment_rate must be in"),
        ({"pushing_detachment_rate": 0.0}, "pushing_detachment_rate must be in"),
    ],
)
def test_bins_and_rates_that_cannot_be_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(FLEXOR, **values)


def test_bins_that_do_not_match_the_states_are_refused():
    spec = joint_spec(ELBOW)
    spec.actuators[0].actdim = 50
    with pytest.raises(ValueError, match="model 'huxley' but actdim is 50, not 104"):
        mjhill.check_model(spec.compile())
    model = mjhill.load("elbow", muscle="huxley")
    more = dataclasses.replace(mjhill.read_muscle(model, "elbow_flexor"), bins=200)
    with pytest.raises(ValueError, match="has 104 states and was given parameters for 204"):
        mjhill.write_muscle(model, "elbow_flexor", more)


def test_a_share_that_cannot_be_is_refused():
    model = mjhill.load("elbow", muscle="huxley")
    with mjhill.installed():
        data = mjhill.at_home(model)
        data.act[10] = 1.5
        with pytest.raises(ValueError, match="'elbow_flexor': its bin 6 must be in"):
            mjhill.record(model, data, duration=0.01)


def test_a_model_is_loaded_with_as_many_bins_as_asked_for():
    model = mjhill.load("elbow", muscle="huxley", bins=200)
    assert model.na == 2 * 204
    assert mjhill.read_muscle(model, "elbow_flexor").bins == 200
    with pytest.raises(ValueError, match=r"bins = 60 needs a muscle model with bins, got 'dm'"):
        mjhill.load("elbow", muscle="dm", bins=60)
    with pytest.raises(ValueError, match="bins must be in"):
        mjhill.load("elbow", muscle="huxley", bins=10)


def test_a_command_runs_it_with_bins(tmp_path):
    path = str(tmp_path / "run.csv")
    arguments = ["run", "elbow", "--muscle", "huxley", "--duration", "0.05", "--output", path]
    done = CliRunner().invoke(main, [*arguments, "--bins", "70"])
    assert done.exit_code == 0, done.output
    assert mjhill.Recording.load(path).muscles["elbow_flexor"].bins == 70
    refused = CliRunner().invoke(main, [*arguments, "--bins", "20"])
    assert refused.exit_code == 2
