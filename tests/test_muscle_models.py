"""The seam: every muscle model works everywhere, and a new one is a file and a line."""

import dataclasses
import json
import os
import re
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import mujoco
import mujoco.batch
import numpy as np
import pytest
from click.testing import CliRunner
from made_models import CASCADE, RUN

import mjhill
from mjhill.cli import main
from mjhill.engine.equations import compiled_functions, globals_of, source_digest, with_callees
from mjhill.engine.layout import addresses, muscle_ids
from mjhill.engine.spec import joint_spec
from mjhill.muscles import hill, hill_rigid
from mjhill.muscles.model import MuscleModel, arguments

ROOT = Path(__file__).parent.parent
INTEGRATORS = ("EULER", "IMPLICIT", "IMPLICITFAST", "DISCRETE", "RK4")
NAMES = [model.name for model in mjhill.MODELS]
MUSCLES = ("elbow_flexor", "elbow_extensor")
MOVEMENT = {
    "elbow_flexor": mjhill.pulse(0.6, 0.05, 0.2) + 0.05,
    "elbow_extensor": mjhill.pulse(0.3, 0.2, 0.2) + 0.05,
}


@pytest.mark.parametrize("name", NAMES)
def test_a_model_says_what_it_is(name):
    model = mjhill.muscle_model(name)
    assert model.meaning
    assert "19" in model.sources
    assert 198700 <= model.tag < 198800
    assert model.parameters.__doc__


def test_tags_and_names_are_unlike_each_other():
    assert len({model.tag for model in mjhill.MODELS}) == len(mjhill.MODELS)
    assert len(set(NAMES)) == len(mjhill.MODELS)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("name", NAMES)
def test_both_back_ends_agree(name, integrator):
    model = mjhill.load("elbow", muscle=name)
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    states = []
    for backend in ("compiled", "python"):
        with mjhill.installed(backend):
            data = mjhill.at_home(model)
            for step in range(200):
                data.ctrl[:] = (0.8, 0.1) if 20 < step < 120 else (0.1, 0.4)
                mujoco.mj_step(model, data)
        states.append(np.concatenate((data.qpos, data.qvel, data.act, data.actuator_force)))
    np.testing.assert_allclose(states[0], states[1], rtol=1e-9, atol=1e-12)


STAGED = [model.name for model in mjhill.MODELS if model.staged]
# bonds that are stretched too far let go within a millisecond: forces differ much for a moment, so
# root mean squares count
AVALANCHES = {"dm": 1e-3}
# with an array of states, whose reference takes minutes; they have tests of their own
ARRAYS = [model.name for model in mjhill.MODELS if model.bins]


@pytest.mark.parametrize(
    ("name", "integrator", "most"),
    [(name, "IMPLICITFAST", 3e-3) for name in NAMES if name not in (*AVALANCHES, *ARRAYS)]
    + [(name, "RK4", 1e-4) for name in STAGED],
)
def test_a_run_follows_the_reference(name, integrator, most):
    run, exact = run_and_reference(name, integrator)
    for what in ("elbow.angle", "elbow_flexor.force", "elbow_flexor.a"):
        error = np.abs(run[what] - exact[what]).max() / np.ptp(exact[what])
        # force is steeper than angle: it has the lag of a step
        assert error < (most if what != "elbow_flexor.force" else 6 * most), what
    assert set(exact.series) <= set(run.series) | {"elbow.applied"}


@pytest.mark.parametrize(("name", "most"), AVALANCHES.items())
def test_a_run_of_bonds_follows_the_reference(name, most):
    run, exact = run_and_reference(name, "IMPLICITFAST")
    for what in ("elbow.angle", "elbow_flexor.force", "elbow_flexor.a"):
        error = np.sqrt(np.square(run[what] - exact[what]).mean()) / np.ptp(exact[what])
        assert error < (most if what != "elbow_flexor.force" else 12 * most), what
    assert set(exact.series) <= set(run.series) | {"elbow.applied"}


@pytest.mark.parametrize("name", [model.name for model in mjhill.MODELS if not model.staged])
def test_a_model_that_cannot_follow_rk4_is_refused_under_it(name):
    model = mjhill.load("elbow", muscle=name)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    with pytest.raises(ValueError, match=f"'elbow_flexor' is of the model '{name}', which RK4"):
        mjhill.check_model(model)


