import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from screen import open_screen

import mjhill

ROOT = Path(__file__).parent.parent

RUN = """
m = mujoco.MjModel.from_xml_path({path!r})
d = mujoco.MjData(m)
d.ctrl[0] = 0.5
mujoco.mj_step(m, d, nstep=200)
print(d.qpos[0].hex(), d.act[2].hex())
"""


PLAIN = "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>"


def python(code, **environment):
    """What a process of its own prints: standard output and standard error."""
    kept = {k: v for k, v in os.environ.items() if k != "MJHILL_AUTOLOAD"}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True, text=True, env=kept | environment, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.strip(), done.stderr.strip()


@pytest.fixture(scope="module")
def elbow():
    return str(mjhill.model_path("elbow"))


@pytest.fixture(scope="module")
def expected(elbow):
    run, _ = python(
        f"import mujoco, mjhill\nwith mjhill.installed():{textwrap.indent(RUN, ' ')}".format(
            path=elbow
        ),
        MJHILL_AUTOLOAD="0",
    )
    return run


@pytest.mark.parametrize(
    "first",
    [
        "import mujoco",
        "import mujoco, mjhill",
        "import mjhill, mujoco",
        "import mjhill.engine.layout, mujoco",
        "import mujoco.rollout",
    ],
)
def test_a_process_that_never_installs_has_the_muscle(elbow, expected, first):
    assert python(first + RUN.format(path=elbow)) == (expected, "")


def test_it_can_be_switched_off(elbow, expected):
    limp, _ = python("import mujoco" + RUN.format(path=elbow), MJHILL_AUTOLOAD="0")
    assert limp != expected
    assert limp.endswith("0x0.0p+0")


def test_import_is_light_and_a_model_without_muscles_compiles_nothing():
    code = """
    import mujoco, sys
    heavy = {
        "llvmlite", "numba", "scipy", "matplotlib", "mujoco.introspect", "mjhill.draw",
    }
    print(sorted(heavy & set(sys.modules)))
    m = mujoco.MjModel.from_xml_string(PLAIN)
    d = mujoco.MjData(m)
    from mjhill.engine.callbacks import PROCESS
    for steps in (500, 1000):
        mujoco.mj_step(m, d, nstep=steps)
        print("numba" in sys.modules, [len(PROCESS.automatic[name]) for name in PROCESS.automatic])
    """
    lines = python(code.replace("PLAIN", repr(PLAIN)))[0].split("\n")
    # after a while C code takes the place of Python in the passive callback
    assert lines == ["[]", "False [1, 1, 1]", "False [1, 1, 2]"]


def test_passive_elasticity_alone_works_too(elbow):
    code = f"""
    import mujoco
    spec = mujoco.MjSpec.from_file({elbow!r})
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for key in list(spec.keys):
        spec.delete(key)
    m = spec.compile()
    d = mujoco.MjData(m)
    d.qpos[0] = 2.9
    mujoco.mj_forward(m, d)
    print(d.qfrc_passive[0].hex())
    """
    installed = code.replace("import mujoco\n", "import mujoco, mjhill\n    mjhill.install()\n")
    assert python(code) == python(installed, MJHILL_AUTOLOAD="0")


def test_rollout_and_batch_on_threads_have_the_muscle(elbow):
    code = f"""
    import mujoco, mujoco.batch, mujoco.rollout, numpy as np
    m = mujoco.MjModel.from_xml_path({elbow!r})
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    data = [mujoco.MjData(m) for _ in range(2)]
    start = np.empty(mujoco.mj_stateSize(m, full))
    mujoco.mj_getState(m, data[0], start, full)
    states, _ = mujoco.rollout.rollout(
        m, data, np.tile(start, (8, 1)), np.full((8, 100, 2), 0.3))
    batch = mujoco.batch.Batch(m, nsim=4)
    batch.ctrl[:] = 0.3
    batch.step(nstep=100)
    print(set(states[:, -1, 1].tolist()) == set(batch.qpos[:, 0].tolist()), states[0, -1, 1] != 0)
    """
    assert python(code) == ("True True", "")


def test_the_passive_viewer_has_the_muscle(elbow, expected):
    code = f"""
    import mujoco, mujoco.viewer, threading
    m = mujoco.MjModel.from_xml_path({elbow!r})
    d = mujoco.MjData(m)
    with mujoco.viewer.launch_passive(m, d) as viewer:
        d.ctrl[0] = 0.5
        viewer.sync()
        for _ in range(200):
            mujoco.mj_step(m, d)
            viewer.sync()
    print(d.qpos[0].hex(), d.act[2].hex())
    # a process that ends before its window is closed may crash, without mjhill too
    [t.join(60) for t in threading.enumerate() if t is not threading.main_thread()]
    """
    with open_screen() as screen:
        display = screen.environment["DISPLAY"]
        assert python(code, DISPLAY=display) == (expected, "")


