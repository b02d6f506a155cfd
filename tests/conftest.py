import ctypes
import os
import signal

os.environ["MJHILL_AUTOLOAD"] = "0"  # tests install what they need; test_autoload takes it out

import mujoco
import pytest

import mjhill
import mjhill.identification.facts
from mjhill.engine.callbacks import mujoco_library
from mjhill.engine.spec import joint_spec

# shells start background jobs with Ctrl-C ignored; the processes that tests start must not be
signal.signal(signal.SIGINT, signal.default_int_handler)

CALLBACKS = ("mjcb_act_dyn", "mjcb_act_bias", "mjcb_passive")

PLAIN_XML = """
<mujoco>
  <worldbody><body><joint name="elbow"/><geom size="0.1"/></body></worldbody>
</mujoco>
"""


def raw_callbacks() -> list[int | None]:
    """The C pointers that MuJoCo now calls."""
    library = mujoco_library()
    return [ctypes.c_void_p.in_dll(library, name).value for name in CALLBACKS]


@pytest.fixture(autouse=True)
def _work_in_an_empty_folder(tmp_path, monkeypatch):
    # MuJoCo appends its warnings to a log in the working folder
    monkeypatch.chdir(tmp_path)


@pytest.fixture(autouse=True)
def _callbacks_are_left_as_they_were():
    yield
    left = raw_callbacks()
    for name in CALLBACKS:
        getattr(mujoco, f"set_{name}")(None)
    assert left == [None, None, None]
    assert mjhill.installed_backend() is None


@pytest.fixture(scope="session")
def shipped_facts() -> list[mjhill.identification.facts.Fact]:
    """Every published fact on the joints that come with mjhill; measured once, in about 10 s."""
    return mjhill.identification.facts.facts()


@pytest.fixture
def elbow() -> mjhill.Joint:
    return mjhill.JOINTS["elbow"]


@pytest.fixture
def muscle(elbow: mjhill.Joint) -> mjhill.Hill:
    return elbow.muscles["elbow_flexor"]


@pytest.fixture
def pair(elbow: mjhill.Joint) -> mujoco.MjModel:
    return joint_spec(elbow).compile()


def rest(model: mujoco.MjModel, angle: float = 0.6283, **excitation: float) -> mujoco.MjData:
    """Data at an angle, still, with steady muscles."""
    data = mujoco.MjData(model)
    data.qpos[0] = angle
    for name, u in excitation.items():
        data.actuator(name).ctrl = u
    mjhill.equilibrate(model, data)
    return data
