"""The result of an experiment: measures, verdicts on the paper's claims, a figure, a film."""

from __future__ import annotations

import abc
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any, ClassVar

from mjhill.simulate.recording import Recording


def spoken(text: str) -> str:
    """A text with its identifiers as words: ``elbow flexor``. ``V_max`` stays as it is."""
    return re.sub(r"(?<=[a-z0-9])_(?=[a-z0-9])", " ", text)


@dataclass(frozen=True)
class Measure:
    """A measured quantity, with the published one where there is one.

    People read name and note, so their identifiers become words, see ``spoken``.

    Attributes:
        name: What it is, such as ``time to peak of the dorsiflexor's twitch``.
        value: The measured value; None where it could not be measured.
        unit: Its unit.
        published: Lower and upper end of the published values; equal for a single number.
        source: Source of the published values; ``paper`` for Winters & Stark (1987).
        note: Why there is no value, or what the reader should know about it.
    """

    name: str
    value: float | None
    unit: str
    published: tuple[float, float] | None = None
    source: str = ""
    note: str = ""

    def __post_init__(self) -> None:
        """Turn identifiers into words."""
        object.__setattr__(self, "name", spoken(self.name))
        object.__setattr__(self, "note", spoken(self.note))


@dataclass(frozen=True)
class Claim:
    """A claim of the paper and the experiment's verdict on it.

    Attributes:
        sentence: The claim, in one sentence.
        section: Where the paper makes it, such as ``4.1.3, Fig. 6``.
        holds: Whether the experiment confirms it; None where it cannot decide.
        evidence: The numbers that decide, with units; identifiers become words, see ``spoken``.
    """

    sentence: str
    section: str
    holds: bool | None
    evidence: str

    def __post_init__(self) -> None:
        """Turn identifiers into words."""
        object.__setattr__(self, "evidence", spoken(self.evidence))


class Result(abc.ABC):
    """The result of one experiment on one joint. Each experiment has its own frozen dataclass.

    Attributes:
        title: Heading in the report, such as ``Isometric twitch``.
        section: Section of the paper, such as ``4.1.1, Fig. 5a``.
        size: Width and height of the figure [inch].
        joint: Name of the joint.
        recordings: Recorded runs by a short description, for a closer look.
    """

    title: ClassVar[str]
    section: ClassVar[str]
    size: ClassVar[tuple[float, float]] = (9.0, 4.0)
    joint: str
    recordings: Mapping[str, Recording] = MappingProxyType({})

    @abc.abstractmethod
    def measures(self) -> Iterator[Measure]:
        """The measured quantities."""

    @abc.abstractmethod
    def claims(self) -> Iterator[Claim]:
        """The paper's claims, each with a verdict from the numbers."""

    @abc.abstractmethod
    def draw(self, figure: Any) -> None:
        """Draw the paper's figure into a Matplotlib figure of ``size``."""

    def film(self) -> Recording | None:
        """A run that is worth a film, or None; its names are those of the joint's model."""
        return None

    def as_dict(self) -> dict[str, Any]:
        """All measures and claims, ready for JSON."""
        return {
            "title": self.title,
            "section": self.section,
            "joint": self.joint,
            "measures": [asdict(measure) for measure in self.measures()],
            "claims": [asdict(claim) for claim in self.claims()],
        }
