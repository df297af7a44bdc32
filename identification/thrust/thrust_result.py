"""The content of thrust.json: one part for stand series, one for flights, and what stands above both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nanobench_tools.retiming.votes import evidence_of

from .electrical import battery_resistance, motor_constants
from .error_tables import (
    Scored,
    basis_words,
    inverse_table,
    leave_one_out,
    pair_with_firmware,
    points,
    propeller_mates,
    scored,
)
from .firmware import PLUS
from .flight_fit import FlightModel, find_delay
from .flight_levels import level_rows, weight_row
from .prediction_intervals import in_turn
from .stand_fit import Fit
from .stand_series import Stand
from .thrust_model import ThrustModel
from .thrust_rows import Case, fit_to_fly, flown_rows
from .thrust_study import Study, study

Cases = Sequence[Case]
DRAWN_THRUSTS = 9


@dataclass
class Part:
    """One kind: rows of the table, entries per file, and everything about the chosen map."""

    kind: str
    found: Study
    rows: list[dict[str, Any]]
    per_file: list[dict[str, Any]]
    note: str
    body: dict[str, Any] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)

    @property
    def best(self) -> str | None:
        return self.found.best

    def to_json(self) -> dict[str, Any]:
        """The part's entry under its kind."""
        troubles = {name: fit.trouble for name, fit in self.found.fits.items() if fit.trouble}
        held = {name: score.rms for name, score in self.found.scores.items()}
        return {"best": self.best, "split": self.note, "no_result": troubles, "held_out_rms": held,
                "parameters": self.found.parameters(), "per_file": self.per_file, **self.body}


def stand_part(train: Sequence[Stand], test: Sequence[Stand] | None, mass_kg: float, seed: int) -> Part:
    """Maps fitted to ``train`` and scored on ``test``; without ``test`` every series is held out in turn."""
    found = study(train, mass_kg, seed)
    results = scored(found, train, "train")
    body: dict[str, Any] = {}
    if test is None:
        tested, body["held_out"] = leave_one_out(train, mass_kg, seed)
        note = f"each of {len(train)} series predicted without it" if len(train) > 1 else "PWM bands of the one series"
        against = "chosen"
    else:
        tested, against = scored(found, test, "test"), ""
        for row in tested:
            row.given = basis_words([propeller_mates(s, train) for s in row.files])
        note = f"{len(train)} series train, {len(test)} test, as given"
    part = _part("stand", found, [*results, *tested], note, mass_kg, seed)
    part.body |= body
    part.body["against_firmware"] = pair_with_firmware(part.per_file, against or str(found.best))
    best = found.fits.get(found.best or "")
    part.body["series"] = [_series(s, best if isinstance(best, Fit) else None, seed)
                           for s in {id(s): s for s in (*train, *(test or ()))}.values()]
    return part


def flight_part(train: Cases, test: Cases, mass_kg: float, seed: int, clock: str, note: str) -> Part | None:
    """Maps fitted to the flights of ``train`` and scored on those of ``test``; None if none of ``train`` can be
    used."""
    train = fit_to_fly(train)
    if not train:
        return None
    delay = find_delay(train, mass_kg)
    flown = flown_rows(train, delay)
    others = flown_rows(test, delay)
    found = study(flown.files, mass_kg, seed)
    results = [*scored(found, flown.files, "train"), *(scored(found, others.files, "test") if others.files else [])]
    if others.files:
        results.append(weight_row(others.files, "test"))
    for name in dict.fromkeys((found.best, _plain_best(found), f"scaled_{PLUS.name}")):
        if name is not None and others.files:
            results += level_rows(found, name, others.files, "test")
    part = _part("flight", found, results, note, mass_kg, seed)
    for row in part.rows:
        row["uses"] += f"; inputs delayed by {delay:.2f} s"
        row |= {"clock": clock, "clock_evidence": evidence_of(flight for flight, _ in (*train, *test))}
    held = {name: in_turn(score.errors, len(found.train), found.sessions) for name, score in found.scores.items()}
    part.body |= {"delay_s": delay, "sessions": found.sessions, "held_out_coverage95": held,
                  "best_without_memory": _plain_best(found), "clock": clock, "mass_kg": mass_kg,
                  "against_firmware": pair_with_firmware(part.per_file, str(found.best))}
    part.reasons = flown.reasons | others.reasons
    return part


def _plain_best(found: Study) -> str | None:
    """The best, by held-out training flights, of the maps that are given the inputs of the moment alone."""
    plain = {name: score.rms for name, score in found.scores.items()
             if isinstance(model := found.candidates[name], FlightModel) and not model.kind and model.map.fixed is None
             and not found.fits[name].trouble}
    return min(plain, key=plain.__getitem__) if plain else None


def _part(kind: str, found: Study, results: Sequence[Scored], note: str, mass_kg: float, seed: int) -> Part:
    part = Part(kind, found, [r.row(seed) for r in results], [e for r in results for e in r.per_file()], note)
    if found.best is None:
        return part
    model = ThrustModel(mass_kg=mass_kg, seed=seed).use(found)
    exported = model.export()
    volts = np.concatenate([f.voltage for f in found.train])
    low, high = (float(np.quantile(volts, q)) for q in (0.02, 0.98)) if np.isfinite(volts).all() else (4.0, 4.0)
    voltages = sorted({round(float(v), 2) for v in np.linspace(low, high, 5)})
    most = float(model.predict(1.0, voltages[-1]))
    files = [(f, "train") for f in found.train] + [
        (f, "test") for r in results if r.name == found.best and r.split == "test" for f in r.files
        if all(f is not t for t in found.train)]
    part.body |= {
        "interval_half_width": found.half_width[found.best], "scale": model.scale_,
        "inverse": inverse_table(model, voltages, np.linspace(0.0, most, DRAWN_THRUSTS + 1)[1:]),
        "terms": [dict(t) for t in exported.terms], "terms_rms_N": exported.rms_N, "toml": exported.toml(),
        "firmware": exported.firmware, "firmware_note": exported.note,
        "points": [points(found.fits[found.best], f, split) for f, split in files],
        "curves": _curves(model, voltages)}
    return part


def _curves(model: ThrustModel, voltages: Sequence[float]) -> list[dict[str, Any]]:
    pwm = np.linspace(0.0, 1.0, 51)
    return [{"voltage_V": v, "pwm": pwm, "thrust_N": model.predict(pwm, v)} for v in voltages]


def _series(stand: Stand, fit: Fit | None, seed: int) -> dict[str, Any]:
    return {"file": stand.name, "rows": len(stand), "still": stand.still, "zero_N": stand.zero_N,
            "zero_rows": stand.zero_rows, "notes": list(stand.notes),
            "constants": motor_constants(fit, stand) if fit else {},
            "battery_resistance": battery_resistance(stand, seed)}


def whole(parts: Sequence[Part], left_out: Mapping[str, str]) -> dict[str, Any]:
    """The keys of thrust.json. With both kinds ``best`` and ``parameters`` are those of the flights: that is what
    flies; each part has its own under its kind."""
    first = next((p for p in parts if p.kind == "flight"), parts[0])
    return {"rows": [row for p in parts for row in p.rows], "best": first.best,
            "parameters": first.found.parameters(), **{p.kind: p.to_json() for p in parts},
            "left_out": [{"flight": name, "reason": reason} for name, reason in left_out.items()]}
