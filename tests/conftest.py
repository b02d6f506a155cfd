import ctypes

import mujoco
import pytest

import mjhill
from mjhill.callbacks.structs import mujoco_library

CALLBACKS = ("mjcb_act_dyn", "mjcb_act_bias", "mjcb_passive")

PAIR_XML = """
<mujoco model="pair">
  <compiler angle="radian"/>
  <option timestep="0.001" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="elbow" axis="0 1 0" damping="1.2" stiffness="3.4" springref="1.396"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.06 0.06 0.06"/>
    </body>
  </worldbody>
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


@pytest.fixture
def elbow() -> mjhill.Joint:
    return mjhill.JOINTS["elbow"]


@pytest.fixture
def muscle(elbow: mjhill.Joint) -> mjhill.Muscle:
    return elbow.muscles["elbow_flexor"]


def pair_spec(joint: mjhill.Joint) -> mujoco.MjSpec:
    """The smallest model of a joint: one body, one hinge, two muscles, passive elasticity."""
    spec = mujoco.MjSpec.from_string(PAIR_XML)
    for name, parameters in joint.muscles.items():
        mjhill.add_muscle(spec, name=name, muscle=parameters, joint="elbow", gear=joint.gears[name])
    mjhill.add_passive(spec, joint="elbow", passive=joint.passive)
    return spec


@pytest.fixture
def pair(elbow: mjhill.Joint) -> mujoco.MjModel:
    return pair_spec(elbow).compile()


def rest(model: mujoco.MjModel, angle: float = 0.6283, **excitation: float) -> mujoco.MjData:
    """Data at an angle, still, with steady muscles."""
    data = mujoco.MjData(model)
    data.qpos[0] = angle
    for name, u in excitation.items():
        data.actuator(name).ctrl = u
    mjhill.equilibrate(model, data)
    return data
