"""Second estimate of the identified parameters, fitted to multi-step predictions.

A robust least squares (soft L1) minimises the errors of position, velocity, attitude and rate at REFIT_HORIZONS, each
in units of its size. It includes per-flight offsets where flights scatter. Flights left out in turn judge it, as in
``proof.prove``. It is used only if it predicts them better than the first estimate. Commands answer disturbances, and
an open-loop prediction attributes the disturbances to them (Ljung 1999, System Identification, ch. 13). So a refit may
predict better and be further from the vehicle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from nanobench_tools import so3
from nanobench_tools.physics import Model
from nanobench_tools.settings import setting

from .decide import Decision
from .fitting import Slopes, fit
from .moments import Moments
from .naming import free_of
from .proof import (
    CLIP,
    FOLDS,
    HORIZONS,
    QUANTITIES,
    Proof,
    bounds_of,
    own_levels,
    prediction_errors,
    relative_intervals,
    rolled,
    window_starts,
)
from .space import LEVEL, MAPS, reduced, scales
from .track import ROW_S, Track

REFIT_HORIZONS = setting("mismatch.refit.refit_horizons")
WORDS = ("position", "velocity", "attitude", "rate")
"""QUANTITIES, in a sentence."""
STEP = 1e-3
"""Of a parameter's scale: difference quotients."""
GROUPS = 4 * len(REFIT_HORIZONS)
EVALUATIONS = 12
LEAST = setting("mismatch.refit.least")


@dataclass(frozen=True)
class Refitted:
    """``fitted``, ``refitted`` {parameter: value}, units. ``model``: the corrected simulator with the refitted values.
    ``compared``: errors (flights, H, 4) on flights left out. Its ``before`` is the first estimate, ``after`` the
    refit."""

    fitted: dict[str, float]
    refitted: dict[str, float]
    units: dict[str, str]
    model: Model
    compared: Proof

    @property
    def taken(self) -> bool:
        """Whether it predicts left-out flights better, by more than LEAST."""
        clearly = any(low > LEAST for h, (low, _) in self.compared.interval.items() if h > 1)
        return bool(self.compared.held_out and self.compared.better and clearly)

    @property
    def sentence(self) -> str:
        """For the terminal."""
        values = ", ".join(f"{name} {self.fitted[name]:.4g} -> {value:.4g} {self.units[name]}"
                           for name, value in self.refitted.items())
        ratios = self.compared.after.mean(0) / np.maximum(self.compared.before.mean(0), 1e-12)
        told = [f"{', '.join(f'{r:.3f} in {w}' for r, w in zip(ratios[HORIZONS.index(h)], WORDS, strict=True))} "
                f"after {h * ROW_S:g} s" for h in REFIT_HORIZONS]
        fate = ("taken into the corrected simulator: what gains most gains more than anything loses" if self.taken
                else "not taken: no better")
        return (f"Refitted to predictions {REFIT_HORIZONS[0] * ROW_S:g} and {REFIT_HORIZONS[-1] * ROW_S:g} s ahead "
                f"({values}): on {len(self.compared.flights)} flights left out in turn the errors are, of those of the "
                f"fit, {' and '.join(told)}; {fate}.")

    def to_json(self) -> dict[str, Any]:
        """``refit`` of verdict.json."""
        def row(errors: np.ndarray, k: int) -> dict[str, float | None]:
            return {q: float(x) if np.isfinite(x) else None for q, x in zip(QUANTITIES, errors.mean(0)[k], strict=True)}

        return {"parameters": {n: {"fitted": self.fitted[n], "refitted": v, "unit": self.units[n]}
                               for n, v in self.refitted.items()},
                "held_out": {str(h): {"fitted": row(self.compared.before, k), "refitted": row(self.compared.after, k),
                                      "relative_ci95": list(self.compared.interval[h])}
                             for k, h in enumerate(HORIZONS)},
                "flights": list(self.compared.flights), "taken": self.taken, "sentence": self.sentence}


def refit(moments: Moments, decision: Decision, proof: Proof, seed: int = 0) -> Refitted | str:
    """Identified effects, refitted to predictions; or the reason against it."""
    if not decision.findings:
        return "no effect was identified, so there is no refit"
    if decision.own:
        return "flights differ in the identified effect: each has a per-flight value, so there is no refit"
    if not proof.held_out:
        return "one flight alone cannot judge a refit"
    if moments.wrench.unasked:
        return "turning is not predicted, so there is no refit"
    return _Refit(moments, decision).result(proof, seed)


