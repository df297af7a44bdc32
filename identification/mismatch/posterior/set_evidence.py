"""Evidence of every small set of effects, from one Gram matrix with everything but the effects integrated out once.

    residual = sum over a set S of Phi_t b_t + sum over all t of Phi_t e_t + background + noise

b_t ~ N(0, s^2) with s from a half-Cauchy, at most MOST of them. Always e_t ~ N(0, spike_t^2): every term is a little
wrong, more so where unmodelled physics is strong. The amplitudes of the background are learnt once with every term
free, and are the same for all sets. An amplitude that could grow to suit a set would absorb the effect. All in m/s^2
(``arm_unit.py``).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr

from nanobench_tools.settings import count, number, setting

from ..space import MAPS
from .background import FIXED, LEVELS, LIFT_OF_ALL, TRIMS, Background, rms, turning_size
from .effects import Effect

SCALES: tuple[float, ...] = setting("posterior.set_evidence.scales")
WIDTH = number("posterior.set_evidence.width")
"""m/s^2: scale of the half-Cauchy of sizes."""
PRIOR = number("posterior.set_evidence.prior")
"""Probability of a term before any flight."""
SPIKE = number("posterior.set_evidence.spike")
"""m/s^2 by which every term may be wrong without being a finding."""
LOOSE = number("posterior.set_evidence.loose")
"""Share of a believed term's contribution that may also be wrong."""
UNNAMED = number("posterior.set_evidence.unnamed")
"""Share of the discrepancy that may lie along any one slope."""
MOST = count("posterior.set_evidence.most")
FREE = 1.0
"""m/s^2: a term with this standard deviation is free."""
CANCELS = 2.0
"""Ratio of a set's terms to their sum along an axis, above which they cancel and are no explanation."""
CONCERNED = 0.1
"""Share of a set's whole contribution from which an axis counts for that."""
GRID = (0.0, 0.01, 0.02, 0.04, 0.07, 0.12, 0.2, 0.35, 0.6, 1.0, 1.8, 3.0)
"""m/s^2: amplitudes that are tried."""
MEANS: dict[str, float] = setting("posterior.set_evidence.amplitudes")
"""m/s^2: of each group, mean of the exponential prior of its amplitude, of levels the SD of a half-normal."""
CAPS: dict[str, float] = setting("posterior.set_evidence.most_level")
TILT_SHARED, LIFT_SHARED = number("posterior.set_evidence.tilt_shared"), number("posterior.set_evidence.lift_shared")
"""Times the scatter between flights."""
FAMILIES: tuple[frozenset[str], ...] = tuple(frozenset(f) for f in (
    ("wind", "force_world", "frame_tilt"), ("drag_linear", "drag_quadratic", "drag_rotor"),
    ("motor_lag", "command_delay"), ("thrust_scale", "thrust_voltage", "thrust_pwm", "mass"),
    ("saturation", "thrust_pwm", "thrust_voltage")))
"""One of each may be in a set: two of them trade against each other."""
COVERS = {"com_offset": 2}
"""Number of terms that a term's columns stand for: its own, and unequal motors in roll and pitch."""
TWINS = ("mass", "thrust_scale")
"""Terms of thrust per mass, which is a little wrong in the place of both."""
SHARED = {"frame_tilt": "tilt", "wind": "tilt", "force_world": "tilt", "thrust_scale": "lift", "mass": "lift",
          "thrust_voltage": "lift", "thrust_pwm": "lift"}
"""Term -> per-flight offset of the force. A change that all flights share has to exceed the scatter of this offset. Of
moments, the constant part of every column has to exceed the scatter of the trim about its axis."""
RANGE = 6.0
"""Standard deviations between the least and the largest exponent of a thrust map (``thrust_exponent``)."""
OFFSETS = (*(term for term, level in SHARED.items() if level == "tilt"), "com_offset", "motor_imbalance")
"""Terms with an uncertainty that does not depend on their size; that of the others is a share of their contribution."""
GAINS = ("inertia", "yaw_torque")
"""Terms of the gain from command to moment, which noisy commands change."""
UNNAMED_GROUPS = ("place", "air", "thrust", "lean", "late", "turn_place", "turn_air", "turn_thrust", "yaw_place",
                  "yaw_air", "yaw_thrust")
