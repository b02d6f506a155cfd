"""The seam: what a muscle model says about itself, and how everything else asks it.

A model is one file with a ``MuscleModel`` at its end and one line in ``mjhill.muscles``. Its
equations are pure functions of floats. Each names what it needs as its arguments, and the
caller gives it that: the state of the muscle first (see ``CONTEXT``), then parameters by the
names that they have in the parameter class. So the order of the arguments stands in one place,
the function itself; back-ends build their calls from it.

A model with an array of states, such as bonds in bins, has functions that take the array
``states`` and write into the array ``state_rates``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjhill.quantity import check_quantities, freeze, quantity, sources

# what an equation can ask for beside states and parameters:
CONTEXT = (
    "staged",  # whether the integrator is RK4, whose stages each see a state of their own
    "u",  # excitation: the muscle's control, clamped to [0, 1]
    "length",  # actuator length less that at qpos0 [rad or m]
    "length_rate",  # its rate, MuJoCo's actuator velocity [rad/s or m/s]
    "timestep",  # [s]
)
ARRAYS = ("states", "state_rates")  # all states as one array, and their rates
FIRST_SLOT = {"dynprm": 1, "gainprm": 1, "biasprm": 0}  # tag and fixed gain come first
SLOTS = 10  # of each array
STRONGEST = 3.0  # tension that no muscle has [F_max]

Values = NDArray[np.float64]
Equation = Callable[..., Any]


@dataclass(frozen=True, kw_only=True)
class Muscle:
    """Parameters of a muscle, of whichever model; each model has a class of its own.

    On a joint, force is a torque [N·m] and length an angle [rad]; on a tendon, force [N] and
    length [m]. Lengths are MuJoCo's actuator length less its value at ``qpos0``: they grow as
    the muscle is stretched.

    Attributes:
        sources: Where each value comes from, by parameter name.
    """

    max_isometric_force: float = quantity(
        "F_max",
        ("N·m", "N"),
        "isometric force at full activation and optimal length",
        (0, 1e6),
        array="gainprm",
    )
    sources: Mapping[str, str] = sources()

    def __new__(cls, *_args: Any, **_parameters: Any) -> Muscle:
        """Refuse a muscle of no model.

        Raises:
            TypeError: The class is ``Muscle`` itself.
        """
        if cls is Muscle:
            raise TypeError(
                "mjhill.Muscle is what all muscles have in common; make one of a model, such as "
                "mjhill.Hill(...)"
            )
        return super().__new__(cls)

    def __post_init__(self) -> None:
        """Check the bounds.

        Raises:
            ValueError: A parameter is not a finite number inside its bounds.
        """
        check_quantities(self)
        freeze(self, "sources")


@dataclass(frozen=True)
class State:
    """A state of a muscle.

    Attributes:
        name: Its name in the equations.
        unit: ``"-"``, ``"length"`` [rad or m] or another kind of ``units_of``.
        meaning: One phrase.
        share: Whether it is a share, between 0 and 1.
    """

    name: str
    unit: str
    meaning: str
    share: bool = False


@dataclass(frozen=True)
class Track:
    """One muscle over a run, as arrays of shape (T,), from which a model makes its recording.

    Attributes:
        muscle: Its parameters.
        time: Times of the samples [s].
        timestep: Of the simulation [s].
        staged: Whether the integrator is RK4.
        u: Excitation [-].
        states: Its named states.
        state_rates: Their rates, as the callbacks wrote them.
        length: Actuator length less that at ``qpos0`` [rad or m].
        length_rate: Its rate, as MuJoCo has it.
        force: Tension that MuJoCo applies [N·m or N].
        work: Work [J] of a force along a displacement up to each sample.
        power: Mean rate [W] of a work since the sample before, and its first value.
    """

    muscle: Any
    time: Values
    timestep: float
    staged: bool
    u: Values
    states: Mapping[str, Values]
    state_rates: Mapping[str, Values]
    length: Values
    length_rate: Values
    force: Values
    work: Callable[[Values, Values], Values]
    power: Callable[[Values, float], Values]


@dataclass(frozen=True)
class OperatingPoint:
    """A muscle at rest, about which a linear element does as the one whose place it takes.

    Attributes:
        excitation: Steady excitation [-].
        length: Its length, less that at ``qpos0`` [rad or m].
    """

    excitation: float = 0.5
    length: float = 0.0


Series = Iterator[tuple[str, str, Values]]  # quantity, kind of unit, values


def units_of(turns: bool) -> dict[str, str]:
    """Unit of each kind of quantity, for a muscle that turns a hinge, or one that pulls."""
    effort, unit = ("N·m", "rad") if turns else ("N", "m")
    return {
        "-": "-",
        "force": effort,
        "length": unit,
        "rate": f"{unit}/s",
        "stiffness": f"{effort}/{unit}",
        "energy": "J",
        "power": "W",
    }


def same_parameters(kind: type[Muscle]) -> Callable[[Muscle, OperatingPoint], Muscle]:
    """A function that makes a muscle of ``kind`` from another with the parameters of its names."""

    def convert(muscle: Muscle, _at: OperatingPoint) -> Muscle:
        names = {item.name for item in fields(kind)} & {item.name for item in fields(muscle)}
        return kind(**{name: getattr(muscle, name) for name in names})

    return convert


def nothing_lost(_muscle: Any, time: Values, _series: Mapping[str, Values]) -> Values:
    """Energy [J] lost inside a muscle whose contractile element has no viscosity, shape (T,)."""
    return np.zeros(len(time))


def no_time_constants() -> dict[str, Values]:
    """No state follows another with a time constant of its own."""
    return {}


def no_fault(max_isometric_force: float) -> str | None:
    """No state of the muscle is impossible but for the bounds of its shares."""
    return None


@dataclass(frozen=True, kw_only=True, eq=False)
class MuscleModel:
    """Everything that the rest of mjhill asks of a muscle model.

    Equations are functions whose arguments name what they need; ``rates`` and ``force`` are
    compiled, so they and what they call use only floats, ``exp``, ``log`` and ``sqrt``.

    Attributes:
        name: Its name, such as ``hill``.
        tag: ``dynprm[0]`` of its actuators, from 198700 to 198799 and unlike all others.
        meaning: One phrase.
        parameters: Its parameter class. Fields with an ``array`` get their slots in order.
        states: Its named states, the first of ``act``.
        activation: The state that films show as activation.
        bins: The parameter that says how many unnamed states follow; none by default.
        rates: Rates of the states for MuJoCo to advance by a timestep, in the order of ``states``;
            or None, written into ``state_rates``.
        force: Tension [N·m or N], never negative where ``pulls_only``; may ask for
            ``<state>_rate``, just written.
        derivatives: True rates of the states, for the reference solver; as ``rates``.
        tension: True tension at a state.
        steady: States at rest for ``u`` and ``length``.
        series: What a recording shows of it.
        readings: What its elements do at a moment, by name: kind of unit, and equation.
        at_full_force: Stiffness [force/length], rate [1/s] at which it yields to a stretch, and
            viscosity [force·s/length], about rest at full activation; from these follows how long
            a timestep may be.
        lengthening: Largest force that it carries in slow lengthening, and what each unit of
            lengthening rate adds to that.
        compliance: Change of length by which its force goes from 0 to the largest.
        max_velocity: Largest shortening velocity of its contractile element, if it has one.
        from_hill: A muscle of this model that does as a given ``Hill`` muscle, isometrically; its
            linear elements, if it has any, about an operating point.
        time_constants: Time constants [s] of its states by name of the parameter; RK4 cannot follow
            one that is shorter than the timestep.
        fault: What is impossible about states and ``length``, in words, or None.
        viscous_loss: Energy lost inside [J], from what ``series`` gave; see ``nothing_lost``.
        staged: Whether it can follow the stages of RK4; ``check_model`` refuses one that cannot.
        pulls_only: Whether it never pushes.
        sources: Where its equations come from.
    """

    name: str
    tag: float
    meaning: str
    parameters: type[Muscle]
    states: tuple[State, ...]
    rates: Equation
    force: Equation
    derivatives: Equation
    tension: Equation
    steady: Equation
    series: Callable[[Track], Series]
    readings: Mapping[str, tuple[str, Equation]]
    at_full_force: Equation
    lengthening: Equation
    compliance: Equation
    max_velocity: Equation | None
    from_hill: Callable[[Any, OperatingPoint], Muscle]
    sources: str
    activation: str = "a"
    bins: str = ""
    time_constants: Equation = no_time_constants
    fault: Equation = no_fault
    viscous_loss: Callable[..., Values] = nothing_lost
    staged: bool = True
    pulls_only: bool = True

    def __post_init__(self) -> None:
        """Check that every equation asks only for what exists.

        Raises:
            TypeError: An equation names something unknown, or a parameter before a state.
        """
        for name, (_, equation) in self.readings.items():
            self._check_arguments(name, equation)
        for name in ("rates", "force", "derivatives", "tension", "steady", "at_full_force",
                     "lengthening", "compliance", "time_constants", "fault"):  # fmt: skip
            self._check_arguments(name, getattr(self, name))
        self.slots  # noqa: B018 (raises where there are too many)

    def _check_arguments(self, what: str, equation: Equation) -> None:
        context = self.context
        seen_parameter = False
        for argument in arguments(equation):
            is_parameter = argument in self.parameter_names
            if not is_parameter and argument not in context:
                raise TypeError(
                    f"muscle model {self.name!r}: {what} asks for {argument!r}; there are: "
                    f"{', '.join([*context, *self.parameter_names])}"
                )
            if seen_parameter and not is_parameter:
                raise TypeError(
                    f"muscle model {self.name!r}: {what} must ask for {argument!r} before any "
                    "parameter"
                )
            seen_parameter |= is_parameter

    @cached_property
    def context(self) -> tuple[str, ...]:
        """What an equation can ask for that is no parameter."""
        names = self.state_names
        return (*CONTEXT, *ARRAYS, *names, *(f"{name}_rate" for name in names))

    @cached_property
    def state_names(self) -> tuple[str, ...]:
        """Names of the named states."""
        return tuple(state.name for state in self.states)

    @cached_property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters that are in the model, in their order."""
        return tuple(item.name for item in fields(self.parameters) if item.metadata.get("array"))

    @cached_property
    def slots(self) -> dict[str, tuple[str, int]]:
        """Array and index of each parameter.

        Raises:
            TypeError: An array has no room for all of them, or there is no such array.
        """
        free, found = dict(FIRST_SLOT), {}
        for item in fields(self.parameters):
            array = item.metadata.get("array")
            if not array:
                continue
            if array not in free or free[array] == SLOTS:
                raise TypeError(
                    f"muscle model {self.name!r}: no slot for {item.name!r} in {array!r}; there "
                    f"are {SLOTS} in each of {', '.join(FIRST_SLOT)}"
                )
            found[item.name] = array, free[array]
            free[array] += 1
        return found

    def state_count(self, muscle: Muscle) -> int:
        """Number of states of a muscle."""
        return len(self.states) + (round(getattr(muscle, self.bins)) if self.bins else 0)

    def bound(self, equation: Equation, muscle: Muscle, order: tuple[str, ...]) -> Equation:
        """An equation with a muscle's parameters, as a function of ``order``."""
        names = arguments(equation)
        head = [order.index(name) for name in names if name not in self.parameter_names]
        tail = [getattr(muscle, name) for name in names[len(head) :]]
        if head and head == list(range(head[0], head[-1] + 1)):
            part = slice(head[0], head[-1] + 1)
            return lambda *values: equation(*values[part], *tail)
        return lambda *values: equation(*[values[k] for k in head], *tail)

    def ask(self, equation: Equation, muscle: Muscle, **context: Any) -> Any:
        """The value of an equation for a muscle, in a context given by name."""
        return equation(
            *(
                context[name] if name in context else getattr(muscle, name)
                for name in arguments(equation)
            )
        )

    def ask_columns(self, equation: Equation, columns: Mapping[str, Values]) -> Any:
        """The value of an equation of parameters alone, for many muscles at once.

        Args:
            equation: The equation; plain arithmetic.
            columns: Each parameter, shape (number of muscles,).
        """
        return equation(*(columns[name] for name in arguments(equation)))


@lru_cache(maxsize=512)
def arguments(equation: Equation) -> tuple[str, ...]:
    """Names of the arguments of an equation."""
    return tuple(inspect.signature(equation).parameters)
