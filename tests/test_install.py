import ctypes
import os
import subprocess
import sys

import mujoco
import mujoco.batch
import numpy as np
import pytest
from conftest import raw_callbacks, rest

import mjhill
from mjhill.engine.spec import joint_spec
from mjhill.engine.structs import offset, verify

ACTUATOR = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)
GENERIC = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
BACKENDS = ["python", "compiled"]


@pytest.fixture
def mixed(elbow):
    """The pair and a foreign user actuator with one state."""
    spec = joint_spec(elbow)
    spec.add_actuator(
        name="foreign", target="elbow", trntype=mujoco.mjtTrn.mjTRN_JOINT,
        dyntype=mujoco.mjtDyn.mjDYN_USER, gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_USER, lengthrange=[-1, 1],
    )  # fmt: skip
    return spec.compile()


@pytest.mark.parametrize("backend", BACKENDS)
def test_installed_puts_back_what_was_there(pair, backend):
    before = raw_callbacks()
    with mjhill.installed(backend):
        assert mjhill.installed_backend() == backend
        assert raw_callbacks() != before
    assert raw_callbacks() == before


@pytest.mark.parametrize("backend", BACKENDS)
def test_callbacks_are_cleared_after_an_exception(backend):
    with pytest.raises(ZeroDivisionError), mjhill.installed(backend):
        raise ZeroDivisionError
    assert raw_callbacks() == [None, None, None]


@pytest.mark.parametrize("backend", BACKENDS)
def test_python_callbacks_installed_before_go_on_serving_their_actuators(mixed, backend):
    calls = []

    def foreign_dyn(model, data, actuator):
        calls.append(actuator)
        return 3.0

    def foreign_bias(model, data, actuator):
        return 0.25

    def foreign_passive(model, data):
        data.qfrc_passive[0] += 5.0

    mujoco.set_mjcb_act_dyn(foreign_dyn)
    mujoco.set_mjcb_act_bias(foreign_bias)
    mujoco.set_mjcb_passive(foreign_passive)
    before = raw_callbacks()
    data = rest(mixed)
    mujoco.mj_forward(mixed, data)
    passive = data.qfrc_passive[0]
    data.ctrl[0] = 1.0
    with mjhill.installed(backend):
        mujoco.mj_forward(mixed, data)
    assert set(calls) == {0, 1, 2}  # 0 and 1 only before ours stood in front
    assert data.act_dot[-1] == 3.0
    assert data.act_dot[0] > 0
    assert data.actuator_force[2] == 0.25
    assert data.qfrc_passive[0] > passive + 0.1  # ours added to theirs
    assert raw_callbacks() == before
    assert mujoco.get_mjcb_act_dyn() is foreign_dyn
    for name in ("act_dyn", "act_bias", "passive"):
        getattr(mujoco, f"set_mjcb_{name}")(None)


@pytest.mark.parametrize("backend", BACKENDS)
def test_c_callbacks_installed_before_go_on_serving_their_actuators(mixed, backend):
    act_offset = offset("mjData.act_dot")

    @ACTUATOR
    def foreign_dyn(model, data, actuator):
        act_dot = ctypes.c_void_p.from_address(data + act_offset).value
        return 2.0 + 0 * ctypes.c_double.from_address(act_dot).value

    @ACTUATOR
    def foreign_bias(model, data, actuator):
        return -0.5

    mujoco.set_mjcb_act_dyn(foreign_dyn)
    mujoco.set_mjcb_act_bias(foreign_bias)
    before = raw_callbacks()
    data = rest(mixed)
    with mjhill.installed(backend):
        mujoco.mj_forward(mixed, data)
    assert data.act_dot[-1] == 2.0
    assert data.actuator_force[2] == -0.5
    assert raw_callbacks() == before
    for name in ("act_dyn", "act_bias"):
        getattr(mujoco, f"set_mjcb_{name}")(None)


def test_batch_runs_beside_a_c_callback_of_others(mixed):
    foreign = ACTUATOR(lambda model, data, actuator: 1.0)
    mujoco.set_mjcb_act_dyn(foreign)
    with mjhill.installed():
        batch = mujoco.batch.Batch(mixed, nsim=4, nthread=2)
        batch.step(nstep=10)
    np.testing.assert_allclose(batch.act[:, -1], 10 * mixed.opt.timestep)
    mujoco.set_mjcb_act_dyn(None)


@pytest.mark.parametrize("outer", BACKENDS)
@pytest.mark.parametrize("inner", BACKENDS)
def test_installations_nest(mixed, outer, inner):
    data = rest(mixed)
    data.ctrl[0] = 1.0
    with mjhill.installed(outer):
        pointers = raw_callbacks()
        with mjhill.installed(inner):
            assert mjhill.installed_backend() == inner
            mujoco.mj_forward(mixed, data)
            first = data.act_dot.copy()
        assert mjhill.installed_backend() == outer
        assert raw_callbacks() == pointers
        mujoco.mj_forward(mixed, data)
    np.testing.assert_allclose(data.act_dot, first, rtol=1e-12)
    assert first[0] > 0


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_callback_replaced_meanwhile_is_an_error_and_is_restored(backend):
    with (
        pytest.raises(RuntimeError, match="mjcb_act_dyn was replaced while mjhill was installed"),
        mjhill.installed(backend),
    ):
        mujoco.set_mjcb_act_dyn(lambda model, data, actuator: 0.0)
    assert raw_callbacks() == [None, None, None]


