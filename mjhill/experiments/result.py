"""What an experiment gives: measures, the paper's claims decided, a figure, a run to film."""

from __future__ import annotations

import abc
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any, ClassVar

from mjhill.simulate.recording import Recording


def spoken(text: str) -> str:
    """A text with its identifiers in words: ``elbow flexor``; ``V_max`` stays as it is."""
    return re.sub(r"(?<=[a-z0-9])_(?=[a-z0-9])", " ", text)


@dataclass(frozen=True)
class Measure:
    """A measured quantity, beside a published one where there is one.

    Name and note are for people to read: identifiers in them become words, see ``spoken``.

    Attributes:
        name: What it is, such as ``time to peak of the dorsiflexor's twitch``.
        value: As measured; None where it was not seen.
        unit: Its unit.
        published: Lower and upper end of what is published; equal for a single number.
        source: Where that comes from; ``paper`` for Winters & Stark (1987).
        note: Why it was not seen, or what to mind.
    """

    name: str
    value: float | None
    unit: str
    published: tuple[float, float] | None = None
    source: str = ""
    note: str = ""

    def __post_init__(self) -> None:
        """Put identifiers into words."""
        object.__setattr__(self, "name", spoken(self.name))
        object.__setattr__(self, "note", spoken(self.note))


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper and what the experiment says to it.

    Attributes:
        sentence: The claim, in one sentence.
        section: Where the paper makes it, such as ``4.1.3, Fig. 6``.
        holds: Whether the experiment bears it out; None where it cannot tell.
        evidence: The numbers that decide, with units; identifiers become words, see ``spoken``.
    """

    sentence: str
    section: str
    holds: bool | None
    evidence: str

    def __post_init__(self) -> None:
        """Put identifiers into words."""
        object.__setattr__(self, "evidence", spoken(self.evidence))


class Result(abc.ABC):
    """The outcome of one experiment on one joint: a frozen dataclass of its own for each.

    Attributes:
        title: Heading of its report, such as ``Isometric twitch``.
        section: Where the paper has it, such as ``4.1.1, Fig. 5a``.
        size: Width and height of its figure [inch].
        joint: Name of the joint.
        recordings: Runs behind it, by what they are; kept for who wants to look further.
    """

    title: ClassVar[str]
    section: ClassVar[str]
    size: ClassVar[tuple[float, float]] = (9.0, 4.0)
    joint: str
    recordings: Mapping[str, Recording] = MappingProxyType({})

    @abc.abstractmethod
    def measures(self) -> Iterator[Measure]:
        """What was measured."""

    @abc.abstractmethod
    def claims(self) -> Iterator[Claim]:
        """The paper's claims, each decided by the numbers."""

    @abc.abstractmethod
    def draw(self, figure: Any) -> None:
        """Draw the paper's figure into a Matplotlib figure of ``size``."""

    def film(self) -> Recording | None:
        """A run worth seeing, where movement is the point; names are those of the joint's model."""
        return None

    def as_dict(self) -> dict[str, Any]:
        """Every number, ready for JSON."""
        return {
            "title": self.title,
            "section": self.section,
            "joint": self.joint,
            "measures": [asdict(measure) for measure in self.measures()],
            "claims": [asdict(claim) for claim in self.claims()],
        }