"""Groups of the background that an effect may be confused with."""


@dataclass
class Evidence:
    """Columns of effects and background, and the evidence of each set.

    ``gram`` (C, C) of whitened columns: P of the effects, Q of the background, the residual last. ``owner`` (P,):
    number of the effect of each column. ``unit`` (P,): m/s^2 of a column per unit of its direction. ``believed`` (P,):
    m/s^2 of the simulator's own term. ``work`` (6, P, P): inner products of the columns along each axis, force and
    moment. ``varying`` (6, P): share of ``work``'s diagonal that is not constant. ``seen`` (6, P): share of that part
    that the instruments see, relative to that of a discrepancy. ``gain_error`` (P,): share by which the gain from
    commands to a moment may be off. ``lift_spread``: m/s^2, of the thrust of all flights.
    """

    effects: Sequence[Effect]
    background: Background
    gram: np.ndarray
    owner: np.ndarray
    unit: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    believed: np.ndarray
    work: np.ndarray
    varying: np.ndarray
    seen: np.ndarray
    arm: np.ndarray
    flights: int = 1
    gain_error: np.ndarray = field(default_factory=lambda: np.zeros(0))
    lift_spread: float = 0.0
    amplitudes: dict[str, float] = field(default_factory=dict)
    spike: np.ndarray = field(default_factory=lambda: np.zeros(0))
    sets: dict[tuple[int, ...], float] = field(default_factory=dict)
    """Log of prior times evidence of every set of effects' numbers."""
    given_up: set[str] = field(default_factory=set)
    rest: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    """(P + 1, P + 1) Gram matrix of effects and residual with the background and the error of every term integrated
    out."""
    lifted: tuple[np.ndarray, float] = field(default_factory=lambda: (np.zeros((0, 0)), 0.0), repr=False)
    """The same for sets that determine the thrust (``takes_lift``), and its log evidence of no effect over ``rest``."""

    @property
    def P(self) -> int:
        """Columns of effects."""
        return len(self.owner)

    @cached_property
    def room(self) -> np.ndarray:
        """(P,) m/s^2: the longer way to a bound."""
        return np.asarray(np.maximum(np.abs(self.lower), np.abs(self.upper)))

    def columns(self, chosen: Iterable[int]) -> np.ndarray:
        """Column numbers of a set of effects."""
        return np.flatnonzero(np.isin(self.owner, list(chosen)))

    def without_background(self, amplitudes: dict[str, float],
                           gram: np.ndarray | None = None) -> tuple[np.ndarray, float]:
        """(P + 1, P + 1) Gram matrix of effects and residual with the background integrated out, and half the log
        determinant that it took."""
        g = self.gram if gram is None else gram
        deviation = np.array([amplitudes.get(name, 1.0) for name in self.background.group.tolist()])
        middle = slice(self.P, self.P + len(deviation))
        factor = _factor(g[middle, middle], deviation)
        outer = np.concatenate([np.arange(self.P), [g.shape[0] - 1]])
        taken = solve_triangular(factor, g[middle][:, outer] * deviation[:, None], lower=True)
        return g[np.ix_(outer, outer)] - taken.T @ taken, float(np.log(np.diag(factor)).sum())

    def reduced(self, left: np.ndarray, spike: np.ndarray) -> tuple[np.ndarray, float]:
        """The same with every effect a little wrong, too, and the log evidence of no effect but for the background's
        determinant."""
        factor = _factor(left[:-1, :-1], spike)
        taken = solve_triangular(factor, left[:-1] * spike[:, None], lower=True)
        rest = left - taken.T @ taken
        return rest, -0.5 * float(rest[-1, -1]) - float(np.log(np.diag(factor)).sum())

    def score(self, chosen: tuple[int, ...]) -> float:
        """Log of prior times evidence."""
        if chosen not in self.sets:
            self.sets[chosen] = self.weighed(chosen)[0] + self.log_prior(chosen)
        return self.sets[chosen]

    def factor_beside(self, gram: np.ndarray, lifted: bool) -> np.ndarray:
        """Factor of the nuisance columns' ``gram`` (P + Q, P + Q): the error of every term, and the background.
        ``lifted``: ``takes_lift`` of the set."""
        return _factor(gram, self._deviations(lifted))

    def beside(self, factor: np.ndarray, across: np.ndarray, asked: np.ndarray, lifted: bool) -> np.ndarray:
        """(k, k) inner products ``asked`` of further columns, with the nuisance columns integrated out. ``across`` (P +
        Q, k): inner products of nuisance and further columns."""
        taken = solve_triangular(factor, across * self._deviations(lifted)[:, None], lower=True)
        return np.asarray(asked - taken.T @ taken)

    def _deviations(self, lifted: bool) -> np.ndarray:
        amplitudes = {**self.amplitudes, LIFT_OF_ALL: 0.0} if lifted else self.amplitudes
        return np.concatenate([self.spike, [amplitudes.get(g, 1.0) for g in self.background.group.tolist()]])

    def everything(self, chosen: tuple[int, ...]) -> np.ndarray:
        """(P + Q,) posterior mean of the nuisance columns, given a set: the error of every term, and the background."""
        shift = np.zeros(self.P + len(self.background.group))
        shift[self.columns(chosen)] = self.weighed(chosen)[1]
        return self.mean_of(self.gram[:-1, -1] - self.gram[:-1, :-1] @ shift, self.takes_lift(chosen))

    def mean_of(self, right: np.ndarray, lifted: bool, gram: np.ndarray | None = None) -> np.ndarray:
        """(P + Q,) posterior mean of the nuisance columns, given a set. ``right`` (P + Q,): their inner products with
        the residual that the set leaves. ``lifted``: ``takes_lift`` of the set. ``gram``: theirs on some flights."""
        deviation = self._deviations(lifted)
        factor = _factor(self.gram[:-1, :-1] if gram is None else gram, deviation)
        half = solve_triangular(factor, deviation * right, lower=True)
        return np.asarray(deviation * solve_triangular(factor.T, half, lower=False))

    def sds(self, which: np.ndarray) -> np.ndarray:
        """Posterior standard deviations of the nuisance columns ``which`` (P + Q,) bool, without any effect."""
        deviation = self._deviations(self.takes_lift(()))
        half = solve_triangular(_factor(self.gram[:-1, :-1], deviation), np.diag(deviation)[:, which], lower=True)
        return np.asarray(np.sqrt(np.sum(half**2, axis=0)))

    def weighed(self, chosen: tuple[int, ...]) -> tuple[float, np.ndarray, np.ndarray]:
        """Log evidence of a set over no effect, sizes marginalised; its coefficients and their slab at the most
        probable scales."""
        if not chosen:
            return 0.0, np.zeros(0), np.zeros(0)
        left, over = self.beside_of(chosen)
        index = self.columns(chosen)
        return self.weighed_with(chosen, left[np.ix_(index, index)], left[index, -1], over)

    def beside_of(self, chosen: tuple[int, ...]) -> tuple[np.ndarray, float]:
        """``rest`` for a set, and the log evidence that no effect has there over no effect in ``rest`` itself."""
        return self.lifted if self.takes_lift(chosen) else (self.rest, 0.0)

    def weighed_with(self, chosen: tuple[int, ...], among: np.ndarray, along: np.ndarray,
                     over: float, at: np.ndarray | None = None) -> tuple[float, np.ndarray, np.ndarray]:
        """``weighed`` of columns with inner products ``among`` (k, k) with each other and ``along`` (k,) with the
        residual. ``at`` (k,): coefficients that are taken as the most probable ones."""
        index = self.columns(chosen)
        own = np.searchsorted(np.array(chosen), self.owner[index])
        scales = np.array(list(itertools.product(SCALES, repeat=len(chosen))))
        weight = _log_weights(scales)
        slab = np.minimum(scales[:, own], self.room[index])
        normal = among[None] * slab[:, :, None] * slab[:, None, :] + np.eye(len(index))
        right = slab * along
        solved = np.linalg.solve(normal, right[..., None])[..., 0]
        if at is not None:
            solved = at / slab
        gained = np.einsum("ck,ck->c", right - 0.5 * np.einsum("ckl,cl->ck", normal, solved), solved)
        log = gained - 0.5 * np.linalg.slogdet(normal)[1] + weight
        best = int(np.argmax(log))
        coefficients = slab[best] * solved[best]
        total = over + float(np.logaddexp.reduce(log)) + self._within(index, coefficients, slab[best], normal[best])
        if len(chosen) > 1 and self._cancel(index, own, coefficients):
            total -= 1e6
        return total, coefficients, slab[best]

    def _within(self, index: np.ndarray, mean: np.ndarray, slab: np.ndarray, normal: np.ndarray) -> float:
        """Log ratio of the posterior's share inside the bounds to the prior's, direction by direction. Sizes follow a
        normal distribution, truncated at the bounds of a vehicle."""
        sd = slab * np.sqrt(np.diag(np.linalg.inv(normal)))
        lower, upper = self.lower[index], self.upper[index]
        return float((_log_between((lower - mean) / sd, (upper - mean) / sd)
                      - _log_between(lower / slab, upper / slab)).sum())

    def _cancel(self, index: np.ndarray, own: np.ndarray, coefficients: np.ndarray) -> bool:
        work = self.work[:, index][:, :, index]
        parts = sum(np.einsum("i,kij,j->k", c, work[:, own == i][:, :, own == i], c)
                    for i in range(int(own.max()) + 1) for c in [coefficients[own == i]])
        net = np.einsum("i,kij,j->k", coefficients, work, coefficients)
        large = parts > CONCERNED * parts.sum()
        return bool((parts[large] > CANCELS**2 * net[large]).any())

    def opposed(self, acts: np.ndarray, errors: np.ndarray) -> bool:
        """Whether ``errors`` (P,) of all terms cancel more of an effect ``acts`` (P,) than effects of a set may cancel
        of each other. The effect then represents something else. A constant force against the error of a wind, for
        example, acts only where the vehicle leans."""
        work = self.work.sum(0)
        return bool(-(acts @ work @ errors) > (1.0 - 1.0 / CANCELS) * (acts @ work @ acts))

    def any_opposed(self, chosen: tuple[int, ...]) -> bool:
        """Whether that is so for an effect of a set. Errors bend an effect far from linear to where it ends, so such an
        effect is not asked."""
        index, errors = self.columns(chosen), self.everything(chosen)[:self.P]
        acts = np.zeros(self.P)
        acts[index] = self.weighed(chosen)[1]
        return any(self.opposed(np.where(self.owner == i, acts, 0.0), errors)
                   for i in chosen if not self.effects[i].far)

    def learn(self) -> None:
        """Amplitudes of the background with every term free, then how far every term may be off."""
        start = {g: min(0.07, CAPS.get(g, 9.0)) for g in self.background.groups}
        free = np.minimum(np.full(self.P, FREE), self.room)
        self.amplitudes = self._climb(start, free)
        along = self._unnamed(free)
        doing = self.work.diagonal(axis1=1, axis2=2)
        share = doing / np.maximum(doing.sum(0), 1e-12)
        terms = [self.effects[i].term for i in self.owner]
        feigned = (UNNAMED * along[:, None]) ** 2 * self.varying * share / self.seen
        pushed = feigned[:3].sum(0) + np.array([self._shared(t) for t in terms]) ** 2
        turned = feigned[3:].sum(0) + self._turned(share)
        feigned = np.where([t in OFFSETS for t in terms], _both(share[:3].sum(0), pushed, turned), pushed + turned)
        loose = self.believed * [0.0 if t in OFFSETS else g if t in GAINS else LOOSE
                                 for t, g in zip(terms, self.gain_error, strict=True)]
        width = self.upper - self.lower
        shape = np.array([t in MAPS and not self.effects[i].map_share
                          for i, t in zip(self.owner, terms, strict=True)]) & np.isfinite(width)
        loose[shape] = width[shape] / RANGE
        readings = np.array([sum(e.term == t for e in self.effects) for t in terms])
        spike = np.sqrt((SPIKE**2 + loose**2 + feigned) / readings)
        twins = np.array([t in TWINS for t in terms], bool)
        self.amplitudes[LIFT_OF_ALL] = float(np.max(spike[twins], initial=0.0))
        spike[twins] = 0.0
        self.spike = np.minimum(spike, self.room)
        self._reduce()

    def _shared(self, term: str) -> float:
        """m/s^2: what a change of the force that all flights share has to exceed.

        Flights of a set come from few sessions, each with its own tilt and trim. So a shared tilt or trim is no more
        certain than that of one flight. Thrust differs between flights, too, and between sessions by ``lift_spread``.
        """
        level = SHARED.get(term, "")
        if level == "tilt":
            return TILT_SHARED * self.amplitudes.get(level, 0.0)
        between = LIFT_SHARED * self.amplitudes.get(level, 0.0) / np.sqrt(max(self.flights, 1))
        return float(np.hypot(between, self.lift_spread * (term in TWINS)))

    def _turned(self, share: np.ndarray) -> np.ndarray:
        """(P,) (m/s^2)^2: what a constant moment that all flights share has to exceed. ``share`` (6, P): of each
        column's work along each axis."""
        trims = np.array([[self.amplitudes.get(level, 0.0)] for level in TRIMS])
        return np.asarray(TILT_SHARED**2 * (trims**2 * ((1.0 - self.varying) * share)[3:]).sum(0))

    def _reduce(self) -> None:
        found = []
        for amplitudes in (self.amplitudes, {**self.amplitudes, LIFT_OF_ALL: 0.0}):
            left, determinant = self.without_background(amplitudes)
            rest, log = self.reduced(left, self.spike)
            found.append((rest, log - determinant))
        (self.rest, none), (rest, lifted) = found
        self.lifted = rest, lifted - none

    def takes_lift(self, chosen: Iterable[int]) -> bool:
        """Whether a set determines thrust as a whole."""
        return any(self.effects[i].term in TWINS for i in chosen)

    def _unnamed(self, spike: np.ndarray) -> np.ndarray:
        """(6,) m/s^2 RMS of the discrepancy on these flights, with every term free. The force has one value for all
        axes, since the frame turns with the vehicle; the moment has one about each axis."""
        self.spike = spike
        background, found = self.background, self.everything(())[self.P:]
        mine = np.isin(background.group, UNNAMED_GROUPS)
        force = background.force[..., mine] @ found[mine]
        turning = background.torque[..., mine] @ found[mine] * self.arm
        return np.concatenate([np.full(3, rms(force)), np.sqrt((turning**2).sum(0) / max(len(turning), 1))])

    def sizes_of(self, coefficients: np.ndarray) -> dict[str, float]:
        """m/s^2 RMS that each group of the background does with these coefficients (Q,)."""
        background = self.background
        return {g: float(np.hypot(rms(background.force[..., at] @ coefficients[at]),
                                  turning_size(background.torque[..., at] @ coefficients[at], self.arm)))
                for g in background.groups for at in [background.group == g]}

    def _climb(self, start: dict[str, float], spike: np.ndarray) -> dict[str, float]:
        """Amplitudes of most evidence times prior, one after the other on the grid."""
        best, found = -np.inf, dict(start)
        for _ in range(3):
            moved = False
            for group in found:
                options = [v for v in GRID if v <= CAPS.get(group, 9.0)]
                place = int(np.argmin([abs(v - found[group]) for v in options]))
                if best == -np.inf:
                    best = self._score(found, spike)
                for step in (1, -1):
                    at = place + step
                    while 0 <= at < len(options):
                        score = self._score({**found, group: options[at]}, spike)
                        if score <= best + 1e-9:
                            break
                        best, moved = score, True
                        found[group] = options[at]
                        at += step
            if not moved:
                break
        return found

    def _score(self, amplitudes: dict[str, float], spike: np.ndarray) -> float:
        prior = sum(-0.5 * (v / MEANS[g]) ** 2 if g in LEVELS else -v / MEANS[g] for g, v in amplitudes.items())
        left, determinant = self.without_background(amplitudes)
        return self.reduced(left, spike)[1] - determinant + prior

    def allowed(self, chosen: Sequence[int]) -> bool:
        """No term twice, and one of each family at most."""
        names = [self.effects[i].term for i in chosen]
        return (not self.given_up.intersection(names) and len(set(names)) == len(names)
                and all(len(f.intersection(names)) < 2 for f in FAMILIES))

    def log_prior(self, chosen: Sequence[int]) -> float:
        """Log prior of a set minus that of the empty set: readings of one term share its probability."""
        terms = [self.effects[i].term for i in chosen]
        each = [COVERS.get(t, 1) / sum(e.term == t for e in self.effects) for t in terms]
        return sum(float(np.log(PRIOR / (1.0 - PRIOR) * share)) for share in each)

    def give_up(self, terms: set[str]) -> None:
        """Give up terms that explain nothing although the residual has a part along them: in every set, their error is
        free."""
        self.given_up |= terms
        self.spike[[self.effects[i].term in terms for i in self.owner]] = FREE
        self._reduce()
        self.weigh()

    def weigh(self, further: int = 60) -> None:
        """Evidence of all sets of one and two effects, and of three that the most probable pairs grow into."""
        self.sets = {(): self.weighed(())[0]}
        numbers = range(len(self.effects))

        def add(chosen: tuple[int, ...]) -> None:
            if self.allowed(chosen):
                self.score(chosen)

        for many in (1, 2):
            for chosen in itertools.combinations(numbers, many):
                add(chosen)
        for _ in range(MOST - 2):
            size = max(len(s) for s in self.sets)
            grown = sorted((s for s in self.sets if len(s) == size), key=lambda s: -self.sets[s])[:further]
            for chosen in grown:
                for i in numbers:
                    if i not in chosen:
                        add(tuple(sorted((*chosen, i))))

    def posterior(self) -> dict[tuple[int, ...], float]:
        """Probability of every set that was weighed."""
        log = np.array(list(self.sets.values()))
        p = np.exp(log - np.logaddexp.reduce(log))
        return dict(zip(self.sets, p.tolist(), strict=True))


