"""Which of its axes, signs and units a stream is in, judged by the signal it should equal.

For every one of ``pairs`` the correlations of all axes with all axes are taken at every lag within reach. The order
of axes that explains most, the signs at that lag and the ratio of the amplitudes are the verdict. A different order or
sign is accepted only if it is clearly better than the stored one. It must also hold in the separate seconds of the
flight, not only in their sum.
"""

from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np

from ..flight import STREAM_QUANTITIES
from ..settings import number
from ..time_offsets.mathematics.lags import LagSums
from .context import Context
from .known_factors import NamedFactor, named_factor
from .paired_signals import Pair
from .pairs import (
    PAIRS,
    MakePair,
    sums_of,
)

ORDERS = tuple(permutations(range(3)))
CLEAR = number("audit.axis_unit_matching.clear")
CERTAIN_T = number("audit.axis_unit_matching.certain_t")
FACTOR = number("audit.axis_unit_matching.factor")
HORIZONTAL = (("x", "y", "z"), ("vx", "vy", "vz"), ("ax", "ay", "az"))
"""Quantities in a world whose heading is anyone's choice: its origin and heading are no fault."""
ALONE = number("audit.axis_unit_matching.alone")
QUARTER_RAD = number("audit.axis_unit_matching.quarter_rad")
FACTOR_WITHIN = number("audit.axis_unit_matching.factor_within")
CLEARLY = number("audit.axis_unit_matching.clearly")


@dataclass(frozen=True)
class AxisUnitMatch:
    """How a stream's axes match those of the reference.

    - order (3,): axis i of the stream looks like axis order[i] of the reference.
    - sign (3,): -1 | 0 (not decided) | 1.
    - correlation (3,): with that axis.
    - ratio (3,): of amplitudes, nan where the correlation is not clear.
    - swapped: the order clearly differs from x, y, z."""

    stream: str
    quantities: tuple[str, ...]
    order: tuple[int, ...]
    sign: tuple[int, ...]
    correlation: tuple[float, ...]
    ratio: tuple[float, ...]
    swapped: bool

    @property
    def wrong(self) -> tuple[Any, ...]:
        """What differs: empty when nothing does; equal for two streams that are wrong in the same way."""
        flips = tuple(s < 0 for s in self.sign)
        return (
            (self.order if self.swapped else None, flips, self.factor_name)
            if (self.swapped or any(flips) or self.factor != 1.0)
            else ()
        )

    @property
    def scaled(self) -> tuple[tuple[tuple[int, ...], NamedFactor], ...]:
        """Axes beyond FACTOR of the reference, with their factor by the one that correlates best. Axes that differ by
        more than FACTOR among themselves are in several units."""
        groups: list[list[int]] = []
        for k in sorted((k for k in range(3) if np.isfinite(self.ratio[k])), key=lambda k: self.ratio[k]):
            if groups and self.ratio[k] < FACTOR * self.ratio[groups[-1][0]]:
                groups[-1].append(k)
            else:
                groups.append([k])
        if len(groups) == 1:
            groups = [groups[0] + [k for k in range(3) if k not in groups[0]]]
        found = []
        for group in groups:
            clear = [k for k in group if np.isfinite(self.ratio[k])]
            best = max(clear, key=lambda k: abs(self.correlation[k]))
            if len(groups) > 1 and (self.stream == "pid" or abs(self.correlation[best]) < ALONE):
                continue
            if self.stream == "pid" and clear == [2]:  # only the heading agrees: it may fly by other set-points
                continue
            sizes = np.log([float(np.median([self.ratio[k] for k in clear])), self.ratio[best]])
            if np.abs(sizes).min() >= np.log(FACTOR):
                unit = STREAM_QUANTITIES[self.stream][self.quantities[0]][0]
                found.append((tuple(sorted(group)), named_factor(
                    unit, self.ratio[best], FACTOR_WITHIN / max(min(abs(self.correlation[best]), 1.0), CLEAR))))
        return tuple(found)

    @property
    def named(self) -> NamedFactor | None:
        """The factor of the most axes; None where all have their size."""
        return max(self.scaled, key=lambda entry: len(entry[0]))[1] if self.scaled else None

    @property
    def factor(self) -> float:
        """The factor of ``named``, else 1."""
        return 1.0 if self.named is None else self.named.factor

    @property
    def factor_name(self) -> str:
        return "" if self.named is None else self.named.name