def misses(model: Model, track: Track) -> np.ndarray:
    """(windows, 3 GROUPS) errors as vectors: m, m/s, rad, rad/s at each of REFIT_HORIZONS."""
    starts = window_starts(track)
    if not len(starts):
        return np.zeros((0, 3 * GROUPS))
    states, parts = rolled(model, track, starts), []
    for h in REFIT_HORIZONS:
        end, state = starts + h, states[:, h]
        parts += [state[:, 0:3] - track.position_m[end], state[:, 3:6] - track.velocity_m_s[end],
                  so3.log(so3.multiply(so3.conjugate(state[:, 6:10]), track.quaternion[end])),
                  state[:, 10:13] - track.rate_rad_s[end]]
    return np.asarray(np.clip(np.concatenate(parts, axis=1), -CLIP, CLIP))


@dataclass
class _Refit:
    """The parameters of one decision; ``names`` of them, in the model of its space."""

    moments: Moments
    decision: Decision
    terms: list[str] = field(init=False)
    names: list[str] = field(init=False)

    def __post_init__(self) -> None:
        space = self.decision.space
        self.terms = [f.hypothesis.term for f in self.decision.findings]
        self.free = free_of(space, self.terms)
        self.names = [space.model.names[i] for i in self.free]
        self.scale = scales(space.model)[self.free]
        self.whole = bool(set(self.terms) & set(MAPS)) and not set(self.terms) & set(LEVEL)
        self.known = Slopes(self.moments)
        self.tracks = self.moments.wrench.tracks
        self.numbers = sorted({t.flight for t in self.tracks})

    def result(self, proof: Proof, seed: int) -> Refitted:
        space, fitted = self.decision.space, self.decision.fit.model
        change = self.best(self.levels(fitted), self.numbers)
        moved, after = self.moved(fitted, change), self.held_out()
        compared = Proof(proof.after, after, proof.flights, True, relative_intervals(proof.after, after, seed), None,
                         proof.models)
        units = dict(zip(space.model.names, space.model.units, strict=True))
        return Refitted({n: fitted.parameters[n] for n in self.names}, {n: moved.parameters[n] for n in self.names},
                        {n: units[n] for n in self.names}, reduced(moved, space.believed, tuple(self.terms)), compared)

    def levels(self, fitted: Model) -> list[Model]:
        """One model a flight."""
        return own_levels(self.known, self.decision.space, fitted, self.terms, self.whole)

    def moved(self, model: Model, change: np.ndarray) -> Model:
        return model.with_parameters({
            name: float(np.clip(model.parameters[name] + step * size, *bounds_of(model, name)))
            for name, step, size in zip(self.names, change, self.scale, strict=True)})

    def best(self, models: Sequence[Model], flights: Sequence[int]) -> np.ndarray:
        """Change of the parameters, in their scales, that predicts these flights best."""
        tracks = [t for t in self.tracks if t.flight in flights]

        def errors(change: np.ndarray) -> np.ndarray:
            return np.concatenate([misses(self.moved(models[self.numbers.index(t.flight)], change), t) for t in tracks])

        start = errors(np.zeros(len(self.names)))
        size = np.repeat(np.sqrt((start**2).reshape(-1, GROUPS, 3).mean(axis=(0, 2))), 3)
        weight = 1.0 / np.where(size > 0.0, size, np.inf)

        def slopes(change: np.ndarray) -> np.ndarray:
            return np.stack([((errors(change + STEP * e) - errors(change - STEP * e)) * weight / (2.0 * STEP)).ravel()
                             for e in np.eye(len(change))], axis=1)

        return np.asarray(least_squares(lambda c: (errors(c) * weight).ravel(), np.zeros(len(self.names)), jac=slopes,
                                        loss="soft_l1", max_nfev=EVALUATIONS).x)

    def held_out(self) -> np.ndarray:
        """(flights, H, 4) errors as of ``Proof.after``, refitted."""
        found = np.zeros((len(self.numbers), len(HORIZONS), 4))
        for left_out in [self.numbers[k::FOLDS] for k in range(min(FOLDS, len(self.numbers)))]:
            others = [n for n in self.numbers if n not in left_out]
            models = self.levels(fit(Slopes(self.moments, others), self.decision.fit.model, self.free).model)
            change = self.best(models, others)
            for number in left_out:
                k = self.numbers.index(number)
                found[k] = prediction_errors(self.moved(models[k], change),
                                             [t for t in self.tracks if t.flight == number], [number])[0]
        return found


__all__ = ["Refitted", "refit"]
