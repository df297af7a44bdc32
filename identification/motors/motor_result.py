"""The content of motors.json from a study."""

from collections.abc import Sequence

import numpy as np

from nanobench_tools.metrics.prediction import HORIZONS, multi_horizon
from nanobench_tools.metrics.statistics import (
    bootstrap_interval,
    bootstrap_ratio,
    pooled_interval,
    session_count,
    why_not,
)
from nanobench_tools.results.fitted_values import LeftOut, Value
from nanobench_tools.units import factor

from . import lag as lags
from . import rotation, steady_speed, torque
from .motor_parts import (
    CommandLag,
    Ends,
    FittedLag,
    FittedRotation,
    FlightForce,
    FlightLag,
    Fold,
    ForcePart,
    ForceRow,
    GyroLag,
    LagExample,
    LagPart,
    LagRow,
    LagTimes,
    Measurement,
    MomentPart,
    MotorResult,
    OverFlights,
    PerInertia,
    RotationGain,
    RotationRow,
    SpeedCurve,
    SpeedPart,
    SpeedRow,
)
from .motor_study import Study, inertia

KINDS = {"rate": "rate_mae_rad_s", "roll_pitch": "roll_pitch_rate_mae_rad_s", "yaw": "yaw_rate_mae_rad_s",
         "attitude": "attitude_mae_rad"}


def motor_result(study: Study, seed: int = 0) -> MotorResult:
    """Without the simulator's path."""
    logs, tested = study.logs, study.sessions[study.test]

    def names(numbers: Sequence[int]) -> tuple[str, ...]:
        return tuple(logs[i].name for i in numbers)

    return MotorResult(
        session_count(tested), why_not(len(tested), tested), tuple(rotation_rows(study, seed)),
        tuple(gains(study, seed)), lag_part(study, seed), speed_part(study), force_part(study, seed),
        moment_part(study, seed), measurement(study), study.step_s, logs[0].row_s,
        study.vehicle.mass_kg if study.mass_known else None, names(study.train), names(study.test),
        tuple(Fold(names(a), names(b)) for a, b in study.folds), LeftOut.of(study.reasons))


def rotation_rows(study: Study, seed: int) -> list[RotationRow]:
    """One row per input, standing still first; intervals by drawing held-out flights."""
    words = {kind.name: kind.words for kind in (rotation.STILL, *rotation.INPUTS)}
    rows = []
    for name in [n for n in words if n in study.rotation]:
        scores = study.rotation[name]
        flown = scores.windows > 0
        counts = scores.windows[flown]
        curves: dict[str, np.ndarray] = {}
        ci95: dict[str, dict[str, Ends]] = {}
        for kind, metric in KINDS.items():
            values = scores.by_flight[kind][flown]
            curves[metric] = np.average(values, axis=0, weights=counts)
            ends = bootstrap_ratio(values * counts[:, None], counts, seed, sessions=study.sessions[flown])
            ci95[metric] = {} if ends is None else {
                str(h): (float(ends[0][h - 1]), float(ends[1][h - 1])) for h in HORIZONS}
        metrics = {metric: multi_horizon(curve) for metric, curve in curves.items()}
        rows.append(RotationRow(name, words[name], int(counts.sum()), int(flown.sum()), metrics, ci95, curves,
                                "; ".join(dict.fromkeys(scores.troubles))))
    return rows


def gains(study: Study, seed: int) -> list[RotationGain]:
    """Of every input but the radio stream, metric and horizon."""
    if "radio" not in study.rotation:
        return []
    radio, found = study.rotation["radio"], []
    flown = radio.windows > 0
    counts = radio.windows[flown]
    for name in [n for n in study.rotation if n not in ("radio", "still")]:
        for kind, metric in KINDS.items():
            for h in HORIZONS:
                ours, theirs = (s.by_flight[kind][flown, h - 1] * counts for s in (study.rotation[name], radio))
                ends = pooled_interval(ours, theirs, study.sessions[flown], seed).ends()
                found.append(RotationGain(
                    name, metric, h, float(100.0 * (1.0 - ours.sum() / theirs.sum())),
                    None if ends is None else (100.0 * (1.0 - ends[1]), 100.0 * (1.0 - ends[0]))))
    return found


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2))) if np.isfinite(values).any() else float("nan")


def _ci(values: np.ndarray, seed: int, sessions: np.ndarray) -> Ends | None:
    known = np.isfinite(values)
    return bootstrap_interval(values[known], seed, sessions=sessions[known])


def _times(fit: lags.Lag) -> LagTimes:
    return LagTimes(*fit.values)


def lag_part(study: Study, seed: int) -> LagPart:
    """Candidates, the chosen one, the fit with both constants and its intervals, and what every flight says alone."""
    both = study.lags["up and down + delay"]
    return LagPart(
        study.best_lag, _times(study.lag), study.lag.gain,
        FittedLag(*both.values, {f"tau_{k}_s" if k != "delay" else "delay_s": (v[0], v[1])
                                 for k, v in study.lag_ci95.items()}),
        rows=tuple(LagRow(name, _rms(study.lag_rms[name]), _ci(study.lag_rms[name], seed, study.sessions),
                          fit.rms_rad_s, _times(fit), fit.trouble) for name, fit in study.lags.items()),
        flights=tuple(FlightLag(log.name, _times(fit), fit.trouble)
                      for log, fit in zip(study.logs, study.lag_by_flight, strict=True) if fit is not None),
        from_gyro_alone={
            name: GyroLag({key: fit.model.parameters[key] for key in (*rotation.LAGS, "command_delay.delay_s")},
                          fit.trouble) for name, fit in study.models.items() if name.endswith("own_lag")},
        correlation_s=tuple(CommandLag(log.name, *(torque.command_lag(log, study.vehicle, axis) for axis in (0, 1)))
                            for log in study.logs),
        example=_example(study))


