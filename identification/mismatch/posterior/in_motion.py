"""Is an effect that acts at any speed also there at rest? Drag of a wrong shape, or a gain that depends on the speed,
looks like a mass on flights that hardly rest."""

from __future__ import annotations

import numpy as np

from nanobench_tools.settings import number

from .build import Case
from .sizing import Refined, slopes

LEAST = number("posterior.in_motion.least")
"""Share of the effect that has to be left at rest."""
CERTAIN = 1.96
"""Standard deviations."""


def only_in_motion(case: Case, found: Refined, which: int) -> bool:
    """Whether an effect of a set depends on the speed, and less than half of it is left at rest.

    ``which``: an effect of one parameter. The effect is b + c (s - 1) times its column, where s is the speed
    over its mean. At rest b - c is left. Before any flight, c is zero to within b.
    """
    mine = int(np.flatnonzero(np.repeat(found.chosen, [case.effects[i].width for i in found.chosen]) == which)[0])
    unit = case.evidence.unit[case.evidence.columns(found.chosen)]
    effect, wrench = case.effects[which], case.wrench
    speed = [np.linalg.norm(wrench.of("velocity_m_s", at), axis=1) for at in (wrench.force_at, wrench.torque_at)]
    mean = max(float(speed[0].mean()), 1e-6)
    changes = [column * (s / mean - 1.0)[:, None, None] / unit[mine]
               for column, s in zip((effect.force, effect.torque), speed, strict=True)]
    reduced = case.beside(case.across(case.rows.of(*changes) + slopes(case, found.chosen, found.step, unit)),
                          found.chosen)
    size = found.step * unit
    if size[mine] == 0.0:
        return False
    prior = np.concatenate([[abs(size[mine])], found.slab])
    covariance = np.linalg.inv(reduced[:-1, :-1] + np.diag(prior**-2.0))
    likely = covariance @ (reduced[:-1, -1] + reduced[:-1, 1:-1] @ size)
    driven, whole = float(likely[0]), float(likely[1 + mine])
    return driven * whole > (1.0 - LEAST) * whole**2 and abs(driven) > CERTAIN * float(np.sqrt(covariance[0, 0]))
