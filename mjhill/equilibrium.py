"""Steady muscle states for a pose and its controls."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from mjhill.callbacks.python import control
from mjhill.elements import active_length_factor, hypothetical_force, series_stretch_at
from mjhill.layout import STATES, muscle_ids, parameter_columns

_HOME = "home"
# the parameters on which the steady state depends, in the order in which it is computed
_FACTOR = ("optimal_length", "width_short", "width_long")
_SERIES = ("series_stretch", "series_shape", "series_limit")


def at_home(model: mujoco.MjModel) -> mujoco.MjData:
    """Data at the model's key ``home``, or at ``qpos0`` without one, with steady muscles.

    A model put together from several has a key for each, such as ``left_home``; then each part
    is at its own. The controls are those of the keys, or 0.
    """
    data = mujoco.MjData(model)
    keys = {model.key(i).name: i for i in range(model.nkey)}
    if _HOME in keys:
        mujoco.mj_resetDataKeyframe(model, data, keys[_HOME])
    else:
        for name, key in keys.items():
            if name.endswith(_HOME):  # attached: prefix and name
                moved = model.key_qpos[key] != model.qpos0
                data.qpos[moved] = model.key_qpos[key][moved]
                data.ctrl[:] += model.key_ctrl[key]
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
    muscles = muscle_ids(model)
    if not muscles:
        return
    outs = model.actuator_outadr[muscles]
    lengths = (data.actuator_length[outs] - model.actuator_length0[outs]).tolist()
    columns = parameter_columns(model, muscles)
    factors = zip(*(columns[name].tolist() for name in _FACTOR), strict=True)
    floors = columns["activation_floor"].tolist()
    series = zip(*(columns[name].tolist() for name in _SERIES), strict=True)
    states = np.empty((len(muscles), STATES))
    inputs = _controls(model, data, muscles)
    for row, (u, length, factor, floor, element) in enumerate(
        zip(inputs, lengths, factors, floors, series, strict=True)
    ):
        force = hypothetical_force(u, active_length_factor(length, *factor), floor)
        states[row] = u, u, length - series_stretch_at(force, *element)
    data.act[model.actuator_actadr[muscles][:, None] + np.arange(STATES)] = states


def _controls(model: mujoco.MjModel, data: mujoco.MjData, muscles: list[int]) -> list[float]:
    """``control`` of each muscle, all at once where none has a delay."""
    if model.actuator_delay[muscles].any():
        return [control(model, data, actuator) for actuator in muscles]
    addresses = model.actuator_ctrladr[muscles]
    u = data.ctrl[addresses]
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL:
        low, high = model.actuator_ctrlrange[addresses].T
        u = np.where(model.actuator_ctrllimited[addresses], np.clip(u, low, high), u)
    u[np.abs(u) > mujoco.mjMAXVAL] = 0.0
    return [float(value) for value in np.clip(u, 0.0, 1.0)]


def check_finite(data: mujoco.MjData) -> None:
    """Refuse data whose controls or positions are not numbers.

    Raises:
        ValueError: One is not finite; the message has its index.
    """
    for what in ("ctrl", "qpos", "qvel"):
        for index, value in enumerate(getattr(data, what).tolist()):
            if not math.isfinite(value):
                raise ValueError(f"data.{what}[{index}] must be finite, got {value}")


def check_states(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Refuse data in which a muscle's states cannot be those of a muscle.

    Raises:
        ValueError: n or a is outside [0, 1], or s is not a number or off by more than the series
            element could ever be stretched; the message names the muscle.
    """
    from mjhill.layout import actuator_names

    mujoco.mj_fwdPosition(model, data)
    muscles = muscle_ids(model)
    outs, first = model.actuator_outadr[muscles], model.actuator_actadr[muscles]
    stretch = data.actuator_length[outs] - model.actuator_length0[outs] - data.act[first + 2]
    columns = parameter_columns(model, muscles)
    span = 10 * columns["series_limit"] * columns["series_stretch"] + 10 * (
        columns["width_short"] + columns["width_long"]
    )
    for row, actuator in enumerate(muscles):
        n, a, s = data.act[first[row] : first[row] + STATES].tolist()
        # a little outside: RK4 may end a step there
        for what, value in (("n", n), ("a", a)):
            if not -0.1 <= value <= 1.1:
                raise ValueError(
                    f"muscle {actuator_names(model)[actuator]!r}: its state {what} must be in "
                    f"[0, 1], got {value:g}; call mjhill.equilibrate(model, data)"
                )
        if not abs(stretch[row]) <= span[row]:
            raise ValueError(
                f"muscle {actuator_names(model)[actuator]!r}: its contractile length s = {s:g} "
                f"would stretch the series element by {stretch[row]:g}, far beyond what it "
                "carries; call mjhill.equilibrate(model, data)"
            )
