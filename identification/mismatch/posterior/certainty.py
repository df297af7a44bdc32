"""Whether an effect is certain: unlike the simulator, inside its bounds, and larger than unexplained forces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from nanobench_tools.settings import number

from .background import FORCES, MOMENTS, rms, turning_size
from .build import Case, rest_of
from .effects import Effect
from .sizing import CERTAIN, INSIDE, Refined, nuisance, parts_of
from .strained import strained

MATTERS_M_S2 = number("posterior.certainty.matters_m_s2")
"""Unmodelled physics below this is as good as flights allow."""
OUTWEIGHS = number("posterior.certainty.outweighs")
"""Times the force that no effect explains."""
DECISIVE = number("posterior.certainty.decisive")
"""Nats: evidence for an effect alone, from which on it is there although flights differ in its size."""
NINETY_FIVE = 1.96
INCLUDES = "the 95 % interval includes the simulator's value"
CANCELLED = "errors of other terms cancel it"
SCATTERS = "its size scatters between flights by as much"


@dataclass(frozen=True)
class Size:
    """One parameter: value of the simulator, estimate from the flights, and half width of its 95 % interval.

    ``most``: upper end of the interval of a limit that is higher than the simulator's. Noise of logged commands looks
    as if there were one just above what the vehicle did, so it may be any higher one.
    """

    believed: float
    value: float
    half: float
    unit: str
    most: float | None = None

    @property
    def share(self) -> float:
        """Distance from the simulator's value, in half widths of the interval."""
        return abs(self.value - self.believed) / max(self.half, 1e-30)

    @property
    def ci95(self) -> tuple[float, float]:
        """Ends of the interval."""
        return self.value - self.half, self.value + self.half if self.most is None else self.most


def no_predictions() -> float:
    """Log likelihood of an effect where nothing is predicted."""
    return 0.0


def sizes_of(case: Case, which: int, found: Refined,
             told: Callable[[], float] = no_predictions) -> dict[str, Size]:
    """Sizes of one effect of a set by parameter. ``told``: log likelihood that predictions of left-out flights give the
    effect. It narrows an interval that includes the simulator's value, and no other: it is known roughly."""
    effect, (part, covariance) = case.effects[which], _known(case, which, found)
    sizes = _by_parameter(case, effect, part, covariance)
    if _share(sizes) > 1.0 and _region(part, covariance) > 1.0:
        return sizes
    return _by_parameter(case, effect, part, narrowed(part, covariance, told()))


def narrowed(part: np.ndarray, covariance: np.ndarray, told: float) -> np.ndarray:
    """(k, k) covariance of coefficients (k,) if predictions give them a log likelihood ``told`` over zero.

    Along ``part``, the log likelihood is taken as a parabola with its maximum at ``part``. So twice ``told`` is added
    to the squared distance from zero. Unchanged where this distance is no larger than that of noise: predictions alone
    are no evidence.
    """
    squared = float(part @ np.linalg.solve(covariance, part))
    gained = 2.0 * max(told, 0.0)
    if squared <= len(part):
        return covariance
    return np.asarray(covariance - np.outer(part, part) * gained / (squared * (squared + gained)))


def _by_parameter(case: Case, effect: Effect, part: np.ndarray, covariance: np.ndarray) -> dict[str, Size]:
    if effect.map_share:
        return {f"{effect.term}.share": Size(0.0, float(part[0]), NINETY_FIVE * float(np.sqrt(covariance[0, 0])), "1")}
    model, found = case.space.model, dict[str, Size]()
    units, around = dict(zip(model.names, model.units, strict=True)), model.parameters
    for name, way in effect.moves.items():
        change = float(way @ part)
        found[name] = Size(case.simulator.parameters.get(name, around[name]), around[name] + change,
                           NINETY_FIVE * float(np.sqrt(way @ covariance @ way)), units[name],
                           float(model.upper[model.index(name)]) if _raises_limit(name, change) else None)
    return found


def _raises_limit(name: str, change: float) -> bool:
    return name.startswith("saturation.") and change > 0.0


def _known(case: Case, which: int, found: Refined) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (k,) of one effect of a set, and their covariance (k, k). A limit that no flight reaches has no
    slope, so the secant to it says how far it is from the simulator's."""
    mine = _mine(case, which, found)
    covariance = found.covariance[mine, mine]
    if any(_raises_limit(name, way @ found.step[mine]) for name, way in case.effects[which].moves.items()):
        at = case.evidence.columns((which,))
        covariance = np.minimum(covariance, 1.0 / (case.evidence.rest[at, at] * case.evidence.unit[at] ** 2))
    return found.step[mine], covariance