def test_spawned_workers_give_the_result_of_one_process_bit_for_bit(tmp_path):
    pytest.importorskip("gymnasium")
    (tmp_path / "arm.py").write_text(
        textwrap.dedent(
            f"""
            import gymnasium, mujoco, numpy as np

            class Arm(gymnasium.Env):
                observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (1,), np.float64)
                action_space = gymnasium.spaces.Box(0, 1, (2,), np.float64)

                def __init__(self):
                    self.model = mujoco.MjModel.from_xml_path({str(mjhill.model_path("elbow"))!r})
                    self.data = mujoco.MjData(self.model)

                def reset(self, seed=None, options=None):
                    mujoco.mj_resetData(self.model, self.data)
                    return self.data.qpos.copy(), {{}}

                def step(self, action):
                    self.data.ctrl[:] = action
                    mujoco.mj_step(self.model, self.data, nstep=10)
                    return self.data.qpos.copy(), 0.0, False, False, {{}}

            if __name__ == "__main__":
                actions = np.random.default_rng(1).uniform(0, 1, (20, 2, 2))
                ends = []
                for vector in (
                    gymnasium.vector.AsyncVectorEnv([Arm, Arm], context="spawn"),
                    gymnasium.vector.SyncVectorEnv([Arm, Arm]),
                ):
                    vector.reset()
                    for action in actions:
                        seen = vector.step(action)[0]
                    ends.append(seen.tobytes())
                    vector.close()
                print(ends[0] == ends[1], abs(seen).min() > 0)
            """
        )
    )
    kept = {k: v for k, v in os.environ.items() if k != "MJHILL_AUTOLOAD"}
    done = subprocess.run(
        [sys.executable, "arm.py"], cwd=tmp_path, env=kept, capture_output=True, text=True,
        check=False, timeout=300,
    )  # fmt: skip
    assert done.stdout.strip() == "True True", done.stderr


@pytest.mark.parametrize("package", ["llvmlite", "platformdirs"])
def test_a_muscle_that_cannot_run_says_so_and_is_not_limp(elbow, tmp_path, package):
    (tmp_path / package).mkdir()
    (tmp_path / package / "__init__.py").write_text("raise ImportError('not to be had')")
    code = f"""
    import mujoco
    plain = mujoco.MjModel.from_xml_string({PLAIN!r})
    mujoco.mj_step(plain, mujoco.MjData(plain), nstep=1100)
    m = mujoco.MjModel.from_xml_path({elbow!r})
    d = mujoco.MjData(m)
    mujoco.mj_forward(m, d)
    print(d.actuator_force[0])
    """
    out, error = python(code, PYTHONPATH=f"{tmp_path}:{ROOT}")
    assert out == "nan"
    assert error == "mjhill: the muscle cannot run, its forces are not numbers: not to be had"


def test_a_mujoco_that_cannot_be_read_is_named_once_and_other_models_run(elbow):
    code = f"""
    import mujoco
    from mujoco.introspect.structs import STRUCTS
    fields = STRUCTS["mjModel"].fields
    STRUCTS["mjModel"].__dict__["fields"] = fields[1:]  # as if one had gone
    plain = mujoco.MjModel.from_xml_string({PLAIN!r})
    d = mujoco.MjData(plain)
    mujoco.mj_step(plain, d, nstep=1100)
    print(d.time)
    m = mujoco.MjModel.from_xml_path({elbow!r})
    d = mujoco.MjData(m)
    mujoco.mj_forward(m, d)
    print(d.actuator_force[0])
    """
    out, error = python(code)
    time, force = out.split()
    assert (float(time), force) == (pytest.approx(2.2), "nan")
    (line,) = error.splitlines()
    assert "keeps mjModel.opt.timestep elsewhere than its" in line


BROKEN = {
    "a module fails": ("engine/callbacks.py", "raise ImportError('broken')\n", "broken"),
    "a symbol is missing": ("engine/callbacks.py", "NAMES += ('none',)\n", "mjcb_none"),
    "it stops half way": (
        "engine/autoload.py", "def _address(f):\n    raise OSError('half way')\n", "half way",
    ),
    "a package is half removed": ("engine/autoload.py", None, "mjhill.engine.autoload"),
}  # fmt: skip