def _both(share: np.ndarray, pushed: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """(P,) variance of the size of a disturbance, whose force and moment have to be imitated at once. A tilt of the
    markers is no wind, which also turns the vehicle. ``share``: of the force; ``pushed``, ``turned``: what imitates
    either."""
    told = share**2 / np.maximum(pushed, 1e-12) + (1.0 - share) ** 2 / np.maximum(turned, 1e-12)
    return np.asarray(1.0 / np.maximum(told, 1e-12))


def _log_between(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Log probability of a standard normal number between two limits, also far out."""
    low, high = np.where(low > 0.0, -high, low), np.where(low > 0.0, -low, high)  # the left tail has small numbers
    most = log_ndtr(high)
    return np.asarray(most + np.log1p(-np.exp(np.minimum(log_ndtr(low) - most, -1e-12))))


def _factor(normal: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Cholesky factor of D normal D + 1."""
    inner = normal * deviation[:, None] * deviation
    inner[np.diag_indices_from(inner)] += 1.0
    return np.linalg.cholesky(inner)


def _log_weights(scales: np.ndarray) -> np.ndarray:
    one = np.array(SCALES) / WIDTH
    log = np.log(one / (1.0 + one**2))
    log -= np.logaddexp.reduce(log)
    return np.asarray(log[np.searchsorted(SCALES, scales)].sum(axis=1))


__all__ = ["FIXED", "Evidence"]