def _share(sizes: Mapping[str, Size]) -> float:
    return max(size.share for size in sizes.values())


def _mine(case: Case, which: int, found: Refined) -> slice:
    """Coefficients of one effect among those of a set."""
    ends = np.concatenate([[0], np.cumsum([case.effects[i].width for i in found.chosen])])
    return slice(*ends[found.chosen.index(which):][:2].astype(int))


def size_of(case: Case, which: int, found: Refined) -> float:
    """m/s^2 RMS, force and moment together."""
    part = dict(parts_of(case, found.chosen, found.step))[which]
    return float(np.linalg.norm(part * case.evidence.unit[case.evidence.columns((which,))]))


def certainty(case: Case, which: int, found: Refined, told: Callable[[], float] = no_predictions) -> float:
    """Distance between the simulator and an effect of a set, relative to the 95 % limit; ``told``: as of ``sizes_of``.

    There are four such distances: of the best known parameter, of the region of all directions, ``over_error`` and
    ``_over_scatter``. The smallest one counts. It is 0 if errors of terms cancel the effect.
    """
    if _cancelled(case, which, found):
        return 0.0
    return float(min(_sure(case, which, found, told), over_error(case, which, found),
                     _over_scatter(case, which, found, told)))


def _sure(case: Case, which: int, found: Refined, told: Callable[[], float]) -> float:
    """Distance of its best known parameter, or of the region of all its directions; the smaller one."""
    part, covariance = _known(case, which, found)
    least = min(_share(sizes_of(case, which, found)), _region(part, covariance))
    return least if least > 1.0 else min(_share(sizes_of(case, which, found, told)),
                                         _region(part, narrowed(part, covariance, told())))


def _cancelled(case: Case, which: int, found: Refined) -> bool:
    """Whether the errors of terms cancel an effect of a set, as ``Evidence.any_opposed``."""
    if case.effects[which].far:
        return False
    mine, acts = case.evidence.columns((which,)), np.zeros(case.evidence.P)
    acts[mine] = found.step[_mine(case, which, found)] * case.evidence.unit[mine]
    return case.evidence.opposed(acts, nuisance(case, found)[:case.evidence.P])


def _region(part: np.ndarray, covariance: np.ndarray) -> float:
    """Distance relative to the limit of the 95 % region of all directions (k,)."""
    return float(np.sqrt(part @ np.linalg.solve(covariance, part) / chi2.ppf(0.95, len(part))))


def _over_scatter(case: Case, which: int, found: Refined, told: Callable[[], float]) -> float:
    """As ``_region``, with the scatter between flights. It decides unless the evidence for the effect alone is
    DECISIVE: flights may differ in the size of an effect that is there beyond doubt."""
    if case.evidence.weighed((which,))[0] >= DECISIVE:
        return float("inf")
    mine = _mine(case, which, found)
    part, spread = found.step[mine], found.spread(case)[mine, mine]
    least = _region(part, spread)
    return least if least > 1.0 else _region(part, narrowed(part, spread, told()))


def over_error(case: Case, which: int, found: Refined) -> float:
    """Size of an effect far from linear, relative to that by which its term may be off without being a finding. Its
    evidence is that of slopes where it ends, and such an error is taken where it begins."""
    if not case.effects[which].far:
        return float("inf")
    spike = case.evidence.spike[case.evidence.columns((which,))]
    readings = sum(e.term == case.effects[which].term for e in case.effects)
    return size_of(case, which, found) / max(float(np.sqrt(readings)) * float(np.linalg.norm(spike)), 1e-12)


def uncertain(case: Case, which: int, found: Refined, told: Callable[[], float] = no_predictions) -> str | None:
    """Why an effect of a set is not certain; None if it is. ``told``: as of ``sizes_of``."""
    if certainty(case, which, found, told) > 1.0:
        return None
    if _cancelled(case, which, found):
        return CANCELLED
    if over_error(case, which, found) <= 1.0:
        return f"{size_of(case, which, found):.2g} m/s^2, by which any term may be off"
    why = SCATTERS if _sure(case, which, found, told) > 1.0 else INCLUDES
    return f"{why}: {_shortest(sizes_of(case, which, found, told))}"


