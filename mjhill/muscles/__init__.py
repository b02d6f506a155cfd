"""Muscle models: one file each, one line each in ``MODELS``."""

from __future__ import annotations

from mjhill.muscles import dm, hill, hill_linear, hill_rigid, huxley
from mjhill.muscles.model import Muscle as Muscle
from mjhill.muscles.model import MuscleModel as MuscleModel
from mjhill.muscles.model import OperatingPoint as OperatingPoint
from mjhill.muscles.parts import Contractile

MODELS: tuple[MuscleModel, ...] = (
    hill.MODEL,
    hill_rigid.MODEL,
    hill_linear.MODEL,
    dm.MODEL,
    huxley.MODEL,
)

BY_TAG = {model.tag: model for model in MODELS}
TAGS = (198700.0, 198800.0)  # where those of mjhill are

_HOME = OperatingPoint()
_BY_NAME = {model.name: model for model in MODELS}
_BY_PARAMETERS = {model.parameters: model for model in MODELS}


def muscle_model(name: str) -> MuscleModel:
    """A muscle model by its name.

    Raises:
        ValueError: There is none of this name; the message lists those there are.
    """
    if name not in _BY_NAME:
        raise ValueError(f"unknown muscle model {name!r}; there are: {', '.join(_BY_NAME)}")
    return _BY_NAME[name]


def model_of(muscle: Muscle) -> MuscleModel:
    """The model whose parameters an object holds.

    Raises:
        TypeError: It is no muscle of any model.
    """
    if type(muscle) not in _BY_PARAMETERS:
        known = ", ".join(f"mjhill.{kind.__name__}" for kind in _BY_PARAMETERS)
        raise TypeError(f"a muscle must be one of {known}, got {type(muscle).__name__}")
    return _BY_PARAMETERS[type(muscle)]


def steady_states(muscle: Muscle, u: float, length: float) -> list[float]:
    """States of a muscle at rest, in the order in which ``act`` holds them.

    Args:
        muscle: The muscle.
        u: Its excitation [-].
        length: Its length, less that at ``qpos0`` [rad or m].
    """
    model = model_of(muscle)
    return [float(value) for value in model.ask(model.steady, muscle, u=u, length=length)]


def steady_tension(muscle: Muscle, u: float, length: float) -> float:
    """Tension [N·m or N] of a muscle at rest; arguments as for ``steady_states``."""
    model = model_of(muscle)
    states = steady_states(muscle, u, length)
    context: dict[str, object] = dict(zip(model.state_names, states, strict=False))
    context |= {"u": u, "length": length, "length_rate": 0.0, "states": states}
    return float(model.ask(model.tension, muscle, **context))


def hill_of(muscle: Muscle) -> hill.Hill:
    """A muscle, for what needs one of the model ``hill``.

    Raises:
        ValueError: It is of another model.
    """
    if not isinstance(muscle, hill.Hill):
        raise ValueError(
            f"a muscle of the model {model_of(muscle).name!r} was given, and this needs one of the "
            "model 'hill'"
        )
    return muscle


def contractile_of(muscle: Muscle) -> Contractile:
    """A muscle, for what needs one with Hill's contractile element.

    Raises:
        ValueError: It has none.
    """
    if not isinstance(muscle, Contractile):
        raise ValueError(
            f"a muscle of the model {model_of(muscle).name!r} was given, and this needs one with "
            "Hill's contractile element"
        )
    return muscle


def convert(muscle: Muscle, name: str, at: OperatingPoint = _HOME) -> Muscle:
    """A muscle as one of another model, its linear elements, if any, about an operating point.

    Raises:
        ValueError: There is no model of this name, or the muscle is not of the model ``hill``,
            from which others are made.
    """
    model = muscle_model(name)
    if type(muscle) is model.parameters:
        return muscle
    if not isinstance(muscle, hill.Hill):
        raise ValueError(
            f"a muscle of the model {model_of(muscle).name!r} cannot be made one of {name!r}; "
            "start from mjhill.Hill"
        )
    return model.from_hill(muscle, at)
