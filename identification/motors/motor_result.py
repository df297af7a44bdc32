"""The content of motors.json from a study: rows of the prediction of rotation, and one part per question."""

from __future__ import annotations

from typing import Any

import numpy as np

from nanobench_tools.metrics.prediction import HORIZONS, multi_horizon
from nanobench_tools.metrics.statistics import (
    bootstrap_interval,
    bootstrap_ratio,
    pooled_interval,
    session_count,
    why_not,
)
from nanobench_tools.units import factor

from . import lag as lags
from . import rotation, steady_speed, torque
from .motor_study import Study, inertia

KINDS = {"rate": "rate_mae_rad_s", "roll_pitch": "roll_pitch_rate_mae_rad_s", "yaw": "yaw_rate_mae_rad_s",
         "attitude": "attitude_mae_rad"}


def body(study: Study, seed: int = 0) -> dict[str, Any]:
    """The keys of motors.json, without the simulator's path."""
    logs, tested = study.logs, study.sessions[study.test]
    return {"sessions": session_count(tested), "ci_why": why_not(len(tested), tested),
            "rows": rotation_rows(study, seed), "gains": gains(study, seed), "lag": lag_part(study, seed),
            "speed": speed_part(study, seed), "force": force_part(study, seed), "moments": moment_part(study, seed),
            "measurement": measurement(study), "step_s": study.step_s, "row_s": logs[0].row_s,
            "mass_kg": study.vehicle.mass_kg if study.mass_known else None,
            "train": [logs[i].name for i in study.train], "test": [logs[i].name for i in study.test],
            "folds": [{"train": [logs[i].name for i in a], "test": [logs[i].name for i in b]} for a, b in study.folds],
            "left_out": [{"flight": name, "reason": reason} for name, reason in study.reasons.items()]}


def rotation_rows(study: Study, seed: int) -> list[dict[str, Any]]:
    """One row per input, standing still first; intervals by drawing held-out flights."""
    words = {kind.name: kind.words for kind in (rotation.STILL, *rotation.INPUTS)}
    rows = []
    for name in [n for n in words if n in study.rotation]:
        scores = study.rotation[name]
        flown = scores.windows > 0
        counts = scores.windows[flown]
        row: dict[str, Any] = {"input": name, "words": words[name], "n_windows": int(counts.sum()),
                               "n_flights": int(flown.sum()), "metrics": {}, "ci95": {}, "curves": {},
                               "trouble": "; ".join(dict.fromkeys(scores.troubles))}
        for kind, metric in KINDS.items():
            values = scores.by_flight[kind][flown]
            mean = np.average(values, axis=0, weights=counts)
            row["metrics"][metric] = multi_horizon(mean)
            row["curves"][metric] = mean
            ends = bootstrap_ratio(values * counts[:, None], counts, seed, sessions=study.sessions[flown])
            row["ci95"][metric] = {} if ends is None else {
                str(h): [float(ends[0][h - 1]), float(ends[1][h - 1])] for h in HORIZONS}
        rows.append(row)
    return rows


def gains(study: Study, seed: int) -> list[dict[str, Any]]:
    """How much smaller errors are than from the radio stream, in per cent, the same flights drawn for both."""
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
                found.append({"input": name, "metric": metric, "h": h, "less_percent":
                              float(100.0 * (1.0 - ours.sum() / theirs.sum())),
                              "ci95": None if ends is None else [100.0 * (1.0 - ends[1]), 100.0 * (1.0 - ends[0])]})
    return found


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2))) if np.isfinite(values).any() else float("nan")


def _ci(values: np.ndarray, seed: int, sessions: np.ndarray) -> list[float] | None:
    known = np.isfinite(values)
    found = bootstrap_interval(values[known], seed, sessions=sessions[known])
    return None if found is None else list(found)


def lag_part(study: Study, seed: int) -> dict[str, Any]:
    """Candidates, the chosen one, the fit with both constants and its intervals, and what every flight says alone."""
    both = study.lags["up and down + delay"]
    own = {name: {key: fit.model.parameters[key] for key in (*rotation.LAGS, "command_delay.delay_s")}
           | {"trouble": fit.trouble} for name, fit in study.models.items() if name.endswith("own_lag")}
    return {
        "best": study.best_lag, "tau_up_s": study.lag.tau_up_s, "tau_down_s": study.lag.tau_down_s,
        "delay_s": study.lag.delay_s, "gain": study.lag.gain,
        "fit": {"tau_up_s": both.tau_up_s, "tau_down_s": both.tau_down_s, "delay_s": both.delay_s,
                "ci95": {f"tau_{k}_s" if k != "delay" else "delay_s": v for k, v in study.lag_ci95.items()}},
        "rows": [{"model": name, "rms_rad_s": _rms(study.lag_rms[name]),
                  "ci95": _ci(study.lag_rms[name], seed, study.sessions),
                  "train_rms_rad_s": fit.rms_rad_s, "tau_up_s": fit.tau_up_s, "tau_down_s": fit.tau_down_s,
                  "delay_s": fit.delay_s, "trouble": fit.trouble} for name, fit in study.lags.items()],
        "flights": [{"flight": log.name, "tau_up_s": fit.tau_up_s, "tau_down_s": fit.tau_down_s,
                     "delay_s": fit.delay_s, "trouble": fit.trouble}
                    for log, fit in zip(study.logs, study.lag_by_flight, strict=True) if fit is not None],
        "from_gyro_alone": own,
        "correlation_s": [{"flight": log.name, "x": torque.command_lag(log, study.vehicle, 0),
                           "y": torque.command_lag(log, study.vehicle, 1)} for log in study.logs],
        "example": _example(study)}


