"""The models that come with mjhill, and loading of any other."""

from __future__ import annotations

from pathlib import Path

import mujoco

from mjhill.engine.checks import check_model
from mjhill.engine.install import without_python_callbacks
from mjhill.joints.reader import JOINTS

_PACKAGE = Path(__file__).parent.parent


def model_path(joint: str) -> Path:
    """The MJCF scene of a joint that comes with mjhill.

    Raises:
        ValueError: There is no such joint; the message lists those there are.
    """
    if joint not in JOINTS:
        raise ValueError(f"unknown joint {joint!r}; there are: {', '.join(JOINTS)}")
    # a wheel carries the models inside the package, a checkout beside it
    folder = _PACKAGE / "models" if (_PACKAGE / "models").is_dir() else _PACKAGE.parent / "models"
    return folder / joint / "scene.xml"


def load(model: str | Path) -> mujoco.MjModel:
    """Load and check a model: the name of a joint that comes with mjhill, or an MJCF or MJB file.

    The joints that come with mjhill have no gravity, as the movements of the paper;
    ``model.opt.gravity[2] = -9.81`` gives them some. Works while callbacks are installed, Python
    ones too.

    Args:
        model: A joint's name, such as ``"elbow"``, or a path that ends in .xml or .mjb.

    Raises:
        ValueError: There is no such joint or file, MuJoCo cannot compile it, or a muscle in it
            is not in order; see ``check_model``.
    """
    path = Path(model)
    if str(model) in JOINTS:
        path = model_path(str(model))
    elif not path.is_file():
        raise ValueError(
            f"unknown model {str(model)!r}: no file of that name, and the joints are: "
            f"{', '.join(JOINTS)}"
        )
    with without_python_callbacks():
        binary = path.suffix == ".mjb"
        read = mujoco.MjModel.from_binary_path if binary else mujoco.MjModel.from_xml_path
        loaded = read(str(path))
    check_model(loaded)
    return loaded
