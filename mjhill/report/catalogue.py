"""The experiments of the paper, in its order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from mjhill.joints.reader import JOINTS

_TABLE_2 = ("elbow", "wrist", "wrist_rotation", "knee", "ankle", "head", "eye")


@dataclass(frozen=True)
class Entry:
    """An experiment of the catalogue.

    Attributes:
        id: Its name on the command line.
        path: Its function, as ``module:name``; the module is imported for the run.
        joints: The joints that it runs on by default.
        filmed: Whether its run is filmed.
        anywhere: Whether it can run on other joints too.
    """

    id: str
    path: str
    joints: tuple[str, ...]
    filmed: bool = False
    anywhere: bool = True

    @property
    def module(self) -> str:
        """Dotted name of the module that holds the function."""
        return self.path.partition(":")[0]

    def function(self) -> Callable[..., Any]:
        """The experiment: takes a joint's name and ``progress``, returns a ``Result``.

        Raises:
            ImportError: There is no such module.
            AttributeError: The module has no such function.
        """
        function: Callable[..., Any] = getattr(
            import_module(self.module), self.path.partition(":")[2]
        )
        return function


@dataclass(frozen=True)
class Part:
    """One experiment on one joint: it is run, kept and shown as a whole."""

    entry: Entry
    joint: str

    @property
    def name(self) -> str:
        """Its name, which is also the stem of its files."""
        return f"{self.entry.id}-{self.joint}"

    @property
    def command(self) -> str:
        """The command that runs this part only."""
        return f"mjhill reproduce --only {self.entry.id} --joint {self.joint}"


def _entry(name: str, *joints: str, filmed: bool = False, anywhere: bool = True) -> Entry:
    return Entry(name, f"mjhill.experiments.{name}:{name}", joints, filmed, anywhere)


CATALOGUE = (
    _entry("synergists", "elbow", anywhere=False),
    _entry("twitch", "ankle"),
    # the four flexion-extension systems of Fig. 5b
    _entry("tetanus", "elbow", "wrist", "knee", "ankle"),
    _entry("isovelocity", "elbow", filmed=True),
    _entry("free_pulse", "elbow", "eye", filmed=True),
    _entry("step", *_TABLE_2, filmed=True),
    _entry("isotonic", "elbow", filmed=True),
    _entry("neural_sinusoid", "elbow", "ankle", filmed=True),
    _entry("external_impulse", "elbow", filmed=True),
    _entry("spring_release", "elbow", filmed=True),
    _entry("external_sinusoid", "elbow", "ankle", filmed=True),
    _entry("lengthening", "elbow", filmed=True),
)


def select(
    catalogue: Sequence[Entry], only: Sequence[str] = (), joints: Sequence[str] = ()
) -> list[Part]:
    """The requested parts, in the order of the catalogue.

    Args:
        catalogue: All experiments.
        only: Ids of the requested experiments; by default all.
        joints: Names of the joints to run on; by default each experiment's own.

    Raises:
        ValueError: There is no such experiment or joint, or a requested experiment cannot run
            on the joints; the message lists what exists.
    """
    known = [entry.id for entry in catalogue]
    for kind, asked, there in (("experiment", only, known), ("joint", joints, list(JOINTS))):
        for name in asked:
            if name not in there:
                raise ValueError(f"unknown {kind} {name!r}; there are: {', '.join(there)}")
    chosen = [entry for entry in catalogue if not only or entry.id in only]
    for entry in chosen:
        if only and joints and not _joints(entry, joints):
            raise ValueError(f"{entry.id} runs on {', '.join(entry.joints)} only")
    return [Part(entry, joint) for entry in chosen for joint in _joints(entry, joints)]


def _joints(entry: Entry, asked: Sequence[str]) -> list[str]:
    wanted = dict.fromkeys(asked or entry.joints)
    return [joint for joint in wanted if entry.anywhere or joint in entry.joints]


def every_part(catalogue: Sequence[Entry]) -> list[Part]:
    """Each experiment on every joint, its own joints first."""
    return [
        Part(entry, joint)
        for entry in catalogue
        for joint in dict.fromkeys((*entry.joints, *JOINTS))
    ]
