"""Experiments on a joint: what a laboratory does to a joint, done to its model.

``mjhill.experiments.twitch("ankle")`` and the others run an experiment of the paper through MuJoCo.
They return what was measured, the paper's claims with what decides them, and a figure; see
``Result``.
"""

from typing import TYPE_CHECKING, Any

# all here and now: a function and its module have the same name, and the function must win
from mjhill.experiments.external_impulse import external_impulse as external_impulse
from mjhill.experiments.external_sinusoid import external_sinusoid as external_sinusoid
from mjhill.experiments.free_pulse import free_pulse as free_pulse
from mjhill.experiments.isotonic import isotonic as isotonic
from mjhill.experiments.isovelocity import isovelocity as isovelocity
from mjhill.experiments.lengthening import lengthening as lengthening
from mjhill.experiments.neural_sinusoid import neural_sinusoid as neural_sinusoid
from mjhill.experiments.result import Claim as Claim
from mjhill.experiments.result import Measure as Measure
from mjhill.experiments.result import Result as Result
from mjhill.experiments.spring_release import spring_release as spring_release
from mjhill.experiments.step import step as step
from mjhill.experiments.synergists import synergists as synergists
from mjhill.experiments.tetanus import tetanus as tetanus
from mjhill.experiments.twitch import twitch as twitch

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

if not TYPE_CHECKING:  # a type checker finds unknown names by itself

    def __getattr__(name: str) -> Any:
        raise AttributeError(f"no experiment {name!r}; there are: {', '.join(NAMES)}")