def _example(study: Study) -> LagExample:
    """Command, measured and simulated speed of one motor over the second in which it moves most, for a picture."""
    data = study.windows
    assert data is not None
    tested = np.flatnonzero(np.isin(data.flight, study.test))
    spread = lags.centred(data.speed[tested]).std(axis=1)
    at, motor = np.unravel_index(int(np.argmax(spread)), spread.shape)
    one = lags.Windows(*(x[tested[at]:tested[at] + 1] for x in (data.u, data.battery_V, data.past_u, data.past_V,
                                                                 data.speed, data.flight)))
    mean = float(one.speed[0, :, motor].mean())
    lines = {}
    for name in ("at once", study.best_lag):
        fit = study.lags[name]
        found = lags.simulate(study.lag.model, one, np.array([fit.values]), study.logs[0].row_s)
        lines[name] = mean + study.lag.gain[motor] * lags.centred(found)[0, 0, :, motor]
    return LagExample(study.logs[int(one.flight[0])].name, int(motor) + 1,
                      np.arange(one.speed.shape[1]) * study.logs[0].row_s, one.speed[0, :, motor], lines)


def speed_part(study: Study) -> SpeedPart:
    """Candidates for RPM(PWM, V), held-out errors, the chosen one's parameters."""
    chosen = study.chosen
    assert chosen is not None
    best = None if chosen.best is None else chosen.fits[chosen.best]
    return SpeedPart(
        chosen.best, chosen.spread,
        tuple(SpeedRow(name, score.rms, steady_speed.CANDIDATES[name].equation,
                       score.trouble or chosen.fits[name].fit.trouble) for name, score in chosen.scores.items()),
        {} if best is None else {n: Value(v, best.fit.map.units[n]) for n, v in best.fit.values.items()},
        None if best is None else best.gain, *study.slopes, () if best is None else _curves(study, best))


def _curves(study: Study, best: steady_speed.Steady) -> tuple[SpeedCurve, ...]:
    u = np.concatenate([log.joined(log.u).ravel() for log in study.logs])
    volts = np.concatenate([log.joined(log.battery_V) for log in study.logs])
    low, high = np.quantile(u, (0.002, 0.998))
    grid = np.linspace(low, high, 41)
    return tuple(
        SpeedCurve(round(float(v), 2), grid,
                   best.speed(np.repeat(grid[:, None], 4, axis=1), np.full(41, v)).mean(axis=1))
        for v in np.quantile(volts, (0.05, 0.5, 0.95)))


def force_part(study: Study, seed: int) -> ForcePart:
    """k_f, or k_f / m alone when nobody gave a mass."""
    force, times = study.force, study.vehicle.mass_kg if study.mass_known else 1.0
    return ForcePart(
        force.k_f_per_kg, study.k_f if study.mass_known else None,
        None if force.ci95 is None else (force.ci95[0] * times, force.ci95[1] * times),
        "k_f, from the mass given" if study.mass_known else "only k_f / m: no mass was given",
        "N s^2/rad^2" + ("" if study.mass_known else " per kg"),
        tuple(FlightForce(study.logs[i].name, k) for i, k in zip(study.train, force.per_flight, strict=True)),
        tuple(ForceRow(name, _rms(rms), _ci(rms, seed, study.sessions), int(np.isfinite(rms).sum()))
              for name, rms in study.force_rms.items()))


def moment_part(study: Study, seed: int) -> MomentPart:
    """What turns the vehicle, from rotor speed."""

    def over(axis: str, of: str, k: int = 0) -> OverFlights:
        there = [a is not None for a in study.axes[axis]]
        known = [a for a in study.axes[axis] if a is not None]
        values = np.array([a.values[k] if of == "values" else getattr(a, of) for a in known])
        return OverFlights(float(np.median(values)) if len(values) else None,
                           bootstrap_interval(values, seed, sessions=study.sessions[there]), len(values))

    jx, jy, jz = inertia(study)
    return MomentPart(
        {"x": jx, "y": jy},
        "with the mass and arms given" if study.mass_known else "only arm k_f / J is seen; a mass was assumed",
        PerInertia(over("x", "values"), over("y", "values")), over("z", "values"), over("z", "values", 1), jz,
        explained={"x": over("x", "explained"), "y": over("y", "explained"),
                   "z, drag and reaction": over("z", "explained"), "z, drag alone": over("z_drag", "explained")},
        gyro_behind_speed_s={"x": over("x", "delay_s"), "y": over("y", "delay_s")},
        fitted={name: FittedRotation(_values(fit), fit.trouble) for name, fit in study.models.items()})


def _values(fit: rotation.Rotation) -> dict[str, Value]:
    units = dict(zip(fit.model.names, fit.model.units, strict=True))
    return {name: Value(fit.model.parameters[name], units[name]) for name in fit.free}


def measurement(study: Study) -> tuple[Measurement, ...]:
    """Rates and steps of what was logged."""
    found = []
    for log in study.logs:
        moves = np.diff(log.speed, axis=0) != 0.0
        steps = np.abs(np.diff(np.unique(log.speed)))
        found.append(Measurement(
            log.name, 1.0 / log.row_s, log.seconds, float(moves.mean()), float(moves.mean()) / log.row_s,
            float(np.quantile(steps[steps > 1e-9], 0.05) / factor("rpm")),
            float(np.median(log.speed) / (2.0 * np.pi)), len(log.stretches) - 1))
    return tuple(found)
