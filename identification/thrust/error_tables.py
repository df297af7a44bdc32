"""Rows of the result: errors of every model on training and held-out files, and of single files."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from nanobench_tools.metrics.statistics import design_effect, pooled_interval
from nanobench_tools.protocols.sessions import Drawn, labels_of
from nanobench_tools.settings import number

from .error_rows import AgainstFirmware, ChosenWithout, ErrorRow, FileError, InverseTable, OwnBands, Points
from .firmware import LEGACY, PLUS
from .flight_fit import BALANCED, FlightModel
from .flight_rows import Flown
from .stand_series import Stand
from .thrust_study import AnyFit, File, Study, errors, is_flown, predicted, study

SAME_PROPELLER = number("thrust.error_tables.same_propeller")

POINTS = 300
"""Rows of a file kept for pictures."""


class Scored:
    """Errors of one model on files: [(file, errors (n,))], the fits they came from may differ (held out in turn)."""

    def __init__(self, name: str, split: str, uses: str, status: str, given: str = "") -> None:
        self.name, self.split, self.uses, self.status, self.given = name, split, uses, status, given
        self.files: list[File] = []
        self.errors: list[np.ndarray] = []
        self.widths: list[float] = []

    def add(self, file: File, found: np.ndarray, width: float) -> None:
        self.files.append(file)
        self.errors.append(found)
        self.widths.append(width)

    def row(self, seed: int) -> ErrorRow:
        """The row of the table."""
        flown = is_flown(self.files)
        squares = np.array([np.sum(e**2) for e in self.errors])
        counts = np.array([len(e) for e in self.errors])
        labels = labels_of(self.files)
        interval, effect = pooled_interval(squares, counts, labels, seed), design_effect(squares / counts, labels)
        ends = interval.ends()
        rms = float(np.sqrt(squares.sum() / counts.sum()))
        inside = sum(int(np.sum(np.abs(e) <= w)) for e, w in zip(self.errors, self.widths, strict=True))
        known = all(np.isfinite(w) for w in self.widths)
        return ErrorRow(
            self.name, self.split, "flight" if flown else "stand", None if flown else rms, rms if flown else None,
            int(counts.sum()), len(self.files), None if ends is None else (math.sqrt(ends[0]), math.sqrt(ends[1])),
            Drawn(interval.sessions, {"rms_m_s2" if flown else "rms_N": None if effect is None else float(effect)},
                  interval.why), float(np.concatenate(self.errors).mean()),
            inside / float(counts.sum()) if known else None, self.status, self.uses, self.given,
            self._covered_files() if known else None)

    def _covered_files(self) -> float:
        """Share of the files with nine tenths of their rows inside the interval."""
        return float(np.mean([np.mean(np.abs(e) <= w) >= 0.9 for e, w in zip(self.errors, self.widths, strict=True)]))

    def per_file(self) -> list[FileError]:
        """One entry per file."""
        flown = is_flown(self.files)
        rms = [float(np.sqrt(np.mean(e**2))) for e in self.errors]
        return [FileError(f.name, self.name, self.split, None if flown else x, x if flown else None, float(e.mean()),
                          len(e)) for f, e, x in zip(self.files, self.errors, rms, strict=True)]


def scored(found: Study, files: Sequence[File], split: str) -> list[Scored]:
    """Every model of a study on ``files``; models without values are left out (their fits say why)."""
    return [result for name in found.candidates if (result := score(found, name, files, split)).files]


def score(found: Study, name: str, files: Sequence[File], split: str) -> Scored:
    """One model on the files that have what it needs."""
    candidate, fit = found.candidates[name], found.fits[name]
    result = Scored(name, split, uses(candidate), fit.trouble or "ok", getattr(candidate, "given", ""))
    for file in files:
        if fit.values and can_predict(candidate, file):
            result.add(file, errors(fit, file), found.width_at(name, file))
    return result


def can_predict(candidate: Any, file: File) -> bool:
    """Whether ``file`` has the voltage and the velocity a model needs."""
    if isinstance(file, Stand):
        return file.battery_V is not None or not candidate.uses_voltage
    return file.moving or not candidate.effects


def uses(candidate: Any) -> str:
    """What a model is and takes, in words."""
    return candidate.uses if isinstance(candidate, FlightModel) else candidate.equation


def leave_one_out(stands: Sequence[Stand], mass_kg: float, seed: int) -> tuple[list[Scored], dict[str, ChosenWithout]]:
    """(every model on every series, fitted without it; the training series and the chosen map of each).

    A series is predicted from others of the same propeller (identified by thrust per squared rotor speed, if
    measured), else from all others. The only series is predicted from its other PWM bands.
    """
    results: dict[str, Scored] = {}
    chosen: dict[str, ChosenWithout] = {}
    for out in stands:
        others = [s for s in stands if s is not out]
        same = [s for s in others if same_propeller(s, out)]
        basis = same or others
        found = study(basis or [out], mass_kg, seed, draws=0)
        chosen[out.name] = ChosenWithout(found.best, tuple(s.name for s in basis),
                                         bool(same) if np.isfinite(out.thrust_per_speed2) else None,
                                         None if same else own_bands(out, mass_kg, seed))
        for name, candidate in found.candidates.items():
            fit = found.fits[name]
            result = results.setdefault(name, Scored(name, "test", uses(candidate), "ok"))
            if not fit.values or not can_predict(candidate, out):
                continue
            if fit.trouble:
                result.status = f"without {out.name}: {fit.trouble}"
            missed = errors(fit, out) if basis else np.concatenate(found.scores[name].errors)
            result.add(out, missed, found.half_width[name])
        picked = results.setdefault("chosen", Scored("chosen", "test", "the map chosen without the file", "ok"))
        if found.best:
            missed = errors(found.fits[found.best], out) if basis else np.concatenate(found.scores[found.best].errors)
            picked.add(out, missed, found.half_width[found.best])
    for result in results.values():
        result.given = basis_words([propeller_mates(f, [s for s in stands if s is not f]) for f in result.files])
    return [r for r in results.values() if r.files], chosen


def propeller_mates(stand: File, train: Sequence[File]) -> int:
    """Number of training series with the propeller of the series ``stand``; 0 if unknown."""
    return sum(isinstance(s, Stand) and isinstance(stand, Stand) and same_propeller(s, stand) for s in train)


def basis_words(mates: Sequence[int]) -> str:
    """Data of the fits of a row's series, by the number of other series with the same propeller.

    >>> basis_words([1, 1, 0])
    '2 of 3 series: one other series of their propeller, whose battery and motors need not be theirs; 1 of 3: none'
    """
    sentences = {0: "none", 1: "one other series of their propeller, whose battery and motors need not be theirs"}
    found = [f"{mates.count(k)} of {len(mates)}: {sentences.get(k, f'{k} series of their propeller')}"
             for k in sorted(set(mates), reverse=True)]
    return "; ".join([found[0].replace(":", " series:", 1), *found[1:]]) if found else ""


def own_bands(stand: Stand, mass_kg: float, seed: int) -> OwnBands:
    """Of one series."""
    found = study([stand], mass_kg, seed, draws=0)
    theirs = [s.rms for n, s in found.scores.items() if n.startswith("firmware") and np.isfinite(s.rms)]
    return OwnBands(found.best, found.scores[found.best].rms if found.best else None, min(theirs, default=None))


def same_propeller(a: Stand, b: Stand) -> bool:
    ratio = a.thrust_per_speed2 / b.thrust_per_speed2
    return bool(1.0 / SAME_PROPELLER < ratio < SAME_PROPELLER)


def points(fit: AnyFit, file: File, split: str) -> Points:
    """At most POINTS rows."""
    thin = -(-len(file) // POINTS)
    few = file.rows(slice(None, None, thin))
    predictions = predicted(fit, few)
    measured = few.force if isinstance(few, Flown) else few.thrust_N
    pwm = few.u.mean(axis=1) if isinstance(few, Flown) else few.u
    return Points(file.name, split, np.round(pwm, 4), np.round(few.voltage, 4), measured, predictions)


def inverse_table(model: Any, voltages: Sequence[float], thrusts: Sequence[float] | np.ndarray) -> InverseTable:
    """Of a fitted model."""
    found = model.inverse(np.asarray(thrusts)[None, :], np.asarray(voltages)[:, None])
    pwm = np.where(found.saturated | found.below, np.nan, found.pwm)
    return InverseTable(tuple(map(float, voltages)), tuple(map(float, thrusts)), found.limit_N[:, 0], pwm)


def pair_with_firmware(entries: Sequence[FileError], best: str) -> list[AgainstFirmware]:
    """The chosen map and the firmware's on every test file."""
    found = []
    kind = BALANCED if best.endswith(BALANCED) else ""
    tested = [e for e in entries if e.split == "test"]
    for name in dict.fromkeys(e.file for e in tested):
        of = {e.model: e.rms for e in tested if e.file == name}
        theirs = [of[f"firmware_{p.name}"] for p in (PLUS, LEGACY) if f"firmware_{p.name}" in of]
        scale = min((of[m] for p in (PLUS, LEGACY) if (m := f"scaled_{p.name}{kind}") in of), default=None)
        if best in of and theirs:
            found.append(AgainstFirmware(name, of[best], min(theirs), of[best] < min(theirs), scale,
                                         None if scale is None else of[best] < scale))
    return found
