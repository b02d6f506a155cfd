"""The models that come with mjhill, and loading of any other."""

from __future__ import annotations

from pathlib import Path

import mujoco

from mjhill.engine.checks import check_model
from mjhill.engine.install import without_python_callbacks
from mjhill.engine.spec import with_muscles
from mjhill.joints.reader import JOINTS
from mjhill.muscles import MODELS, muscle_model

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


def load(model: str | Path, muscle: str | None = None, bins: int | None = None) -> mujoco.MjModel:
    """Load and check a model: the name of a joint that comes with mjhill, or an MJCF or MJB file.

    The joints that come with mjhill have no gravity, as the movements of the paper;
    ``model.opt.gravity[2] = -9.81`` gives them some. Works while callbacks are installed, Python
    ones too.

    Args:
        model: A joint's name, such as ``"elbow"``, or a path that ends in .xml or .mjb.
        muscle: Name of the muscle model that takes the place of ``hill`` in all muscles, such as
            ``"hill-rigid"``; without it they stay as they are in the file.
        bins: Number of bins of muscles that have them, those of the model ``huxley``; by default
            100.

    Raises:
        ValueError: There is no such joint, file or muscle model, MuJoCo cannot compile it, a
            muscle in it is not in order (see ``check_model``), ``muscle`` is given for an .mjb,
            or ``bins`` without a muscle model that has bins.
    """
    if bins is not None and (muscle is None or not muscle_model(muscle).bins):
        having = ", ".join(kind.name for kind in MODELS if kind.bins)
        raise ValueError(
            f"bins = {bins} needs a muscle model with bins, got {muscle!r}; there are: {having}"
        )
    path = Path(model)
    if str(model) in JOINTS:
        path = model_path(str(model))
    elif not path.is_file():
        raise ValueError(
            f"unknown model {str(model)!r}: no file of that name, and the joints are: "
            f"{', '.join(JOINTS)}"
        )
    binary = path.suffix == ".mjb"
    if muscle is not None and binary:
        raise ValueError(f"{path}: an .mjb cannot change its muscles to {muscle!r}; load the .xml")
    with without_python_callbacks():
        if muscle is not None:
            loaded = with_muscles(mujoco.MjSpec.from_file(str(path)), muscle, bins).compile()
        elif binary:
            loaded = mujoco.MjModel.from_binary_path(str(path))
        else:
            loaded = mujoco.MjModel.from_xml_path(str(path))
    check_model(loaded)
    return loaded
