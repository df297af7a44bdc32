"""Prior, evidence of the residual, and predictions of flights that were left out, together: how probable a set is.

Predictions take longer than evidence. So every term is predicted alone, at its most probable reading. Then follow the
sets that would be the most probable if the gains of their effects added up. Two effects often improve the same
prediction. A set that was not predicted has the gain of its best part that was, and the loss of its worst.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from nanobench_tools.settings import count, number

from .build import Case
from .left_out_flights import SLUGGISH
from .set_evidence import OFFSETS, SHARED
from .sizing import Refined, refine

Chosen = tuple[int, ...]
PREDICTED = count("posterior.weighing.predicted")
"""Sets of several that are predicted at most."""
NEGLIGIBLE = 1e-3
"""Probability below which it does not matter whether errors of terms cancel a set."""
REACH = number("posterior.weighing.reach")
"""Log odds below the most probable set, beyond which a set is not predicted."""
NO_SIZE = SLUGGISH.union(SHARED, OFFSETS)
"""Terms whose size predictions do not show: noisy commands favour them, or the flights of a session share them."""


@dataclass
class Weighing:
    """judge: log likelihood that predictions give the first sizes over the second."""

    case: Case
    judge: Callable[[Refined, Refined], float]
    told: dict[Chosen, float] = field(default_factory=dict)
    """Of sets that were predicted: log likelihood over no effect."""
    without: set[str] = field(default_factory=set)
    """Terms whose sets have no probability."""
    _sizes: dict[Chosen, Refined] = field(default_factory=dict)
    _gained: dict[int, float] = field(default_factory=dict)
    _against: dict[Chosen, bool] = field(default_factory=dict)

    def sizes(self, chosen: Chosen) -> Refined:
        """Kept."""
        if chosen not in self._sizes:
            alone = {i: self.sizes((i,)).step for i in chosen if len(chosen) > 1 and self.case.effects[i].far}
            self._sizes[chosen] = refine(self.case, chosen, alone)
        return self._sizes[chosen]

    def predict(self, chosen: Chosen) -> float:
        """Log likelihood of a set over no effect."""
        if chosen not in self.told:
            self.told[chosen] = self.judge(self.sizes(chosen), self.sizes(())) if chosen else 0.0
        return self.told[chosen]

    def gained(self, chosen: Chosen, which: int) -> float:
        """Log likelihood that predictions give the size of one effect of a set; 0 for NO_SIZE."""
        if self.case.effects[which].term in NO_SIZE:
            return 0.0
        return self.judge(self.sizes(chosen), self.sizes(tuple(i for i in chosen if i != which)))

    def score(self, chosen: Chosen) -> float:
        """Log probability, but for a constant."""
        told = self.told.get(chosen)
        if told is None:
            parts = [self.told.get(part, 0.0) for part in self._parts(chosen)]
            told = max(0.0, *parts) + min(0.0, *parts)
        return self.evidence(chosen) + told

    def evidence(self, chosen: Chosen) -> float:
        """Log of prior times evidence. An effect that acts far from linearly adds what its evidence alone gains by
        slopes taken where it ends."""
        far = [i for i in chosen if self.case.effects[i].far]
        return self.case.evidence.score(chosen) + sum(self._bent(i) for i in far)

    def _bent(self, effect: int) -> float:
        """Log evidence that an effect alone gains by slopes where it ends."""
        if effect not in self._gained:
            self._gained[effect] = self.sizes((effect,)).log - self.case.evidence.weighed((effect,))[0]
        return self._gained[effect]

    def _at_best(self, chosen: Chosen) -> float:
        """``score`` if the gains of all effects added up; a part of several that was predicted counts as it was."""
        parts = [part for part in self._parts(chosen) if len(part) > 1]
        bound = [self.told[part] + self._gains(set(chosen) - set(part)) for part in parts]
        return self.evidence(chosen) + min([self._gains(chosen), *bound])

    def _gains(self, effects: Iterable[int]) -> float:
        return sum(max(self.told.get((i,), 0.0), 0.0) for i in effects)

    def _parts(self, chosen: Chosen) -> list[Chosen]:
        """Parts of a set that were predicted, with no effect."""
        return [(), *(part for many in range(1, len(chosen)) for part in combinations(chosen, many)
                      if part in self.told)]

    def weigh(self) -> dict[Chosen, float]:
        """Probability of every set."""
        effects = self.case.effects
        known = {chosen: self.evidence(chosen) for chosen in self.case.evidence.sets
                 if not self.without & {effects[i].term for i in chosen}}
        alone = sorted((s for s in known if len(s) == 1), key=lambda s: known[s])
        for chosen in [(), *{effects[s[0]].term: s for s in alone}.values()]:
            self.predict(chosen)
        predicted = 0
        while predicted < PREDICTED:
            open_ones = [s for s in known if s not in self.told]
            most = max(open_ones, key=self._at_best, default=None)
            if most is None or self._at_best(most) < max(self.score(s) for s in self.told if s in known) - REACH:
                break
            if self._opposed(most):
                del known[most]
            else:
                self.predict(most)
                predicted += 1
        while True:
            log = np.array([self.score(s) for s in known])
            p = np.exp(log - np.logaddexp.reduce(log))
            opposed = [s for s, share in zip(known, p, strict=True) if share > NEGLIGIBLE and self._opposed(s)]
            if not opposed:
                return dict(zip(known, p.tolist(), strict=True))
            for chosen in opposed:
                del known[chosen]

    def _opposed(self, chosen: Chosen) -> bool:
        if chosen not in self._against:
            self._against[chosen] = self.case.evidence.any_opposed(chosen)
        return self._against[chosen]


__all__ = ["Weighing"]
