"""Which cause explains a change of the trim: likelihood of each hypothesis, averaged over the sizes it may have.

The mean trim of the examined flights, minus that of the normal flights, follows a Student distribution around the
prediction of a hypothesis. Its spread is that between normal flights, which differ more from day to day than their rows
show. Flights flown in a row share the day, so many of them count as one. A few normal flights determine their spread
poorly. It is therefore combined with the spread of flights of other vehicles of the type (PRIOR), as two estimates with
their degrees of freedom. A hypothesis with more freedom spreads its prior thinner and so pays for it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
from scipy.special import logsumexp
from scipy.stats import multivariate_t

from nanobench_tools.settings import number, setting

from .causes import CAUSES, Body, Hypothesis
from .trim import Trim

PRIOR = setting("mismatch.weigh.prior")
SAME_DAY_SD = number("mismatch.weigh.same_day_sd")
SWINGS_BY_CHANCE = number("mismatch.weigh.swings_by_chance")
GROUPS = tuple(PRIOR)
NONE = "none"


@dataclass(frozen=True)
class Normal:
    """mean, sd of a flight and degrees of freedom per quantity; n flights, 0 for a simulator; names; known_lift:
    whether all had a measured battery. Channels that a flight lacks are nan in the mean."""

    mean: Mapping[str, np.ndarray]
    sd: Mapping[str, float]
    freedom: Mapping[str, float]
    n: int
    names: tuple[str, ...]
    known_lift: bool


@dataclass(frozen=True)
class Weighed:
    """probability of each hypothesis (none is the last); delta per quantity; sd of the difference; draws: weights of
    each hypothesis's draws (n,), or None."""

    hypotheses: tuple[Hypothesis | None, ...]
    probability: np.ndarray
    log_likelihood: np.ndarray
    delta: Mapping[str, np.ndarray]
    sd: Mapping[str, float]
    weights: tuple[np.ndarray | None, ...]
    known_lift: bool

    def of(self, *causes: str) -> float:
        """Probability of any of ``causes`` (``none`` too)."""
        return float(sum(p for h, p in zip(self.hypotheses, self.probability, strict=True)
                         if (NONE if h is None else h.cause) in causes))

    def by_cause(self) -> dict[str, float]:
        return {name: self.of(name) for name in (*CAUSES, NONE)}

    def without(self, causes: Collection[str]) -> Weighed:
        """The same if other information excludes some causes."""
        keep = [h is None or h.cause not in causes for h in self.hypotheses]
        left = self.probability[keep]
        return replace(self, hypotheses=tuple(compress(self.hypotheses, keep)), probability=left / left.sum(),
                       log_likelihood=self.log_likelihood[keep], weights=tuple(compress(self.weights, keep)))


def normal_of(trims: Sequence[Trim], same_day: bool = False) -> Normal:
    """Mean and spread of normal flights: two at least, since one has no spread. ``same_day``: the examined flights are
    from the same day, with the same motors and propellers."""
    values = {name: np.array([getattr(t, name) for t in trims]) for name in GROUPS}
    mean, sd, freedom = {}, {}, {}
    lift = all(t.known_lift for t in trims)
    for name, rows in values.items():
        mean[name] = rows.mean(axis=0)
        left = _shares(rows - mean[name]) if name == "gains" and not lift else rows - mean[name]
        seen = left[:, ~np.isnan(mean[name])] if name != "gains" or lift else left
        usual, weight = PRIOR[name]
        usual = SAME_DAY_SD if same_day and name == "gains" else usual
        freedom[name] = weight + (len(trims) - 1) * seen.shape[1]
        sd[name] = float(np.sqrt((weight * usual**2 + (seen**2).sum()) / freedom[name]))
    return Normal(mean, sd, freedom, len(trims), tuple(t.name for t in trims), lift)