def run_and_reference(name, integrator):
    joint = mjhill.JOINTS["elbow"].with_muscles(name)
    model = joint_spec(joint).compile()
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    data = mujoco.MjData(model)
    data.qpos[0] = joint.home_angle
    with mjhill.installed():
        mjhill.equilibrate(model, data)
        run = mjhill.record(model, data, duration=0.6, excitation=MOVEMENT)
    return run, mjhill.reference.simulate(joint, MOVEMENT, duration=0.6)


@pytest.mark.parametrize("name", NAMES)
def test_energy_is_accounted_for(name):
    model = mjhill.load("elbow", muscle=name)
    with mjhill.installed():
        run = mjhill.record(model, mjhill.at_home(model), duration=0.6, excitation=MOVEMENT)
    balance = mjhill.energy(run)
    assert balance.gap < 0.01
    if name in ("hill", "hill-rigid"):  # bonds lose energy where they break
        assert balance.viscosity["elbow_flexor"][-1] > 0


@pytest.mark.parametrize("name", NAMES)
def test_a_recording_comes_back_from_its_file_with_its_muscles(name, tmp_path):
    model = mjhill.load("elbow", muscle=name)
    with mjhill.installed():
        run = mjhill.record(model, mjhill.at_home(model), duration=0.05, excitation=MOVEMENT)
    for suffix in ("csv", "npz"):
        assert mjhill.Recording.load(run.save(tmp_path / f"run.{suffix}")) == run
    assert type(run.muscles["elbow_flexor"]) is mjhill.muscle_model(name).parameters


@pytest.mark.parametrize("name", NAMES)
def test_a_batch_does_as_single_steps(name):
    model = mjhill.load("elbow", muscle=name)
    with mjhill.installed():
        data = mjhill.at_home(model)
        batch = mujoco.batch.Batch(model, nsim=3)
        batch.qpos[:], batch.act[:], batch.ctrl[:] = data.qpos, data.act, (0.5, 0.1)
        batch.step(nstep=100)
        data.ctrl[:] = 0.5, 0.1
        mujoco.mj_step(model, data, 100)
    assert (batch.qpos == data.qpos).all()
    assert (batch.act == data.act).all()


@pytest.mark.parametrize("name", NAMES)
def test_a_model_loads_still_and_steady_at_its_home_key(name):
    model = mjhill.load("elbow", muscle=name)
    at_key, steady = mujoco.MjData(model), mjhill.at_home(model)
    mujoco.mj_resetDataKeyframe(model, at_key, model.key("home").id)
    np.testing.assert_array_equal(at_key.act, steady.act)
    assert model.key("home").qpos[0] == mjhill.JOINTS["elbow"].home_angle


@pytest.mark.parametrize("name", NAMES)
def test_parameters_are_written_and_read_back(name):
    model = mjhill.load("elbow", muscle=name)
    muscle = mjhill.read_muscle(model, "elbow_flexor")
    stronger = dataclasses.replace(muscle, max_isometric_force=99.0)
    mjhill.write_muscle(model, "elbow_flexor", stronger)
    assert mjhill.read_muscle(model, "elbow_flexor") == stronger
    assert mjhill.muscle_names(model) == ["elbow_flexor", "elbow_extensor"]


# has no force-length relation and no least active state; tests/test_hill_linear.py has its own
ELSEWHERE = ("hill-linear",)


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ELSEWHERE])
def test_at_rest_the_force_is_that_of_hill(name):
    """Isometric force at any excitation and angle is the same in every model."""
    forces = {}
    for kind in ("hill", name):
        model = mjhill.load("elbow", muscle=kind)
        data = mujoco.MjData(model)
        with mjhill.installed():
            for angle in (0.4, 1.2, 2.0):
                for u in (0.0, 0.3, 1.0):
                    data.qpos[0], data.ctrl[:] = angle, u
                    mjhill.equilibrate(model, data)
                    mujoco.mj_forward(model, data)
                    forces.setdefault((angle, u), []).append(data.actuator_force.copy())
    # bonds are in bins, or their distribution is taken to be Gaussian, which is not quite so
    off = {"dm": 1e-3, "huxley": 2e-3}.get(name, 1e-12)
    peaks = [mjhill.JOINTS["elbow"].muscles[m].max_isometric_force for m in MUSCLES]
    for pair in forces.values():
        assert (np.abs(pair[0] - pair[-1]) <= off * np.array(peaks)).all()