def _shortest(sizes: Mapping[str, Size]) -> str:
    name, size = next(iter(sizes.items()))
    return f"{name} {size.value:.3g} +- {size.half:.2g} {size.unit}"


def on_bound(case: Case, which: int, found: Refined) -> bool:
    """Whether the flights require a size outside a bound, other than that where the term has no effect."""
    effect, (part, beyond) = case.effects[which], (
        dict(parts_of(case, found.chosen, values))[which] for values in (found.step, found.beyond))
    at = (((part <= INSIDE * effect.lower) & (effect.lower < 0.0))
          | ((part >= INSIDE * effect.upper) & (effect.upper > 0.0))) & (beyond >= CERTAIN)
    slots = {slot.name: slot for slot in case.space.model.slots}
    before, after = case.space.model.parameters, found.model.parameters
    for name, way in effect.moves.items():
        rest = rest_of(slots[name], case.space.model)
        if abs(after[name] - rest) < 2.0 * (1.0 - INSIDE) * abs(before[name] - rest):
            at &= way == 0.0
    return bool(at.any())


def overshadowed(case: Case, found: Refined) -> dict[int, str]:
    """{number: reason} of the smallest effect, if it is masked: less than OUTWEIGHS times the unexplained force.

    Such a force could imitate the effect, if it acts along the same axes. One axis counts as a third of a force, and as
    no more than all of it. That of the background has no mean, so it cannot imitate the constant part of an effect.
    ``strained`` forces can, and so can a force of the place, whose mean may be as large as its changes. Empty if the
    unexplained force is too small to matter. Effects that act more as a moment are compared with the moment of
    ``strained`` errors.
    """
    coefficients, groups = nuisance(case, found)[case.evidence.P:], case.background.group
    along, placed = (((case.background.force[..., mine] @ coefficients[mine]) ** 2).mean(0)
                     for mine in (np.isin(groups, FORCES), groups == "place"))
    pushed, turned = strained(case, found)
    constant, imitated = (pushed**2).mean(0), float(turning_size(turned, case.arm))
    strain = float(np.hypot(np.sqrt(constant.sum()), imitated))
    masked = dict[int, tuple[float, float]]()
    for i, part in parts_of(case, found.chosen, found.step):
        acts = case.effects[i].force @ part
        force = (acts**2).mean(0)
        varies = (force - acts.mean(0) ** 2).sum() / max(force.sum(), 1e-12)
        push, turn = float(np.sqrt(force.sum())), float(turning_size(case.effects[i].torque @ part, case.arm))
        like = varies * along + (1.0 - varies) * placed + constant
        left = float(np.sqrt(min(len(force) * force @ like / max(force.sum(), 1e-12), like.sum())))
        if left >= MATTERS_M_S2 and turn < push < OUTWEIGHS * left:
            masked[i] = push, left
        elif strain >= MATTERS_M_S2 and push <= turn < OUTWEIGHS * imitated:
            masked[i] = turn, imitated
    if not masked:
        return {}
    least = min(masked, key=lambda i: masked[i])
    push, left = masked[least]
    return {least: f"{push:.2g} m/s^2 next to {left:.2g} m/s^2 along the same axes that no effect explains"}


def unexplained(case: Case, found: Refined) -> dict[str, float]:
    """m/s^2 RMS by group of the discrepancy: the part that no effect explains, given a set at its sizes."""
    return case.evidence.sizes_of(nuisance(case, found)[case.evidence.P:])


def unnamed(case: Case, found: Refined) -> tuple[float, float]:
    """Force and moment at the arms, m/s^2 RMS, that no effect of a set explains: all groups together, which may oppose
    each other.

    Without the mean of each flight: offsets of flights, which are no part of it, may oppose that as well.
    """
    coefficients, groups = nuisance(case, found)[case.evidence.P:], case.background.group
    parts = []
    for columns, names, flight in ((case.background.force, FORCES, case.wrench.flight[case.wrench.force_at]),
                                   (case.background.torque, MOMENTS, case.wrench.flight[case.wrench.torque_at])):
        mine = np.isin(groups, names)
        part = columns[..., mine] @ coefficients[mine]
        for one in np.unique(flight):
            part[flight == one] -= part[flight == one].mean(0)
        parts.append(part)
    return float(rms(parts[0])), float(turning_size(parts[1], case.arm))
