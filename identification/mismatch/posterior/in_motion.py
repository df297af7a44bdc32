"""Is an effect that acts at any speed also there at rest? Drag of a wrong shape, or a gain that depends on the speed,
looks like a mass on flights that hardly rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nanobench_tools.settings import number

from .build import Case
from .effects import Pair
from .rows import Seen
from .sizing import Refined, slopes

LEAST = number("posterior.in_motion.least")
"""Share of the effect that has to be left at rest."""
CERTAIN = 1.96
"""Standard deviations."""


def only_in_motion(case: Case, found: Refined, which: int) -> bool:
    """Whether an effect of a set depends on the speed, and less than half of it is left at rest.

    ``which``: an effect of one parameter. It is asked twice. First with all that the background and errors of terms may
    explain. Far beyond their standard deviation, they may take what goes with the speed. So the slow and the fast half
    of the rows are also compared without them.
    """
    mine = int(np.flatnonzero(np.repeat(found.chosen, [case.effects[i].width for i in found.chosen]) == which)[0])
    unit = case.evidence.unit[case.evidence.columns(found.chosen)]
    effect, wrench, size = case.effects[which], case.wrench, found.step * unit
    if size[mine] == 0.0:
        return False
    columns = effect.force / unit[mine], effect.torque / unit[mine]
    speed = [np.linalg.norm(wrench.of("velocity_m_s", at), axis=1) for at in (wrench.force_at, wrench.torque_at)]
    seen = slopes(case, found.chosen, found.step, unit)
    return _beside_all(case, found, columns, speed, seen, mine) or _halves(case, columns, speed, seen, size, mine)


def _beside_all(case: Case, found: Refined, columns: Pair, speed: Sequence[np.ndarray], seen: Seen,
                mine: int) -> bool:
    """The effect is b + c (s - 1) times its column, where s is the speed over its mean. At rest b - c is left. Before
    any flight, c is zero to within b."""
    mean = max(float(speed[0].mean()), 1e-6)
    changes = [column * (s / mean - 1.0)[:, None, None] for column, s in zip(columns, speed, strict=True)]
    reduced = case.beside(case.across(case.rows.of(*changes) + seen), found.chosen)
    size = found.step * case.evidence.unit[case.evidence.columns(found.chosen)]
    prior = np.concatenate([[abs(size[mine])], found.slab])
    covariance = np.linalg.inv(reduced[:-1, :-1] + np.diag(prior**-2.0))
    likely = covariance @ (reduced[:-1, -1] + reduced[:-1, 1:-1] @ size)
    driven, whole = float(likely[0]), float(likely[1 + mine])
    return driven * whole > (1.0 - LEAST) * whole**2 and abs(driven) > CERTAIN * float(np.sqrt(covariance[0, 0]))


def _halves(case: Case, columns: Pair, speed: Sequence[np.ndarray], seen: Seen, size: np.ndarray, mine: int) -> bool:
    """The effect has one size in the slow half of the rows and one in the fast half, by least squares of the force. The
    line through both is followed no further below the slow half than from there to the fast one."""
    middle = float(np.median(speed[0]))
    slow, fast = speed[0] < middle, speed[0] >= middle
    if not slow.any():
        return False
    halves = np.concatenate([columns[0] * half[:, None, None] for half in (slow, fast)], 2)
    whole = np.concatenate(seen.force)
    others = np.delete(whole[:, :-1], mine, axis=1)
    asked = np.concatenate([*case.rows.of(halves, np.repeat(np.zeros_like(columns[1]), 2, axis=2)).force])
    at_slow, at_fast = np.linalg.lstsq(np.column_stack([asked, others]), whole[:, -1] + whole[:, mine] * size[mine],
                                       rcond=None)[0][:2]
    further = float(speed[0][slow].mean() / max(float(speed[0][fast].mean() - speed[0][slow].mean()), 1e-6))
    left, usual = at_slow - min(further, 1.0) * (at_fast - at_slow), 0.5 * (at_slow + at_fast)
    return bool(left * usual < LEAST * usual**2)