def test_a_rigid_muscle_has_the_force_of_its_contractile_element():
    muscle = mjhill.JOINTS["elbow"].with_muscles("hill-rigid").muscles["elbow_flexor"]
    peak = muscle.max_isometric_force

    def force(velocity, a=1.0, length=muscle.optimal_length):
        model = hill_rigid.MODEL
        return model.ask(model.tension, muscle, a=a, length=length, length_rate=-velocity)

    assert force(0.0) == pytest.approx(peak)
    assert force(muscle.max_velocity) == 0.0
    assert force(2 * muscle.max_velocity) == 0.0
    # Hill's relation at half of V_max
    half = muscle.hill_shape * 0.5 / (muscle.hill_shape + 0.5) - 0.5 * muscle.viscosity
    assert force(0.5 * muscle.max_velocity) == pytest.approx(peak * half)
    fast = force(-muscle.max_velocity)
    assert peak < fast < peak * (muscle.eccentric_plateau + muscle.viscosity)


def test_the_same_muscles_move_a_joint_otherwise_without_a_series_element():
    angles = {}
    for name in ("hill", "hill-rigid"):
        model = mjhill.load("elbow", muscle=name)
        with mjhill.installed():
            run = mjhill.record(model, mjhill.at_home(model), duration=0.4, excitation=MOVEMENT)
        angles[name] = run["elbow.angle"]
    # the series element takes up some of the shortening, so a rigid muscle is sooner there
    moved = {name: np.argmax(angle > angle[0] + 0.1) for name, angle in angles.items()}
    assert moved["hill-rigid"] < moved["hill"]


def test_muscles_of_several_models_live_in_one_model():
    joint = mjhill.JOINTS["elbow"]
    flexor, extensor = joint.muscles
    rigid = joint.with_muscles("hill-rigid").muscles
    mixed = dataclasses.replace(joint, muscles={flexor: joint.muscles[flexor],
                                                extensor: rigid[extensor]})  # fmt: skip
    model = joint_spec(mixed).compile()
    mjhill.check_model(model)
    assert [at.model.name for _, at in addresses(model)] == ["hill", "hill-rigid"]
    assert model.na == 5
    states = []
    for backend in ("compiled", "python"):
        with mjhill.installed(backend):
            data = mujoco.MjData(model)
            data.qpos[0] = joint.home_angle
            mjhill.equilibrate(model, data)
            data.ctrl[:] = 0.5, 0.2
            mujoco.mj_step(model, data, 50)
            states.append(np.concatenate((data.qpos, data.act)))
    np.testing.assert_allclose(*states, rtol=1e-10)
    exact = mjhill.reference.simulate(mixed, {flexor: 0.5, extensor: 0.2}, duration=0.05)
    assert states[0][0] == pytest.approx(exact["elbow.angle"][-1], rel=2e-3)


def test_a_fast_joint_with_rigid_muscles_has_a_finding_and_at_the_timestep_it_names_none():
    """MuJoCo takes the viscosity of user actuators explicitly."""
    with pytest.warns(RuntimeWarning, match="joint 'ankle': .* set model.opt.timestep to"):
        model = mjhill.load("ankle", muscle="hill-rigid")
    (finding,) = _findings(model)
    model.opt.timestep = finding.timestep
    assert not _findings(model)


def _findings(model):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return [finding for finding in mjhill.check_model(model) if finding.severe]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("elbow", "hil"), "unknown muscle model 'hil'; there are: hill, hill-rigid, "),
        (("elbow.mjb", "hill-rigid"), "an .mjb cannot change its muscles"),
    ],
)
def test_a_muscle_model_that_does_not_exist_lists_those_that_do(arguments, message, tmp_path):
    model, muscle = arguments
    if model.endswith(".mjb"):
        path = tmp_path / model
        mujoco.mj_saveModel(mjhill.load("elbow"), str(path))
        model = path
    with pytest.raises(ValueError, match=message):
        mjhill.load(model, muscle=muscle)


