"""Steady muscle states for a pose and its controls."""

from __future__ import annotations

import math

import mujoco

from mjhill.callbacks.python import control, muscle_length
from mjhill.layout import addresses, read_muscle
from mjhill.readings import steady_stretch


def at_home(model: mujoco.MjModel) -> mujoco.MjData:
    """Data at the model's key ``home``, or at ``qpos0`` without one, with steady muscles.

    The controls are those of the key, or 0.
    """
    data = mujoco.MjData(model)
    key = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, "home")
    if key >= 0:
        mujoco.mj_resetDataKeyframe(model, data, key)
    equilibrate(model, data)
    return data


def equilibrate(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Set every muscle's states to their steady values for the present pose and controls.

    n and a become the control; s becomes the contractile length at which contractile and series
    element carry the same force at rest. The pose stays: the joint need not be in balance.

    Raises:
        ValueError: A control or a position is not finite.
    """
    check_finite(data)
    mujoco.mj_fwdPosition(model, data)
    for name, address in addresses(model):
        u = control(model, data, address.actuator)
        length = muscle_length(model, data, address.actuator)
        stretch = steady_stretch(read_muscle(model, name), u, length)
        data.act[address.act : address.act + 3] = u, u, length - stretch


def check_finite(data: mujoco.MjData) -> None:
    """Refuse data whose controls or positions are not numbers.

    Raises:
        ValueError: One is not finite; the message has its index.
    """
    for what in ("ctrl", "qpos"):
        for index, value in enumerate(getattr(data, what).tolist()):
            if not math.isfinite(value):
                raise ValueError(f"data.{what}[{index}] must be finite, got {value}")
