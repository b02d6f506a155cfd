"""The experiments of Winters & Stark (1987), simulated on a joint.

``mjhill.experiments.twitch("ankle")`` runs one of them through MuJoCo. It returns what was
measured, verdicts on the paper's claims, and a figure; see ``Result``. The joint is one of
``mjhill.JOINTS`` by name, or a ``Joint``.

Each experiment is one module, and its function has the module's name. The imports below run the
modules first and then put the functions in their place, so that ``mjhill.experiments.twitch`` is
always the function. ``from mjhill.experiments.twitch import Twitch`` reaches the rest of a module.
"""

from typing import TYPE_CHECKING, Any

from mjhill.experiments.isovelocity import isovelocity as isovelocity
from mjhill.experiments.lengthening import lengthening as lengthening
from mjhill.experiments.paper.external_impulse import external_impulse as external_impulse
from mjhill.experiments.paper.external_sinusoid import external_sinusoid as external_sinusoid
from mjhill.experiments.paper.free_pulse import free_pulse as free_pulse
from mjhill.experiments.paper.isotonic import isotonic as isotonic
from mjhill.experiments.paper.neural_sinusoid import neural_sinusoid as neural_sinusoid
from mjhill.experiments.paper.spring_release import spring_release as spring_release
from mjhill.experiments.result import Claim as Claim
from mjhill.experiments.result import Measure as Measure
from mjhill.experiments.result import Result as Result
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