def test_rigid_muscles_are_not_made_hill_muscles(tmp_path):
    rigid = mjhill.JOINTS["elbow"].with_muscles("hill-rigid")
    with pytest.raises(ValueError, match="of the model 'hill-rigid' cannot be made one of 'hill'"):
        rigid.with_muscles("hill")
    assert rigid.with_muscles("hill-rigid") == rigid
    with pytest.raises(ValueError, match="'elbow_flexor' is a muscle of the model 'hill-rigid'"):
        _ = rigid.hill_muscles


def test_a_muscle_of_no_model_is_refused():
    with pytest.raises(TypeError, match=r"make one of a model, such as mjhill.Hill"):
        mjhill.Muscle(max_isometric_force=1.0)
    spec = joint_spec(mjhill.JOINTS["elbow"])
    with pytest.raises(
        TypeError, match=r"must be one of mjhill.Hill, mjhill.HillRigid, .*, got dict"
    ):
        mjhill.add_muscle(spec, name="x", muscle={}, joint="elbow")


def test_parameters_of_another_model_are_refused():
    model = mjhill.load("elbow")
    rigid = mjhill.JOINTS["elbow"].with_muscles("hill-rigid").muscles["elbow_flexor"]
    with pytest.raises(ValueError, match="'hill' and was given parameters of 'hill-rigid'"):
        mjhill.write_muscle(model, "elbow_flexor", rigid)


def test_a_tag_with_another_number_of_states_is_refused():
    spec = joint_spec(mjhill.JOINTS["elbow"])
    spec.actuators[0].actdim = 2
    with pytest.raises(ValueError, match="model 'hill' but actdim is 2, not 3"):
        mjhill.check_model(spec.compile())


def test_the_tag_of_an_unknown_model_is_named():
    spec = joint_spec(mjhill.JOINTS["elbow"])
    row = np.array(spec.actuators[0].dynprm)
    row[0] = 198799.0
    spec.actuators[0].dynprm = row
    model = spec.compile()
    with pytest.raises(ValueError, match=r"198799.*does not know; there are: 198701 \(hill\)"):
        mjhill.check_model(model)
    assert len(muscle_ids(model)) == 1


def test_a_joint_file_names_the_model_of_a_muscle(tmp_path):
    text = (ROOT / "mjhill" / "joints" / "joints.toml").read_text(encoding="utf-8")
    table = text[text.index("[elbow]") : text.index("[wrist]")]
    head = "[elbow.muscles.elbow_flexor]\n"
    assert head in table
    path = tmp_path / "joints.toml"
    path.write_text(table.replace(head, head + 'model = "hill-rigid"\n'), encoding="utf-8")
    with pytest.raises(ValueError, match=r"elbow_flexor: unknown entry 'series_stretch'"):
        mjhill.read_joints(path)
    path.write_text(table.replace(head, head + 'model = "hil"\n'), encoding="utf-8")
    with pytest.raises(ValueError, match=r"elbow_flexor: model: unknown muscle model 'hil'"):
        mjhill.read_joints(path)
    path.write_text(table.replace(head, head + 'model = "hill"\n'), encoding="utf-8")
    assert mjhill.read_joints(path)["elbow"] == mjhill.JOINTS["elbow"]


def test_an_equation_that_asks_for_what_there_is_not_is_refused():
    def wrong(optimal_lenght):
        return optimal_lenght

    values = {f.name: getattr(hill.MODEL, f.name) for f in dataclasses.fields(MuscleModel)}
    with pytest.raises(TypeError, match="'hill': compliance asks for 'optimal_lenght'; there are"):
        MuscleModel(**{**values, "compliance": wrong})

    def mixed(optimal_length, u):
        return u * optimal_length

    with pytest.raises(TypeError, match="tension must ask for 'u' before any parameter"):
        MuscleModel(**{**values, "tension": mixed})


def test_an_equation_that_cannot_be_compiled_says_what_it_uses():
    def plain(u):
        return float(np.abs(u))

    with pytest.raises(TypeError, match="uses 'np'; it may use numbers, functions"):
        with_callees([plain])


