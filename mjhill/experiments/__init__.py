"""Experiments on a joint: what a laboratory does to it, done to its model.

``mjhill.experiments.twitch("ankle")`` and its like run an experiment of the paper through MuJoCo
and return what was measured, what the paper says of it and a figure; see ``Result``.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mjhill.experiments.external_impulse import external_impulse as external_impulse
from mjhill.experiments.external_sinusoid import external_sinusoid as external_sinusoid
from mjhill.experiments.free_pulse import free_pulse as free_pulse
from mjhill.experiments.isotonic import isotonic as isotonic
from mjhill.experiments.neural_sinusoid import neural_sinusoid as neural_sinusoid
from mjhill.experiments.result import Claim as Claim
from mjhill.experiments.result import Measure as Measure
from mjhill.experiments.result import Result as Result
from mjhill.experiments.spring_release import spring_release as spring_release

if TYPE_CHECKING:
    from mjhill.experiments.paper.isovelocity import isovelocity as isovelocity
    from mjhill.experiments.paper.lengthening import lengthening as lengthening
    from mjhill.experiments.paper.step import step as step
    from mjhill.experiments.paper.synergists import synergists as synergists
    from mjhill.experiments.paper.tetanus import tetanus as tetanus
    from mjhill.experiments.paper.twitch import twitch as twitch

NAMES = (
    "synergists",
    "twitch",
    "tetanus",
    "isovelocity",
    "lengthening",
    "step",
    "free_pulse",
    "isotonic",
    "neural_sinusoid",
    "external_impulse",
    "spring_release",
    "external_sinusoid",
)


def __getattr__(name: str) -> Any:
    # an experiment is imported when it is asked for: some read what others are made of
    if name in NAMES:
        return getattr(import_module(f"mjhill.experiments.paper.{name}"), name)
    raise AttributeError(f"no experiment {name!r}; there are: {', '.join(NAMES)}")
