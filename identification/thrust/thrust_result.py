"""The content of thrust.json: one part for stand series, one for flights, and a common part.

Battery and motor parameters from a thrust-stand series in which current or speed were measured.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.stats

from nanobench_tools.results.fitted_values import Estimate, LeftOut, Value
from nanobench_tools.results.result import INLINE, OPTIONAL, Result
from nanobench_tools.time_offsets.moving.votes import evidence_of

from .error_rows import AgainstFirmware, ChosenWithout, ErrorRow, FileError, InverseTable, Points
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
from .thrust_formula import ThrustFormula
from .thrust_model import ThrustModel
from .thrust_rows import Case, fit_to_fly, flown_rows
from .thrust_study import Study, study

BLOCKS = 20
DRAWS = 200


def battery_resistance(stand: Stand, seed: int = 0) -> Estimate | None:
    """R [ohm] in V = V_0 - R I - k q, q the charge taken so far (sum of I over the rows); None
    without voltage or current. The interval draws blocks of rows."""
    if stand.battery_V is None or stand.current_A is None or np.ptp(stand.current_A) < 0.1:
        return None
    voltage = stand.battery_V
    taken = np.cumsum(stand.current_A) / np.sum(np.abs(stand.current_A))
    columns = np.stack([np.ones(len(stand)), -stand.current_A, -taken], axis=1)

    def resistance(rows: np.ndarray) -> float:
        return float(np.linalg.lstsq(columns[rows], voltage[rows], rcond=None)[0][1])

    blocks = np.array_split(np.arange(len(stand)), min(BLOCKS, len(stand)))
    drawn = scipy.stats.bootstrap(
        (np.arange(len(blocks)),), lambda drawn: resistance(np.concatenate([blocks[i] for i in drawn])),
        vectorized=False, n_resamples=DRAWS, method="percentile", rng=np.random.default_rng(seed)).confidence_interval
    return Estimate(resistance(np.arange(len(stand))), (float(drawn.low), float(drawn.high)), "ohm")


def motor_constants(fit: Fit, stand: Stand) -> dict[str, Value]:
    """k_f [N s^2/rad^2] from thrust and speed. With a map of the motor family also K_e = E / w [V s/rad], from T =
    kappa E^2 = k_f w^2. Empty without speeds."""
    k_f = stand.thrust_per_speed2
    if not np.isfinite(k_f) or k_f <= 0.0:
        return {}
    found = {"k_f": Value(k_f, "N s^2/rad^2")}
    kappa = fit.values.get("kappa")
    if kappa is not None and kappa > 0.0:
        found["K_e"] = Value(float(np.sqrt(k_f / kappa)), "V s/rad")
    return found


Cases = Sequence[Case]
DRAWN_THRUSTS = 9


@dataclass(frozen=True, repr=False)
class Curve(Result):
    """Thrust of one motor at one battery voltage over the PWM ratio, (51,) each."""

    voltage_V: float
    pwm: np.ndarray
    thrust_N: np.ndarray


@dataclass(frozen=True, repr=False)
class ChosenMap(Result):
    """The chosen map.

    ``interval_half_width``: of the 95 % interval of a row of a new file, N per motor or m/s^2. ``scale``: as
    ``ThrustModel.scale_``. ``terms``, ``toml``: for a simulator; ``terms_rms_N``: from the map. ``firmware``: lines for
    the firmware; ``firmware_note``: their quality, or the reason for none. ``formula``: with numbers, at hover and at
    full command.
    """

    interval_half_width: float
    scale: float
    inverse: InverseTable
    terms: tuple[Mapping[str, object], ...]
    terms_rms_N: float
    toml: str
    firmware: str
    firmware_note: str
    formula: ThrustFormula
    points: tuple[Points, ...]
    curves: tuple[Curve, ...]


@dataclass(frozen=True, repr=False)
class PartResult(Result):
    """One kind, stand series or flights. ``split``: choice of files. ``no_result``: reasons by model. ``held_out_rms``:
    by model, N per motor or m/s^2. parameters by model and name. ``chosen``: None without a valid map."""

    best: str | None
    split: str
    no_result: Mapping[str, str]
    held_out_rms: Mapping[str, float]
    parameters: Mapping[str, Mapping[str, Estimate]]
    per_file: tuple[FileError, ...]
    chosen: ChosenMap | None = field(metadata=INLINE)


@dataclass(frozen=True, repr=False)
class Series(Result):
    """Content of one stand series: rows that spin, and rows at rest. zero_N: load cell per motor at PWM 0, from
    zero_rows (nan without any)."""

    file: str
    rows: int
    still: int
    zero_N: float
    zero_rows: int
    notes: tuple[str, ...]
    constants: Mapping[str, Value]
    battery_resistance: Estimate | None


@dataclass(frozen=True, repr=False)
class StandResult(PartResult):
    """held_out: fits without each series, if all were held out in turn."""

    held_out: Mapping[str, ChosenWithout] | None = field(metadata=OPTIONAL)
    against_firmware: tuple[AgainstFirmware, ...]
    series: tuple[Series, ...]


@dataclass(frozen=True, repr=False)
class AsRecorded(Result):
    """The same flights on the clock they were recorded on."""

    rows: tuple[ErrorRow, ...]
    best: str | None


@dataclass(frozen=True, repr=False)
class FlightResult(PartResult):
    """``delay_s``: of the inputs. ``sessions``: of the training flights. ``held_out_coverage95``: fraction of training
    rows, held out in turn, inside the interval from the others. ``best_without_memory``: of maps with the inputs of
    the moment."""

    delay_s: float
    sessions: int
    held_out_coverage95: Mapping[str, float | None]
    best_without_memory: str | None
    clock: str
    mass_kg: float
    against_firmware: tuple[AgainstFirmware, ...]
    as_recorded: AsRecorded | None = field(default=None, metadata=OPTIONAL)


@dataclass(frozen=True, repr=False)
class ThrustResult(Result):
    """Content of thrust.json.

    With both kinds, ``best`` and ``parameters`` are those of the flights, since these describe the vehicle in flight.
    Each kind also has its own part.

    Attributes
    ----------
    rows : list of ErrorRow
        Error of every map on training and held-out files.
    best : str or None
        Name of the map in use; null if none is valid.
    parameters : mapping
        By map and parameter: value, 95 % interval, unit.
    stand : StandResult
        Of thrust-stand tables.
    flight : FlightResult
        Of flights.
    left_out : list of LeftOut
        Recordings that were not used, with the reason.
    """

    rows: tuple[ErrorRow, ...]
    best: str | None
    parameters: Mapping[str, Mapping[str, Estimate]]
    stand: StandResult | None = field(metadata=OPTIONAL)
    flight: FlightResult | None = field(metadata=OPTIONAL)
    left_out: tuple[LeftOut, ...]


@dataclass(frozen=True, repr=False)
class Part(Result):
    """One kind with the fits it is from; reasons of the recordings that could not be used."""

    found: Study
    rows: tuple[ErrorRow, ...]
    result: StandResult | FlightResult
    reasons: dict[str, str] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        return "flight" if self.found.flown else "stand"


def stand_part(train: Sequence[Stand], test: Sequence[Stand] | None, mass_kg: float, seed: int) -> Part:
    """Maps fitted to ``train`` and scored on ``test``; without ``test`` every series is held out in turn."""
    found = study(train, mass_kg, seed)
    held_out = None
    if test is None:
        tested, held_out = leave_one_out(train, mass_kg, seed)
        note = f"each of {len(train)} series predicted without it" if len(train) > 1 else "PWM bands of the one series"
    else:
        tested = scored(found, test, "test")
        for row in tested:
            row.given = basis_words([propeller_mates(s, train) for s in row.files])
        note = f"{len(train)} series train, {len(test)} test, as given"
    results = [*scored(found, train, "train"), *tested]
    common = _common(found, results, note, mass_kg, seed)
    best = found.fits.get(found.best or "")
    series = tuple(_series(s, best if isinstance(best, Fit) else None, seed)
                   for s in {id(s): s for s in (*train, *(test or ()))}.values())
    against = pair_with_firmware(common.per_file, "chosen" if test is None else str(found.best))
    return Part(found, tuple(r.row(seed) for r in results),
                StandResult(**vars(common), held_out=held_out, against_firmware=tuple(against), series=series))


def flight_part(train: Cases, test: Cases, mass_kg: float, seed: int, clock: str, note: str,
                as_recorded: AsRecorded | None = None) -> Part | None:
    """Maps fitted to the flights of ``train`` and scored on those of ``test``; None if none of ``train`` can be
    used. as_recorded: what the same gave on the clock they were recorded on."""
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
    evidence = evidence_of(flight for flight, _ in (*train, *test))
    rows = tuple(replace(row, uses=f"{row.uses}; inputs delayed by {delay:.2f} s", clock=clock, clock_evidence=evidence)
                 for row in (r.row(seed) for r in results))
    common = _common(found, results, note, mass_kg, seed)
    held = {name: in_turn(score.errors, len(found.train), found.sessions) for name, score in found.scores.items()}
    against = tuple(pair_with_firmware(common.per_file, str(found.best)))
    result = FlightResult(**vars(common), delay_s=delay, sessions=found.sessions, held_out_coverage95=held,
                          best_without_memory=_plain_best(found), clock=clock, mass_kg=mass_kg,
                          against_firmware=against, as_recorded=as_recorded)
    return Part(found, rows, result, flown.reasons | others.reasons)


def _plain_best(found: Study) -> str | None:
    """The best, by held-out training flights, of the maps that are given the inputs of the moment alone."""
    plain = {name: score.rms for name, score in found.scores.items()
             if isinstance(model := found.candidates[name], FlightModel) and not model.kind and model.map.fixed is None
             and not found.fits[name].trouble}
    return min(plain, key=plain.__getitem__) if plain else None


def _common(found: Study, results: Sequence[Scored], note: str, mass_kg: float, seed: int) -> PartResult:
    troubles = {name: fit.trouble for name, fit in found.fits.items() if fit.trouble}
    held = {name: score.rms for name, score in found.scores.items()}
    chosen = None if found.best is None else _chosen(found, found.best, results, mass_kg, seed)
    return PartResult(found.best, note, troubles, held, found.parameters(),
                      tuple(entry for r in results for entry in r.per_file()), chosen)


def _chosen(found: Study, best: str, results: Sequence[Scored], mass_kg: float, seed: int) -> ChosenMap:
    model = ThrustModel(mass_kg=mass_kg, seed=seed).use(found)
    exported = model.export()
    volts = np.concatenate([f.voltage for f in found.train])
    low, high = (float(np.quantile(volts, q)) for q in (0.02, 0.98)) if np.isfinite(volts).all() else (4.0, 4.0)
    voltages = sorted({round(float(v), 2) for v in np.linspace(low, high, 5)})
    most = float(model.predict(1.0, voltages[-1]))
    files = [(f, "train") for f in found.train] + [
        (f, "test") for r in results if r.name == best and r.split == "test" for f in r.files
        if all(f is not t for t in found.train)]
    pwm = np.linspace(0.0, 1.0, 51)
    return ChosenMap(
        found.half_width[best], model.scale_,
        inverse_table(model, voltages, np.linspace(0.0, most, DRAWN_THRUSTS + 1)[1:]),
        tuple(dict(t) for t in exported.terms), exported.rms_N, exported.toml(), exported.firmware, exported.note,
        model.formula_,
        tuple(points(found.fits[best], f, split) for f, split in files),
        tuple(Curve(v, pwm, model.predict(pwm, v)) for v in voltages))


def _series(stand: Stand, fit: Fit | None, seed: int) -> Series:
    return Series(stand.name, len(stand), stand.still, stand.zero_N, stand.zero_rows, stand.notes,
                  motor_constants(fit, stand) if fit else {}, battery_resistance(stand, seed))


def whole(parts: Sequence[Part], left_out: Mapping[str, str]) -> ThrustResult:
    """Of one part or both."""
    results = [part.result for part in parts]
    stand = next((r for r in results if isinstance(r, StandResult)), None)
    flight = next((r for r in results if isinstance(r, FlightResult)), None)
    first = flight or results[0]
    return ThrustResult(tuple(row for part in parts for row in part.rows), first.best, first.parameters, stand, flight,
                        LeftOut.of(left_out))