def test_a_callback_replaced_meanwhile_is_noticed_before_the_next_run(pair):
    mjhill.install()
    mujoco.set_mjcb_act_bias(None)
    with pytest.raises(RuntimeError, match="mjcb_act_bias was replaced since"):
        mjhill.record(pair, rest(pair), duration=0.01)
    with pytest.raises(RuntimeError, match="mjcb_act_bias was replaced since"):
        mjhill.install()
    with pytest.raises(RuntimeError, match="now removed"):
        mjhill.uninstall()


def test_an_exception_outlives_a_replaced_callback():
    def replace_and_fail():
        with mjhill.installed("python"):
            mujoco.set_mjcb_passive(None)
            raise KeyError("cause")

    with pytest.raises(KeyError) as caught:
        replace_and_fail()
    assert "mjcb_passive was replaced" in caught.value.__notes__[0]
    assert raw_callbacks() == [None, None, None]


def test_an_unknown_back_end_lists_the_known_ones():
    with pytest.raises(ValueError, match="backend must be 'compiled' or 'python', got 'gpu'"):
        mjhill.install("gpu")


def test_uninstalling_what_is_not_installed_is_an_error():
    with pytest.raises(RuntimeError, match="not installed"):
        mjhill.uninstall()


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_model_loads_while_callbacks_are_installed(backend):
    with mjhill.installed(backend):
        pointers = raw_callbacks()
        model = mjhill.load("elbow")
        assert raw_callbacks() == pointers
    assert mjhill.muscle_names(model) == ["elbow_flexor", "elbow_extensor"]


def test_offsets_that_do_not_fit_memory_are_an_error(pair, monkeypatch):
    verify(pair, mujoco.MjData(pair), ["mjModel.opt.timestep", "mjData.act"])
    monkeypatch.setattr("mjhill.engine.structs.offset", lambda path: offset(path) + 8)
    with pytest.raises(RuntimeError, match=r"keeps mjData.act elsewhere .* backend=\"python\""):
        verify(pair, mujoco.MjData(pair), ["mjData.act"])


def test_an_unknown_field_is_an_error():
    with pytest.raises(RuntimeError, match=r"has no mjModel.no_such_field"):
        offset("mjModel.no_such_field")


def test_import_leaves_numba_and_plotting_out():
    code = (
        "import mjhill, sys; heavy = {'numba', 'scipy', 'matplotlib', 'mediapy', 'IPython'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_machine_code_is_kept_and_runs_without_the_compiler(tmp_path):
    code = (
        "import sys, mjhill, mujoco\n"
        "m = mjhill.load('elbow'); d = mujoco.MjData(m)\n"
        "with mjhill.installed():\n d.ctrl[0] = 1; mujoco.mj_step(m, d, nstep=100)\n"
        "print('numba' in sys.modules, d.qpos[0])"
    )

    def run():
        environment = {**os.environ, "MJHILL_CACHE_DIR": str(tmp_path / "cache")}
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            env=environment,
            check=True,
        )
        return done.stdout.split()

    compiled, cached = run(), run()
    (kept,) = (tmp_path / "cache").glob("*.code")
    kept.write_bytes(kept.read_bytes()[:1000])
    damaged, again = run(), run()
    assert [line[0] for line in (compiled, cached, damaged, again)] == [
        "True", "False", "True", "False",
    ]  # fmt: skip
    assert len({line[1] for line in (compiled, cached, damaged, again)}) == 1


def test_a_read_only_home_still_compiles(tmp_path):
    code = (
        "import mjhill, mujoco\n"
        "m = mjhill.load('elbow'); d = mujoco.MjData(m)\n"
        "with mjhill.installed():\n d.ctrl[0] = 1; mujoco.mj_step(m, d, nstep=10)\n"
        "print(d.act[0] > 0)"
    )
    environment = {"PATH": "", "MJHILL_CACHE_DIR": "/proc/no/such/place", "HOME": "/proc/no"}
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=False
    )
    assert run.stdout.strip() == "True", run.stderr


MOVED = """
import dataclasses, sys
import mujoco.introspect.structs as structs
from mujoco.introspect.ast_nodes import StructFieldDecl, ValueType
new = StructFieldDecl(name="new", type=ValueType(name="mjtNum"), doc="")
for name in ("mjModel", "mjData"):
    declared = structs.STRUCTS[name]
    fields = (*declared.fields[:5], new, *declared.fields[5:])
    structs.STRUCTS = {**structs.STRUCTS, name: dataclasses.replace(declared, fields=fields)}
import mujoco, numpy as np
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
print(np.isnan(data.actuator_force).all())
import mjhill
try:
    mjhill.install()
except RuntimeError as error:
    print(error)
mujoco.mj_resetData(model, data)
data.ctrl[:] = 1
with mjhill.installed(backend="python"):
    mujoco.mj_step(model, data, 20)
print(data.actuator_force.min() < -1)
"""


def test_after_an_upgrade_that_moves_a_field_nothing_is_read_and_the_ways_out_are_said():
    environment = {k: v for k, v in os.environ.items() if k != "MJHILL_AUTOLOAD"}
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", MOVED, str(mjhill.model_path("elbow"))],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    not_numbers, told, python_works = run.stdout.splitlines()
    assert (not_numbers, python_works) == ("True", "True")
    for words in (
        f"MuJoCo {mujoco.__version__} keeps mjModel.",
        f"mjhill {mjhill.__version__} cannot run with it",
        "pip install --upgrade mjhill",
        "pip install mujoco==",
        'backend="python"',
    ):
        assert words in told
    assert told in run.stderr  # by a step in a process that did not import mjhill
