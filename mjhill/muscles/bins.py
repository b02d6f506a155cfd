"""The distribution of bonds in bins, and its scheme: what ``huxley`` computes in a step.

Bins ride with the filament: bin j is at x = low + (j + 1/2) dx + s/h, wrapped into the window from
``LOW`` to the parameter ``longest_bond``. So a bin stays with its sites, and its share n follows an
ordinary equation that has an exact solution in each region of x: nothing diffuses, no step is too
long, and n stays in [0, 1]. Where a bin leaves the window its bonds are taken to be broken.

Pure functions of floats and arrays, under the same rules as ``elements``.
"""

from __future__ import annotations

from math import exp

from mjhill.elements import series_stretch_at
from mjhill.muscles.moments_scheme import carried_force

LOW = -1.5  # of the window [h]: at three quarters of V_max, 0.4 % of the bonds get so far
NEAR = 0.02  # how well the displacement of a step must be foreseen [h]
SWEEPS = 6  # at most, in a step


def settled_share(
    x: float, width: float, share: float, attachment_rate: float, detachment_rate: float
) -> float:
    """Share of the sites at x > 0 that have a bond in the end: f/(f + g), and 0 beyond 1.

    A bin of some width that 1 lies in has the mean of both. Otherwise the isometric force would
    depend on where bins lie, by up to ten per cent with 100 bins.
    """
    covered = min(max((1.0 - x) / width + 0.5, 0.0), 1.0)
    return covered * share * attachment_rate / (share * attachment_rate + detachment_rate)


def moved_share(
    n: float,
    x: float,
    displacement: float,
    dt: float,
    width: float,
    share: float,
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
) -> float:
    """Share n of a bin that moves steadily from x to x - displacement in dt [s].

    The way is taken region by region: below 0, up to where 1 comes into the bin, across 1, beyond.
    In each, bonds go to their settled share with the exact integral of f + g; across 1, with that
    at the middle.
    """
    low, high = 1.0 - 0.5 * width, 1.0 + 0.5 * width
    left, at = 1.0, x  # share of dt that is left
    end = x - displacement
    for _region in range(4):
        # where this region ends
        if displacement > 0.0:
            limit = high if at > high else low if at > low else 0.0 if at > 0.0 else end
            to = max(limit, end)
        else:
            limit = 0.0 if at < 0.0 else low if at < low else high if at < high else end
            to = min(limit, end)
        moving = displacement != 0.0
        part = (at - to) / displacement if moving else 1.0
        if abs(to - end) < 1e-12 or part > left:
            to, part = end, left
        time, middle = part * dt, 0.5 * (at + to)
        if middle < 0.0:
            n *= exp(-pushing_detachment_rate * time)
        else:
            broken = detachment_rate * middle
            if middle > 1.0:
                broken += stretched_detachment_rate * (middle - 1.0)
            goal = settled_share(middle, width, share, attachment_rate, detachment_rate)
            rate = broken / (1.0 - goal)
            if displacement > 0.0 and goal > 0.0:
                # sites that come in across 1 get bonds as fast as those that are in
                rate = broken + share * attachment_rate * middle
            n = goal + (n - goal) * exp(-rate * time)
        left -= part
        at = to
        if left <= 1e-12:
            break
    return n


def sweep(
    states: list[float],
    moved: list[float],
    first: int,
    start: float,
    displacement: float,
    dt: float,
    longest_bond: float,
    share: float,
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
) -> tuple[float, float]:
    """Bins after a displacement [h] in dt [s]; with 0 and 0, the moments as they are.

    Args:
        states: All states of the muscle; bins from index ``first`` on.
        moved: Where the new shares go, at the same indices.
        first: Index of the first bin.
        start: s/h before.
        displacement: By how much s/h falls.
        dt: Time [s].
        longest_bond: Upper end of the window [h].
        share: Factor on f.
        attachment_rate: f1 [1/s].
        detachment_rate: g1 [1/s].
        pushing_detachment_rate: g2 [1/s].
        stretched_detachment_rate: g3 [1/s].

    Returns:
        Moments M0 and M1 after the displacement.
    """
    count = len(states) - first
    window = longest_bond - LOW
    width = window / count
    offset = LOW + 0.5 * width + start % window
    zeroth, first_moment = 0.0, 0.0
    for j in range(count):
        x = offset + j * width
        if x >= longest_bond:
            x -= window
        end = x - displacement
        n = 0.0
        if LOW <= end < longest_bond:
            n = states[first + j]
            if dt > 0.0:
                n = moved_share(
                    n, x, displacement, dt, width, share, attachment_rate, detachment_rate,
                    pushing_detachment_rate, stretched_detachment_rate,
                )  # fmt: skip
            zeroth += n
            first_moment += n * end
        moved[first + j] = n
    return zeroth * width, first_moment * width


def advance_bins(
    states: list[float],
    moved: list[float],
    first: int,
    s: float,
    length: float,
    foreseen: float,
    dt: float,
    longest_bond: float,
    share: float,
    series_stretch: float,
    series_shape: float,
    series_limit: float,
    bond_reach: float,
    attachment_rate: float,
    detachment_rate: float,
    pushing_detachment_rate: float,
    stretched_detachment_rate: float,
    isometric_moment: float,
) -> float:
    """Displacement [h] after which bonds and series element carry the same at a length.

    Bins move by the displacement that is foreseen; then all of them by what that lacks, up to the
    same force. Where it lacks much they move again. ``moved`` gets their shares.
    """
    stretch = length - s  # of the series element, before the bonds have moved
    window = longest_bond - LOW
    displacement = min(max(foreseen, -0.5 * window), 0.5 * window)
    whole = displacement
    for _sweep in range(SWEEPS):
        m0, m1 = sweep(
            states, moved, first, s / bond_reach, displacement, dt, longest_bond, share,
            attachment_rate, detachment_rate, pushing_detachment_rate, stretched_detachment_rate,
        )  # fmt: skip
        m0 = max(m0, 1e-9)
        left = m1 + displacement * m0
        force = carried_force(
            left, m0, stretch, max(m1, 0.0) / isometric_moment, bond_reach, series_stretch,
            series_shape, series_limit, isometric_moment,
        )  # fmt: skip
        if force > 0.0:
            taut = series_stretch_at(force, series_stretch, series_shape, series_limit)
            whole = (taut - stretch) / bond_reach
        else:
            whole = left / m0
        whole = min(max(whole, -0.5 * window), 0.5 * window)
        if abs(whole - displacement) <= NEAR:
            break
        displacement = whole
    break_outside(moved, first, s / bond_reach, whole, longest_bond)
    return whole


def break_outside(
    moved: list[float], first: int, start: float, displacement: float, longest_bond: float
) -> None:
    """Break the bonds of bins that a displacement [h] takes out of the window, as in ``sweep``.

    Else the last correction of a step would wrap some of them with their bonds.
    """
    count = len(moved) - first
    window = longest_bond - LOW
    width = window / count
    offset = LOW + 0.5 * width + start % window
    for j in range(count):
        x = offset + j * width
        if x >= longest_bond:
            x -= window
        if not LOW <= x - displacement < longest_bond:
            moved[first + j] = 0.0