def test_everything_that_is_compiled_counts_for_the_cache(monkeypatch):
    functions = with_callees(compiled_functions())
    assert hill.rates in functions
    assert functions.index(hill.stretch) < functions.index(hill.force)
    before = source_digest()
    used = [f for f in functions if "NEGLIGIBLE" in globals_of(f)]
    monkeypatch.setitem(used[0].__globals__, "NEGLIGIBLE", 0.5)
    assert source_digest() != before


def test_a_new_model_is_a_file_and_a_line(tmp_path):
    unneeded = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "mjhill", tmp_path / "mjhill", ignore=unneeded)
    shutil.copytree(ROOT / "models", tmp_path / "models")
    folder = tmp_path / "mjhill" / "muscles"
    (folder / "cascade.py").write_text(CASCADE)
    page = (ROOT / "docs" / "new_muscle_model.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python file\n(.*?)```", page, re.DOTALL)
    (folder / "direct.py").write_text(example)
    registry, line = folder / "__init__.py", "    hill_rigid.MODEL,\n"
    text = registry.read_text().replace("import dm,", "import cascade, direct, dm,")
    registry.write_text(text.replace(line, f"{line}    cascade.MODEL,\n    direct.MODEL,\n"))
    where = {"PYTHONPATH": str(tmp_path), "MJHILL_CACHE_DIR": str(tmp_path / "cache")}

    def run(*names):
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", RUN, *names],
            cwd=tmp_path, capture_output=True, text=True, env=os.environ | where, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    found = run("cascade", "direct")
    for name, states in (("cascade", 10), ("direct", 4)):
        one = found[name]
        assert one["na"] == states
        assert one["findings"] == 0
        assert one["steady"] == [0.1, 0.3]
        assert one["force"] == pytest.approx(0.3)
        assert one["read"]
        for integrator, most in (("implicitfast", 0.02), ("RK4", 1e-5)):
            runs = one[integrator]
            assert runs["moved"] > 0.1
            assert runs["apart"] < 1e-12
            assert runs["off"] < most * runs["moved"]
            assert runs["gap"] < 0.01
    # an equation that changes never meets the code of before
    (folder / "cascade.py").write_text(CASCADE.replace("GAIN = 1.0", "GAIN = 0.5"))
    changed = run("cascade")
    assert changed["cascade"]["force"] == pytest.approx(0.15)
    assert (found["cached"], changed["cached"]) == (1, 2)


def test_equations_of_scalar_models_take_and_give_plain_floats():
    for model in (model for model in mjhill.MODELS if not model.bins):
        assert not {"states", "state_rates"} & set(arguments(model.rates))


@pytest.mark.parametrize("name", NAMES)
def test_a_model_is_filmed(name):
    model = mjhill.load("elbow", muscle=name)
    with mjhill.installed():
        run = mjhill.record(model, mjhill.at_home(model), duration=0.2, excitation=MOVEMENT)
    first, *_, last = mjhill.frames(mjhill.View(model, run), fps=10, size=(320, 180))
    assert (first != last).any()


def command(*arguments):
    return CliRunner().invoke(main, arguments)


def test_commands_take_a_muscle_model(tmp_path):
    shown = command("info", "elbow", "--muscle", "hill-rigid", "--json")
    assert shown.exit_code == 0, shown.output
    parameters = {row["parameter"] for row in json.loads(shown.stdout)}
    assert "hill_shape" in parameters
    assert "series_stretch" not in parameters
    xml = command("info", "elbow", "--muscle", "hill-rigid", "--mjcf").stdout
    assert 'actdim="2"' in xml
    path = tmp_path / "run.csv"
    ran = command("run", "elbow", "--muscle", "hill-rigid", "-d", "0.1", "-o", str(path))
    assert ran.exit_code == 0, ran.output
    assert "elbow_flexor.stretch" not in mjhill.Recording.load(path).series
    for name in ("run", "video", "compare", "info"):
        refused = command(name, "elbow", "--muscle", "hil")
        assert refused.exit_code == 2
        assert "unknown muscle model 'hil'; there are: hill, hill-rigid, " in refused.stderr
