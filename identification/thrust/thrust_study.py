"""All candidates on one training set: fitted, held out file by file, one chosen, intervals by drawing sessions
and files.

The same for stand series (thrust per motor, N) and flights (specific force along body z, m/s^2).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import cast

import numpy as np

from nanobench_tools.metrics.statistics import refit_weights, session_count, why_not
from nanobench_tools.protocols.sessions import labels_of
from nanobench_tools.results.fitted_values import Estimate
from nanobench_tools.settings import count, number

from .choose import NO_WORSE, NO_WORSE_ONE_FILE, HeldOut, choose
from .flight_fit import FlightFit, FlightModel, fit_flights, models
from .flight_rows import Flown
from .maps import MAPS, Map, Numbers
from .prediction_intervals import half_width, sessions, widened
from .stand_fit import Fit, fit_stands
from .stand_series import Stand

File = Stand | Flown
AnyFit = Fit | FlightFit

BANDS = count("thrust.thrust_study.bands")

MOST_FOLDS = count("thrust.thrust_study.most_folds")

BLOCKS = 20
"""Pieces of the only file of a training set that a bootstrap draws from."""

ONE_FILE_SHARE = number("thrust.thrust_study.one_file_share")

DRAWS = 100
DRAWN_ROWS = 3000


def is_flown(files: Sequence[File]) -> bool:
    return isinstance(files[0], Flown)


def target(file: File) -> np.ndarray:
    """(n,) what is predicted: N per motor of a stand series, m/s^2 of a flight."""
    return file.force if isinstance(file, Flown) else file.thrust_N


def predicted(fit: AnyFit, file: File) -> np.ndarray:
    """(n,) the same from a fit."""
    return fit.predict(cast("Flown", file)) if isinstance(fit, FlightFit) else fit.predict(file.u, file.voltage)


def errors(fit: AnyFit, file: File) -> np.ndarray:
    """(n,) prediction minus measurement."""
    return np.asarray(predicted(fit, file) - target(file))


def fit_any(candidate: Map | FlightModel, files: Sequence[File], weights: Numbers | None = None,
            start: Sequence[float] | None = None) -> AnyFit:
    if isinstance(candidate, FlightModel):
        return fit_flights(candidate, cast("Sequence[Flown]", files), weights, start)
    return fit_stands(candidate, cast("Sequence[Stand]", files), weights, start)


def folds_of(files: Sequence[File]) -> list[tuple[list[File], list[File]]]:
    """(train, held out) pairs: whole files in turn, at most MOST_FOLDS groups of flights; pieces of an only file."""
    if len(files) > 1:
        groups = min(len(files), MOST_FOLDS) if is_flown(files) else len(files)
        return [([f for i, f in enumerate(files) if i % groups != g], list(files[g::groups])) for g in range(groups)]
    only = files[0]
    order = only.time_s if isinstance(only, Flown) else only.u
    piece = np.searchsorted(np.quantile(order, np.linspace(0.0, 1.0, BANDS + 1)[1:-1]), order, side="right")
    inside = [piece == b for b in range(BANDS)]
    return [([only.rows(~rows)], [only.rows(rows)]) for rows in inside if 0 < rows.sum() < len(only)]


def held_out(candidate: Map | FlightModel, folds: Sequence[tuple[list[File], list[File]]],
             start: Sequence[float] | None) -> HeldOut:
    """The candidate fitted without each fold and scored on it."""
    found, trouble = [], ""
    for train, rest in folds:
        fit = fit_any(candidate, train, None, start)
        if not fit.values or fit.trouble.startswith("no battery"):
            return HeldOut((), float("nan"), fit.trouble)
        trouble = trouble or fit.trouble
        found += [errors(fit, f) for f in rest]
    weights = [1.0 if not is_flown(folds[0][1]) else len(e) for e in found]
    mean_square = np.average([np.mean(e**2) for e in found], weights=weights)
    return HeldOut(tuple(found), float(np.sqrt(mean_square)), trouble)


@dataclass(frozen=True)
class Study:
    """Everything found on one training set. fits and scores by name of model; ``best``: the chosen one, None if no fit
    is a result; ``half_width``: of the prediction interval, N or m/s^2; ``draws``: values of refits to drawn files;
    ``sessions``: how many the files are of."""

    train: tuple[File, ...]
    candidates: Mapping[str, Map | FlightModel]
    fits: Mapping[str, AnyFit]
    scores: Mapping[str, HeldOut]
    best: str | None
    half_width: Mapping[str, float]
    draws: Mapping[str, tuple[Mapping[str, float], ...]]
    sessions: int = 1

    @property
    def folds(self) -> list[tuple[list[File], list[File]]]:
        """Training and held-out data, in the order of the held-out errors."""
        return folds_of(self.train)

    def width_at(self, name: str, file: File) -> float:
        """Half width of the interval of a row of ``file``: wider where refits to drawn flights disagree."""
        return widened(self.half_width[name], self.candidates[name], self.draws.get(name, ()), file)

    @property
    def flown(self) -> bool:
        return is_flown(self.train)

    def parameters(self) -> dict[str, dict[str, Estimate]]:
        """{model: {name: parameter}}, intervals by drawing sessions and files."""
        return {name: {key: self._parameter(name, key, value, candidate.units[key])
                       for key, value in self.fits[name].values.items()}
                for name, candidate in self.candidates.items() if self.fits[name].values}

    def _parameter(self, name: str, key: str, value: float, unit: str) -> Estimate:
        ends = self._interval(name, key)
        return Estimate(value, ends, unit,
                        self.why or ("" if ends else "nothing fitted, or refits to drawn files fail"))

    @property
    def why(self) -> str:
        """Why intervals of parameters are missing or not to be trusted; empty where they are sound."""
        few = {1: "one file", 2: "two files, drawn in three ways only"}.get(len(self.train), "")
        return few or why_not(len(self.train), labels_of(self.train) if self.flown else None)

    def _interval(self, name: str, key: str) -> tuple[float, float] | None:
        drawn = [d[key] for d in self.draws.get(name, ()) if np.isfinite(d.get(key, np.nan))]
        if len(drawn) < DRAWS // 2 or len(self.train) < 3 or (self.flown and session_count(labels_of(self.train)) == 1):
            return None
        low, high = np.percentile(drawn, [2.5, 97.5])
        return float(low), float(high)


def study(train: Sequence[File], mass_kg: float, seed: int = 0, draws: int = DRAWS) -> Study:
    """Every candidate on ``train`` (all stand series or all flights)."""
    candidates: dict[str, Map | FlightModel] = dict(models(mass_kg)) if is_flown(train) else dict(MAPS)
    fits = {name: fit_any(c, train) for name, c in candidates.items()}
    folds = folds_of(train)
    scores = {name: held_out(c, folds, getattr(fits[name], "shape", None) or None) for name, c in candidates.items()}
    spread = float(np.std(np.concatenate([target(f) for f in train])))
    best = choose(fits, scores, NO_WORSE if len(train) > 1 else NO_WORSE_ONE_FILE, spread)
    unseen = ONE_FILE_SHARE * float(np.max(target(train[0]))) if len(train) == 1 else 0.0
    groups = sessions([f.epoch_s if isinstance(f, Flown) else 0.0 for f in train])
    widths = {name: half_width(score.errors, len(train), unseen, groups) for name, score in scores.items()}
    drawn = {name: bootstrap(c, fits[name], train, seed, draws) for name, c in candidates.items()}
    return Study(tuple(train), candidates, fits, scores, best, widths, drawn, groups)


def bootstrap(candidate: Map | FlightModel, fit: AnyFit, train: Sequence[File], seed: int,
              draws: int) -> tuple[Mapping[str, float], ...]:
    """Values of refits to resampled sessions and files within them, or to blocks of rows of a single file. Empty for
    maps without fitted parameters and for invalid fits."""
    if not fit.values or not candidate.size or not draws or fit.trouble.startswith(("no ", "not ")):
        return ()
    pieces: list[File] = list(train)
    if len(pieces) == 1:
        bounds = np.linspace(0, len(pieces[0]), BLOCKS + 1).astype(int)
        pieces = [pieces[0].rows(slice(a, b)) for a, b in pairwise(bounds) if b > a]
    thin = -(-sum(map(len, pieces)) // DRAWN_ROWS)
    pieces = [p.rows(slice(None, None, thin)) for p in pieces]
    counts = refit_weights(len(pieces), labels_of(train) if len(train) > 1 else None, seed, draws)
    return tuple(fit_any(candidate, pieces, count, fit.shape or None).values for count in counts)