def correlations(sums: LagSums) -> np.ndarray:
    """(lags, 3, 3) of every axis of the stream with every axis of the reference; 0 where one stands still."""
    cross, reference, measured = (x.sum(axis=0) for x in (sums.cross, sums.reference, sums.measured))
    s = np.sqrt(np.maximum(np.diagonal(measured), 0.0))
    r = np.sqrt(np.maximum(np.diagonal(reference, axis1=1, axis2=2), 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.nan_to_num(cross / (s[None, :, None] * r[:, None, :])))


def match_of(pair: Pair, sums: LagSums) -> AxisUnitMatch | None:
    """None if nothing moves. ``sums`` are those of ``pair``."""
    reference, measured = sums.reference.sum(axis=0), sums.measured.sum(axis=0)
    s = np.sqrt(np.maximum(np.diagonal(measured), 0.0))
    r = np.sqrt(np.maximum(np.diagonal(reference, axis1=1, axis2=2), 0.0))
    if not s.max() > 0.0 or not r.max() > 0.0:
        return None
    k = correlations(sums)
    axes = np.arange(3)
    straight = k[:, axes, axes]
    as_is = int(np.argmax(straight.sum(axis=1)))
    strength = {order: np.abs(k[:, axes, order]).sum(axis=1) for order in ORDERS}
    order = max(ORDERS, key=lambda o: strength[o].max())
    at = int(np.argmax(strength[order]))
    moved = [i for i in range(3) if order[i] != i]
    swapped = (
        bool(moved)
        and strength[order].max() > strength[ORDERS[0]].max() + CLEARLY
        and all(abs(k[at, i, order[i]]) > CLEAR and certain(sums, at, i, order[i]) for i in moved)
    )
    if not swapped:
        order = ORDERS[0]
        # left as it is, unless opposite signs are clearly the better explanation
        at = int(np.argmax(strength[order]))
        if np.all(k[at, axes, axes] > -CLEAR) or strength[order][at] < straight[as_is].sum() + CLEAR:
            at = as_is
    if pair.quantities in HORIZONTAL and _turned_between(sums, at):  # a different heading is no other axis
        order, swapped = ORDERS[0], False
        return AxisUnitMatch(pair.stream, pair.quantities, order, (0, 0, 0), (0.0, 0.0, float(k[at, 2, 2])),
                             (np.nan, np.nan, np.nan), swapped)
    found = k[at, axes, order]
    sign = tuple(int(np.sign(v)) if abs(v) > CLEAR and certain(sums, at, i, order[i]) else 0 for i,
                 v in enumerate(found))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(np.abs(found) > CLEAR, s / r[at, list(order)], np.nan)
    return AxisUnitMatch(pair.stream, pair.quantities, order, sign, tuple(map(float, found)), tuple(map(float, ratio)),
                         swapped)


def _turned_between(sums: LagSums, at: int) -> bool:
    """Whether the horizontal axes are turned about the vertical, and by no quarter of a turn."""
    c = sums.cross[:, at, :2, :2].sum(axis=0)
    turned, mirrored = np.hypot(c[0, 0] + c[1, 1], c[0, 1] - c[1, 0]), np.hypot(c[0, 0] - c[1, 1], c[0, 1] + c[1, 0])
    size = float(np.sqrt(sums.measured.sum(axis=0)[[0, 1], [0, 1]].sum()
                         * sums.reference.sum(axis=0)[at][[0, 1], [0, 1]].sum()))
    angle = np.arctan2(c[0, 1] - c[1, 0], c[0, 0] + c[1, 1])
    quarter = abs(angle - np.pi / 2 * np.round(angle / (np.pi / 2)))
    return bool(turned > CLEAR * size and turned > 2.0 * mirrored and quarter > QUARTER_RAD)


def certain(sums: LagSums, at: int, i: int, j: int) -> bool:
    """Whether the blocks' products of axes i and j have one sign beyond chance (t of their signed shares)."""
    share = sums.cross[:, at, i, j] / np.sqrt(sums.measured[:, i, i] * sums.reference[:, at, j, j] + 1e-300)
    spread = share.std(ddof=1)
    return bool(abs(share.mean()) > CERTAIN_T * spread / np.sqrt(len(share))) if spread > 0.0 else True


def axis_unit_matches(context: Context) -> dict[MakePair, AxisUnitMatch]:
    """The verdict for every pair that could be formed."""
    found = {}
    for make in PAIRS:
        sums, pair = sums_of(context, make), context.once(make)
        verdict = None if sums is None or pair is None else match_of(pair, sums)
        if verdict is not None:
            found[make] = verdict
    return found
