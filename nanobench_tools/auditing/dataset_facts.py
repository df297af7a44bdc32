"""A row of a table of data sets: rates, sensors, flights per trajectory, speeds, voltage and clock of recordings."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..flight import Flight, Span, intersect_spans, kept_apart, mask_of
from ..results.result import Result
from ..signals.derived_velocity import has_velocity, with_velocity
from ..sources.labels import family_of, speed_of
from .recording_audit import Audit

CLOCK = "imu"
BYTES_PER_MB = 1e6


@dataclass(frozen=True, repr=False)
class Spread(Result):
    """Median, standard deviation (n - 1), ends and number of one value per flight."""

    median: float
    sd: float
    low: float
    high: float
    n: int


@dataclass(frozen=True, repr=False)
class DatasetFacts(Result):
    """Copies count as recordings; ``flight_s`` is the time in the air.

    - size_MB: of the files, packed as they are.
    - rates_Hz: stream -> true rate of its samples; ``quantities``: stream -> what the recordings have of it.
    - trajectories: family -> speed -> flights.
    - top_speed_m_s, mean_speed_m_s: of the motion capture in clean stretches in the air.
    - voltage_V: lowest and highest in the air, over all flights.
    - offset_s: constant time error of the inertial sensor against the motion capture, one value per flight.
    """

    recordings: int
    copies: int
    sources: dict[str, int]
    size_MB: float
    length_s: float
    flight_s: float
    rates_Hz: dict[str, Spread]
    quantities: dict[str, tuple[str, ...]]
    trajectories: dict[str, dict[str, int]]
    reference_speed_m_s: Spread | None
    mean_speed_m_s: Spread | None
    top_speed_m_s: Spread | None
    voltage_V: tuple[float, float] | None
    offset_s: Spread | None


def facts_of(flights: Sequence[Flight], audits: Mapping[str, Audit], copies: Sequence[Sequence[str]]) -> DatasetFacts:
    """The facts of the flights that were audited."""
    found = [flight for flight in flights if flight.name in audits]
    rates: dict[str, list[float]] = {}
    quantities: dict[str, dict[str, None]] = {}
    trajectories: dict[str, Counter[str]] = {}
    mean, top, volts, offsets, wanted = [], [], [], [], []
    for flight in found:
        audit = audits[flight.name]
        for name, reading in audit.rates.items():
            if not kept_apart(name) and name in flight:
                rates.setdefault(name, []).append(reading.rate_hz)
                quantities.setdefault(name, {}).update(dict.fromkeys(flight[name].quantities))
        trajectories.setdefault(family_of(flight), Counter())[speed_of(flight) or "unknown"] += 1
        speed = _speeds(flight, audit)
        if len(speed):
            mean.append(float(speed.mean()))
            top.append(float(speed.max()))
        volts += _voltage(flight, audit)
        clock = audit.clock.get(CLOCK)
        if clock is not None and clock.identifiable:
            offsets.append(clock.offset_s)
        reference = flight.metadata.get("reference_speed_m_s")
        if isinstance(reference, int | float):
            wanted.append(float(reference))
    return DatasetFacts(
        len(found), sum(len(group) - 1 for group in copies),
        dict(Counter(f.provenance.source for f in found).most_common()), _size_mb(found),
        sum(f.duration_s for f in found), sum(s.duration_s for f in found for s in audits[f.name].airborne),
        {name: spread for name, values in rates.items() if (spread := spread_of(values)) is not None},
        {name: tuple(names) for name, names in quantities.items()},
        {family: dict(count) for family, count in sorted(trajectories.items())},
        spread_of(wanted), spread_of(mean), spread_of(top), (min(volts), max(volts)) if volts else None,
        spread_of(offsets))


def spread_of(values: Sequence[float]) -> Spread | None:
    """None without a finite value."""
    known = np.array([v for v in values if np.isfinite(v)])
    if not len(known):
        return None
    return Spread(float(np.median(known)), float(known.std(ddof=1)) if len(known) > 1 else float("nan"),
                  float(known.min()), float(known.max()), len(known))


def _speeds(flight: Flight, audit: Audit) -> np.ndarray:
    """(n,) m/s of clean rows in the air."""
    if "mocap" not in flight or len(flight["mocap"]) < 2 or "px" not in flight["mocap"]:
        return np.zeros(0)
    mocap = (flight if has_velocity(flight) else with_velocity(flight))["mocap"]
    if any(v not in mocap for v in ("vx", "vy", "vz")):
        return np.zeros(0)
    spans = intersect_spans(audit.airborne, audit.clean_for(["mocap"]))
    speed = np.linalg.norm(mocap["vx", "vy", "vz"][mask_of(spans, mocap.time_s)], axis=1)
    return np.asarray(speed[np.isfinite(speed)])


def _voltage(flight: Flight, audit: Audit) -> list[float]:
    if "battery" not in flight or "vbat" not in flight["battery"]:
        return []
    battery = flight["battery"]
    spans: tuple[Span, ...] = intersect_spans(audit.airborne, audit.clean_for(["battery"]))
    volts = battery["vbat"][mask_of(spans, battery.time_s)]
    volts = volts[np.isfinite(volts) & (volts > 0.0)]
    return [float(volts.min()), float(volts.max())] if len(volts) else []


def _size_mb(flights: Sequence[Flight]) -> float:
    total = 0
    for path in {Path(flight.provenance.path) for flight in flights}:
        parts = [p for p in path.rglob("*") if p.is_file()] if path.is_dir() else [path]
        total += sum(p.stat().st_size for p in parts if p.is_file())
    return total / BYTES_PER_MB


def rows_of(facts: Mapping[str, Any]) -> list[tuple[str, str]]:
    """(what, value) for a table, from the facts as JSON."""
    copies = f", {facts['copies']} of them copies" if facts["copies"] else ""
    rows = [("recordings", f"{facts['recordings']}{copies}"),
            ("sources", ", ".join(f"{name} {n}" for name, n in facts["sources"].items())),
            ("size", f"{facts['size_MB']:.1f} MB; {facts['length_s']:.0f} s, {facts['flight_s']:.0f} s in the air")]
    for name, rate in facts["rates_Hz"].items():
        rows.append((name, f"{_told(rate)} Hz: {', '.join(facts['quantities'][name])}"))
    for family, speeds in facts["trajectories"].items():
        rows.append((f"flights of {family}", ", ".join(f"{n} {speed}" for speed, n in speeds.items())))
    for key, what in (("reference_speed_m_s", "reference speed"), ("mean_speed_m_s", "mean speed of a flight"),
                      ("top_speed_m_s", "top speed of a flight")):
        if facts[key]:
            rows.append((what, f"{_told(facts[key])} m/s"))
    if facts["voltage_V"]:
        low, high = facts["voltage_V"]
        rows.append(("battery in the air", f"{low:.2f} to {high:.2f} V"))
    offset = facts["offset_s"]
    if offset:
        sd = f", SD {1e3 * offset['sd']:.1f} ms" if offset["sd"] is not None else ""
        rows.append(("imu late", f"median {1e3 * offset['median']:.1f} ms{sd} over {offset['n']} flights"))
    return rows


def _told(spread: Mapping[str, Any]) -> str:
    ends = "" if spread["n"] == 1 else f" ({spread['low']:.3g} to {spread['high']:.3g})"
    return f"{spread['median']:.3g}{ends}"
