"""What an identification gives: a joint, and how sure its parameters are."""

from __future__ import annotations

from dataclasses import dataclass

from mjhill.identification.free import Free
from mjhill.identification.solve import Estimate
from mjhill.joints.joint import Joint


@dataclass(frozen=True)
class Identified:
    """A joint with its free parameters fitted.

    Attributes:
        joint: The fitted joint.
        free: The parameters that were free.
        estimates: Their values and confidence, in the same order.
    """

    joint: Joint
    free: tuple[Free, ...]
    estimates: tuple[Estimate, ...]