@pytest.mark.parametrize(("file", "added", "reason"), BROKEN.values(), ids=BROKEN)
def test_an_error_is_a_warning_and_leaves_mujoco_as_it_was(tmp_path, file, added, reason):
    shutil.copytree(ROOT / "mjhill", tmp_path / "mjhill")
    path = tmp_path / "mjhill" / file
    if added is None:
        path.unlink()
    else:
        path.write_text(path.read_text() + added)
    code = f"""
    import ctypes, mujoco
    from mujoco import _functions
    library = ctypes.CDLL(_functions.__file__)
    for name in ("act_dyn", "act_bias", "passive"):
        print(ctypes.c_void_p.in_dll(library, f"mjcb_{{name}}").value)
    m = mujoco.MjModel.from_xml_string({PLAIN!r})
    d = mujoco.MjData(m)
    mujoco.mj_step(m, d)
    print(d.time)
    """
    out, error = python(code, PYTHONPATH=str(tmp_path))
    assert out.split() == ["None", "None", "None", "0.002"]
    assert "RuntimeWarning: Failed to load mujoco plugin entry point mjhill: " in error
    assert reason in error
    out, error = python(code, PYTHONPATH=str(tmp_path), PYTHONWARNINGS="error")
    assert (out.split(), error) == (["None", "None", "None", "0.002"], "")


def test_installing_over_it_and_undoing_that_adds_nothing_twice(elbow, expected):
    code = "import mujoco, mjhill\nprint(mjhill.installed_backend())\n"
    for backend in ("compiled", "python"):
        code += f"with mjhill.installed({backend!r}):\n"
        code += " m = mjhill.load('elbow')\n print(mjhill.installed_backend())\n"
        code += " d = mujoco.MjData(m); d.qpos[0] = 2.9; mujoco.mj_forward(m, d)\n"
        code += " print(d.qfrc_passive[0])\n"
    out, _ = python(code + RUN.format(path=elbow))
    lines = out.split("\n")
    assert lines[:2] == ["compiled", "compiled"]
    assert lines[3] == "python"
    assert float(lines[2]) == pytest.approx(float(lines[4]), rel=1e-12)
    assert lines[5] == expected


def test_a_recording_needs_no_installation_but_refuses_where_the_callbacks_were_replaced():
    code = """
    import mujoco, mjhill
    m = mjhill.load("elbow")
    run = mjhill.record(m, mjhill.at_home(m), duration=0.01)
    print(run.about["backend"])
    mujoco.set_mjcb_passive(None)
    try:
        mjhill.record(m, mjhill.at_home(m), duration=0.01)
    except RuntimeError as error:
        print(error)
    """
    lines = python(code)[0].split("\n")
    assert lines[0] == "compiled"
    assert "no callbacks are installed" in lines[1]


@pytest.mark.parametrize("automatic", ["0", "1"])
@pytest.mark.parametrize(
    "again",
    [
        "import importlib; importlib.reload(sys.modules['mjhill.engine.install'])",
        "[sys.modules.pop(k) for k in list(sys.modules) if k.startswith('mjhill')]",
    ],
)
def test_code_outlives_a_reload_of_the_modules(elbow, expected, again, automatic):
    code = f"""
    import gc, sys, mujoco, mjhill
    mjhill.install()
    m = mjhill.load("elbow")
    d = mujoco.MjData(m)
    mujoco.mj_step(m, d)
    {again}
    del mjhill
    gc.collect()
    import mjhill
    mujoco.mj_step(m, d)
    mjhill.install()
    """
    out, _ = python(
        textwrap.dedent(code) + RUN.format(path=elbow) + "print(mjhill.installed_backend())",
        MJHILL_AUTOLOAD=automatic,
    )
    assert out.split("\n") == [expected, "compiled"]


def test_a_fork_while_another_thread_installs_is_no_deadlock():
    code = """
    import os, threading, mjhill
    stop = threading.Event()
    def work():
        while not stop.is_set():
            with mjhill.installed():
                pass
    with mjhill.installed():
        pass
    thread = threading.Thread(target=work)
    thread.start()
    for _ in range(100):
        child = os.fork()
        if child == 0:
            with mjhill.installed():
                os._exit(0)
        assert os.waitpid(child, 0)[1] == 0
    stop.set()
    thread.join()
    print("done")
    """
    assert python(code, PYTHONWARNINGS="ignore")[0] == "done"


@pytest.mark.parametrize("automatic", ["0", "1"])
def test_threads_with_a_back_end_each_step_side_by_side(automatic):
    code = """
    import sys, threading, time, mujoco, mjhill
    models = {backend: mjhill.load("elbow") for backend in ("compiled", "python")}
    with mjhill.installed():
        pass
    errors, ends = [], set()
    sys.setswitchinterval(1e-5)  # what may happen between two instructions, happens
    end = time.monotonic() + 1.5
    def work(backend):
        try:
            while time.monotonic() < end:
                data = mujoco.MjData(models[backend])
                data.ctrl[:] = [0.5, 0.2]
                for _ in range(10):
                    with mjhill.installed(backend):
                        mujoco.mj_step(models[backend], data)
                        mujoco.mj_step(models[backend], data)
                ends.add(round(float(data.qpos[0]), 12))
        except Exception as error:
            errors.append(error)
    threads = [threading.Thread(target=work, args=(backend,)) for backend in models]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    print(errors, len(ends))  # the same movement, whichever back-end took which step
    """
    assert python(code, MJHILL_AUTOLOAD=automatic) == ("[] 1", "")
