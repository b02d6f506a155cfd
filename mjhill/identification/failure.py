"""A fit that explains too little of a measurement, and what may be wrong with the data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import degrees, pi, radians

import numpy as np
from numpy.typing import NDArray

from mjhill.identification.fit import Identified
from mjhill.identification.measurement import RANGE_MARGIN, Measurement, largest_torque
from mjhill.identification.movement import Prediction
from mjhill.identification.trial import make_trial
from mjhill.joints.joint import Joint

LEAST_EXPLAINED = 0.5  # of the variance of each measurement


class FitError(RuntimeError):
    """A fit that explains less than half of the variance of a measurement.

    Attributes:
        result: The fit, with its predictions, to look at; its parameters mean nothing.
    """

    def __init__(self, message: str, result: Identified) -> None:
        """A failed fit.

        Args:
            message: What is wrong, and what to look at.
            result: The fit.
        """
        super().__init__(message, result)
        self.result = result

    def __str__(self) -> str:
        """The message."""
        return str(self.args[0])


def check_explained(
    result: Identified, joint: Joint, predict: Sequence[str | None], inputs: str | None = None
) -> None:
    """Refuse a fit that explains too little.

    Args:
        result: The fit.
        joint: The joint before the fit, with which causes are tried.
        predict: What was asked to be predicted of each measurement.
        inputs: How the inputs were said to go on between samples.

    Raises:
        FitError: It explains less than half of the variance of a measurement; the message has the
            likely cause, if a simple one would make the measurement plausible.
    """
    faults = [
        _fault(prediction, joint, quantity, inputs)
        for prediction, quantity in zip(result.predictions, predict, strict=True)
        if not prediction.explained >= LEAST_EXPLAINED
    ]
    if faults:
        raise FitError(
            f"{joint.name}: the fit failed, as it explains less than "
            f"{100 * LEAST_EXPLAINED:.0f} % of the variance of what was measured: "
            + "; ".join(faults),
            result,
        )


def _fault(prediction: Prediction, joint: Joint, quantity: str | None, inputs: str | None) -> str:
    measurement = prediction.measurement
    tried = [
        (_explained(joint, changed, quantity, inputs), text)
        for text, changed in _changes(measurement, joint)
    ]
    share, text = max(tried, default=(0.0, ""))
    if share < LEAST_EXPLAINED:
        text = (
            "look at the units, the sign and zero of the angle, the sign of the torque, the "
            "columns, muscles that are swapped, and the delay between excitation and movement "
            "(--delay fits one)"
        )
    else:
        text += f" Then {100 * share:.0f} % are explained even before the fit"
    found = (
        f"{100 * prediction.explained:.0f} % of the variance of its {prediction.quantity} explained"
    )
    if prediction.explained < 0:
        found = f"its {prediction.quantity} is predicted worse than by its mean"
    return f"{measurement.source}: {found}; {text}"


def _changes(measurement: Measurement, joint: Joint) -> Iterator[tuple[str, Measurement]]:
    """Measurements as they would be without one common fault, and what to say of it."""
    angles = {
        "is its angle in radians, though its unit says degrees?": degrees(1) * measurement.angle,
        "is its angle in degrees, though its unit says radians?": radians(1) * measurement.angle,
        f"has its angle the wrong sign? {joint.positive.capitalize()} is positive.": (
            -measurement.angle
        ),
        "is its angle that between the segments? Write 180 deg less the angle.": (
            pi - measurement.angle
        ),
    }
    low, high = joint.range
    for text, angle in angles.items():
        if low - RANGE_MARGIN <= angle.min() and angle.max() <= high + RANGE_MARGIN:
            yield text, replace(measurement, angle=angle)
    torques: dict[str, NDArray[np.float64]] = {
        "has its torque the wrong sign? It is that on the joint from outside, not that of the "
        "muscles, and positive towards positive angles.": -measurement.torque,
        "is its torque in N·m, though its unit says N·mm?": 1e3 * measurement.torque,
    }
    for text, torque in torques.items():
        if 0 < np.abs(torque).max() <= largest_torque(joint):
            yield text, replace(measurement, torque=torque)
    if len(measurement.excitation) == 2:
        values = list(measurement.excitation.values())
        swapped = zip(measurement.excitation, values[::-1], strict=True)
        yield "are its muscles swapped?", replace(measurement, excitation=dict(swapped))


def _explained(
    joint: Joint, measurement: Measurement, quantity: str | None, inputs: str | None
) -> float:
    """Share of the variance that a joint explains as it is; 0 where it cannot be run."""
    try:
        trial = make_trial(measurement, quantity, inputs)
        predicted = trial.predict([joint], np.zeros((2, 1)))[0]
    except (ValueError, RuntimeError):
        return 0.0
    return Prediction(measurement, trial.quantity, trial.measured, predicted).explained