def _shares(gains: np.ndarray) -> np.ndarray:
    """(..., 4) -> (..., 3) orthonormal contrasts among the motors, without their common part."""
    contrasts = np.array([[-1, -1, 1, 1], [-1, 1, 1, -1], [-1, 1, -1, 1]]) / 2.0
    return gains @ contrasts.T


def hypotheses_of(body: Body) -> list[Hypothesis]:
    """Every way every cause may act."""
    return [h for cause in CAUSES.values() for h in cause.make(body)]


def weigh(trims: Sequence[Trim], normal: Normal, body: Body) -> Weighed:
    """Probabilities of all hypotheses given the flights ``trims``."""
    delta = {name: np.mean([getattr(t, name) for t in trims], axis=0) - normal.mean[name] for name in GROUPS}
    own = {name: np.sqrt(np.mean([np.nanmean(t.sd[name] ** 2) if not np.isnan(t.sd[name]).all() else 0.0
                                  for t in trims]) / len(trims)) for name in GROUPS}
    both = np.sqrt(1.0 + 1.0 / normal.n) if normal.n else 1.0
    sd = {name: float(np.hypot(normal.sd[name] * both, own[name])) for name in GROUPS}
    return weigh_change(delta, sd, normal, body, normal.known_lift and all(t.known_lift for t in trims))


def weigh_change(delta: Mapping[str, np.ndarray], sd: Mapping[str, float], normal: Normal, body: Body,
                 known_lift: bool = True, known: Sequence[Hypothesis] | None = None) -> Weighed:
    """``weigh`` of a change as numbers; known: ``hypotheses_of(body)``, where it is made once for many."""
    hypotheses: list[Hypothesis | None] = [*(hypotheses_of(body) if known is None else known)]
    hypotheses = [h for h in hypotheses if h is not None and h.cause not in body.absent]
    priors = [CAUSES[h.cause].prior * h.share for h in hypotheses if h is not None]
    hypotheses.append(None)
    priors.append(1.0 - sum(c.prior for c in CAUSES.values()))
    logs, weights = [], []
    for h in hypotheses:
        each = _log_density(delta, sd, normal.freedom, h, known_lift)
        if body.swing is not None and (h is None or h.cause != "slung"):
            each = each + np.log(SWINGS_BY_CHANCE)
        elif h is not None:
            each = each + np.log(h.seen)
        most = each.max()
        shares = np.exp(each - most)  # scipy's logsumexp is ten times slower on arrays this small
        logs.append(most + np.log(shares.mean()))
        weights.append(shares / shares.sum() if h is not None and h.sizes else None)
    log_likelihood = np.array(logs)
    posterior = log_likelihood + np.log(priors)
    probability = np.exp(posterior - logsumexp(posterior))
    return Weighed(tuple(hypotheses), probability, log_likelihood, delta, sd, tuple(weights), known_lift)


def _log_density(delta: Mapping[str, np.ndarray], sd: Mapping[str, float], freedom: Mapping[str, float],
                 h: Hypothesis | None, known_lift: bool) -> np.ndarray:
    """(n,) of the draws of a hypothesis."""
    total: np.ndarray = np.zeros(1)
    for name in GROUPS:
        shift = getattr(h, name, None) if h is not None else None
        away = delta[name] - (np.zeros((1, len(delta[name]))) if shift is None else shift)
        if name == "gains" and not known_lift:
            away = _shares(away)
        away = away[:, ~np.isnan(away[0])]
        k = away.shape[1]
        if not k:
            continue
        wide = np.hypot(sd[name], h.spread.get(name, 0.0) if h is not None else 0.0)
        total = total + multivariate_t.logpdf(away, np.zeros(k), wide**2 * np.eye(k), freedom[name])
    return total


def quantiles(values: np.ndarray, weights: np.ndarray) -> tuple[float, float, float]:
    """(median, 2.5 %, 97.5 %) of weighted draws."""
    low, middle, high = np.quantile(values, [0.025, 0.5, 0.975], weights=weights, method="inverted_cdf")
    return float(middle), float(low), float(high)