def _example(study: Study) -> dict[str, Any]:
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
    return {"flight": study.logs[int(one.flight[0])].name, "motor": int(motor) + 1,
            "time_s": np.arange(one.speed.shape[1]) * study.logs[0].row_s, "measured_rad_s": one.speed[0, :, motor],
            "simulated_rad_s": lines}


def speed_part(study: Study, seed: int) -> dict[str, Any]:
    """Candidates for RPM(PWM, V), held-out errors, the chosen one's parameters."""
    chosen = study.chosen
    assert chosen is not None
    fast, slow = study.slopes
    best = None if chosen.best is None else chosen.fits[chosen.best]
    rows = [{"model": name, "rms_rad_s": score.rms, "equation": steady_speed.CANDIDATES[name].equation,
             "trouble": score.trouble or chosen.fits[name].fit.trouble} for name, score in chosen.scores.items()]
    return {"best": chosen.best, "spread_rad_s": chosen.spread, "rows": rows,
            "parameters": {} if best is None else {n: {"value": v, "unit": best.fit.map.units[n]}
                                                   for n, v in best.fit.values.items()},
            "motor_gain": None if best is None else best.gain, "slope_fast_N_per_V": fast, "slope_slow_N_per_V": slow,
            "curves": [] if best is None else _curves(study, best)}


def _curves(study: Study, best: steady_speed.Steady) -> list[dict[str, Any]]:
    u = np.concatenate([log.joined(log.u).ravel() for log in study.logs])
    volts = np.concatenate([log.joined(log.battery_V) for log in study.logs])
    low, high = np.quantile(u, (0.002, 0.998))
    grid = np.linspace(low, high, 41)
    return [{"voltage_V": round(float(v), 2), "pwm": grid,
             "speed_rad_s": best.speed(np.repeat(grid[:, None], 4, axis=1), np.full(41, v)).mean(axis=1)}
            for v in np.quantile(volts, (0.05, 0.5, 0.95))]


def force_part(study: Study, seed: int) -> dict[str, Any]:
    """k_f, or k_f / m alone when nobody gave a mass."""
    force, mass = study.force, study.vehicle.mass_kg
    ends = None if force.ci95 is None else [e * (mass if study.mass_known else 1.0) for e in force.ci95]
    return {"k_f_per_kg": force.k_f_per_kg, "k_f": study.k_f if study.mass_known else None, "ci95": ends,
            "identified": "k_f, from the mass given" if study.mass_known else "only k_f / m: no mass was given",
            "unit": "N s^2/rad^2" + ("" if study.mass_known else " per kg"),
            "flights": [{"flight": study.logs[i].name, "k_f_per_kg": k}
                        for i, k in zip(study.train, force.per_flight, strict=True)],
            "rows": [{"from": name, "rms_m_s2": _rms(rms), "ci95": _ci(rms, seed, study.sessions),
                      "n_flights": int(np.isfinite(rms).sum())} for name, rms in study.force_rms.items()]}


def moment_part(study: Study, seed: int) -> dict[str, Any]:
    """What turns the vehicle, from rotor speed: 1 / J, k_m / J_z, J_r / J_z, and how much each explains."""

    def over(axis: str, of: str, k: int = 0) -> dict[str, Any]:
        there = [a is not None for a in study.axes[axis]]
        known = [a for a in study.axes[axis] if a is not None]
        values = np.array([a.values[k] if of == "values" else getattr(a, of) for a in known])
        found = bootstrap_interval(values, seed, sessions=study.sessions[there])
        return {"median": float(np.median(values)) if len(values) else None,
                "ci95_mean": None if found is None else list(found), "n_flights": len(values)}

    jx, jy, jz = inertia(study)
    whole = "with the mass and arms given" if study.mass_known else "only arm k_f / J is seen; a mass was assumed"
    return {"inertia_kg_m2": {"x": jx, "y": jy}, "identified": whole,
            "per_inertia": {"x": over("x", "values"), "y": over("y", "values"), "unit": "1/(kg m^2)"},
            "k_m_per_inertia_z": over("z", "values"), "reaction_per_inertia_z": over("z", "values", 1),
            "assumed_inertia_z": jz,
            "explained": {"x": over("x", "explained"), "y": over("y", "explained"),
                          "z, drag and reaction": over("z", "explained"), "z, drag alone": over("z_drag", "explained")},
            "gyro_behind_speed_s": {"x": over("x", "delay_s"), "y": over("y", "delay_s")},
            "fitted": {name: {"parameters": _values(fit), "trouble": fit.trouble}
                       for name, fit in study.models.items()}}


def _values(fit: rotation.Rotation) -> dict[str, dict[str, Any]]:
    units = dict(zip(fit.model.names, fit.model.units, strict=True))
    return {name: {"value": fit.model.parameters[name], "unit": units[name]} for name in fit.free}


def measurement(study: Study) -> list[dict[str, Any]]:
    """Rates and steps of what was logged."""
    found = []
    for log in study.logs:
        moves = np.diff(log.speed, axis=0) != 0.0
        steps = np.abs(np.diff(np.unique(log.speed)))
        found.append({"flight": log.name, "rate_hz": 1.0 / log.row_s, "seconds": log.seconds,
                      "new_speed_share": float(moves.mean()), "new_speed_hz": float(moves.mean()) / log.row_s,
                      "smallest_step_rpm": float(np.quantile(steps[steps > 1e-9], 0.05) / factor("rpm")),
                      "revolutions_hz": float(np.median(log.speed) / (2.0 * np.pi)),
                      "gaps": len(log.stretches) - 1})
    return found

