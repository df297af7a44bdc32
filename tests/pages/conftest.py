"""Hand-made recordings and result files for the report; nothing here is read from elsewhere."""

import hashlib

import numpy as np
import pytest

from nanobench_tools.flight import Flight, Provenance, make_stream

RATE_HZ, LENGTH_S, DEAD_S = 100.0, 20.0, 15.0


def make_flight(name="loop one", streams=("mocap", "estimator", "attitude_qw", "setpoint", "motor", "battery"),
                radius_m=1.0, synthetic=False) -> Flight:
    """A circle in 20 s: the estimate lies 0.1 m above the truth and is turned by 10 deg about z; from 15 s on it runs
    away in a straight line, as rows do after a log has ended."""
    t = np.arange(0.0, LENGTH_S + 1e-9, 1.0 / RATE_HZ)
    angle = 2.0 * np.pi * t / 10.0
    place = np.column_stack([radius_m * np.cos(angle), radius_m * np.sin(angle), np.minimum(t / 4.0, 1.0)])
    level = np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1))
    turned = np.tile([0.0, 0.0, np.sin(np.radians(5.0)), np.cos(np.radians(5.0))], (len(t), 1))
    estimate = place + np.array([0.0, 0.0, 0.1])
    late = t > DEAD_S
    estimate[late, 0] += 2.0 * (t[late] - DEAD_S)
    motors = 0.6 + 0.1 * np.sin(angle)[:, None] * [1.0, -1.0, 1.0, -1.0]
    values = {
        "mocap": (np.hstack([place, level, np.gradient(place, t, axis=0)]),
                  ("px", "py", "pz", "qx", "qy", "qz", "qw", "vx", "vy", "vz")),
        "estimator": (estimate, ("x", "y", "z")),
        "attitude_qw": (turned, ("qx", "qy", "qz", "qw")),
        "setpoint": (place * 1.05, ("x", "y", "z")),
        "motor": (motors, ("m1", "m2", "m3", "m4")),
        "battery": (4.1 - 0.02 * t[:, None], ("vbat",)),
    }
    made = {s: make_stream(s, t, *values[s], rate_hz=RATE_HZ, samples=len(t)) for s in streams}
    sheet = {"family": "circle", "speed": "slow", "reference_speed_m_s": 0.63}
    sha256 = hashlib.sha256(name.encode(errors="replace")).hexdigest()
    return Flight(name, made, sheet, Provenance(f"folder/{name}.csv", sha256, "test", synthetic))


def make_entry(flight: Flight) -> dict:
    """An audit.json entry: airborne 2..18 s, the estimator dead from 15 s on, one spike, a late clock."""
    clock = {"offset_s": 0.012, "ci95_s": [0.010, 0.014], "identifiable": True, "reason": "gyro", "wander_sd_s": 0.03,
             "warp": []}
    unknown = {"offset_s": None, "ci95_s": None, "identifiable": False, "reason": "no rotation", "wander_sd_s": None,
               "warp": []}
    faults = [{"kind": "dead_stream", "stream": "estimator", "columns": ["x"], "start_s": DEAD_S, "end_s": LENGTH_S,
               "size": 5.0, "unit": "s", "evidence": "a straight line to the end", "minimum_detectable": 0.1},
              {"kind": "spike", "stream": "mocap", "columns": ["px"], "start_s": 5.0, "end_s": 5.0,
               "size": float("nan"), "unit": "m", "evidence": "one row jumps", "minimum_detectable": None}]
    events = [{"kind": f["kind"], "streams": [f["stream"]], "spans": [[f["start_s"], f["end_s"]]],
               "sentence": f["evidence"], "advice": "", "faults": 1, "seconds_cut": 3.0 if f["size"] == 5.0 else 0.0}
              for f in faults]
    return {"flight": flight.name, "path": flight.provenance.path, "sha256": flight.provenance.sha256,
            "verdict": "13.0 of 16.0 s of flight usable: a straight line to the end", "severity": "cut",
            "advice": "try --clock retimed", "usable": [[2.0, DEAD_S]], "unfit": [], "can": {}, "events": events,
            "controller": "pid", "span": [0.0, LENGTH_S], "airborne": [[2.0, 18.0]], "clean": [[0.0, DEAD_S]],
            "faults": faults, "clock": {"imu": clock, "estimator": clock, "motor": unknown},
            "rates": {s: {"samples": len(v), "rate_hz": RATE_HZ} for s, v in flight.streams.items()}}


def summary(mean, std=None, low=None, high=None) -> dict:
    return {"mean": mean, "std": std, "median": mean, "p90": mean, "ci95": None if low is None else [low, high]}


def envelope(name: str, body: dict, failed=()) -> dict:
    return {"schema": f"nanobench-{name}/1", "version": "1.2.3", "synthetic": False, "failed": list(failed),
            "manifest": {"versions": {"numpy": "2.0"}, "argv": ["nanobench", "run"], "seed": 7, "inputs": []}, **body}


def single_estimates() -> dict:
    """One estimate with its standard deviations, one dead log, a small attribution."""
    t = np.linspace(0.0, 10.0, 40)
    path, error = np.column_stack([np.cos(t), np.sin(t), 0.1 * t]), 0.01 * np.sin(5.0 * t)[:, None] * [1.0, -1.0, 0.5]
    band = {"protocol": "aided", "name": "10 Hz: loop one", "flight": "loop one", "clock": "as-recorded",
            "t_s": t.tolist(), "truth_m": path.tolist(), "error_m": error.tolist(), "sd_m": [[0.005, 0.006, 0.01]] * 40,
            "cov_xy_m2": [1e-5] * 40}
    away = np.where(t < 6.0, 0.02, 1.0 + t)
    logged = [{"what": clock, "metrics": {"ate_m": summary(v, 0.002, 0.9 * v, 1.1 * v)}}
              for clock, v in (("as-recorded", 0.021), ("retimed", 0.009))]
    replayed = [{"what": what, "metrics": {"ate_m": summary(0.008), "change_m": summary(v, 0.001, v - 2e-4, v + 2e-4)}}
                for what, v in (("replay", 0.0), ("poses late", 0.011), ("rows held", -0.0004))]
    return {"bands": [{**band, "method": name} for name in ("one", "two")],
            "dead_logs": [{"flight": "loop one", "speed": "fast", "t_s": t.tolist(), "error_m": away.tolist(),
                           "dead": [[6.0, 10.0]], "live_rmse_m": 0.02, "all_rmse_m": 5.0}],
            "attribution": {"n": 9, "n_replayed": 9, "logged": logged, "replayed": replayed}}


def make_results(flights) -> dict[str, dict]:
    """All result files, small; numbers chosen so that ratios are easy to say."""
    names = [f.name for f in flights]
    estimate_rows = [
        {"protocol": "as-published", "method": "onboard EKF", "causal": True, "group": "Slow", "n": 3,
         "flights": names, "given": "all", "metrics": {"ate_rmse_m": summary(0.4, 0.1, 0.3, 0.5),
                                                       "attitude_rmse_deg": summary(3.0, 0.5)}},
        {"protocol": "as-published-corrected", "method": "onboard EKF", "causal": True, "group": "slow", "n": 2,
         "flights": names, "given": "all", "metrics": {"ate_rmse_m": summary(0.04, 0.01, 0.03, 0.05),
                                                       "attitude_rmse_deg": summary(None)}},
        {"protocol": "clean", "method": "onboard EKF", "causal": True, "group": "all", "n": 2, "flights": names,
         "given": "all", "metrics": {"ate_rmse_m": summary(0.021, 0.002, 0.02, 0.022), "strange_m": summary(1.5)}}]
    clocks = {"retimed": {name: {"moving": True, "constant_s": 0.01, "wander_sd_s": 0.03, "reason": "moves",
                                 "warp": [[2.0, 0.0, 0.002], [6.0, 0.04, 0.002], [18.0, -0.01, 0.004]]}
                          for name in names}}
    for clock, ate in (("offset", 0.020), ("retimed", 0.009)):
        estimate_rows.append({**estimate_rows[2], "clock": clock, "n_moving": 2 if clock == "retimed" else 0,
                              "clock_evidence": ["gyro"] if clock == "offset" else ["gyro", "attitude"],
                              "metrics": {"ate_rmse_m": summary(ate, 0.002, 0.9 * ate, 1.1 * ate),
                                          "along_track_delay_removed_rmse_m": summary(ate)},
                              "clock_ratio": {"ate_rmse_m": ate / 0.021}, "clock_ratio_to": "as-recorded",
                              "clock_ratio_ci95": {"ate_rmse_m": [0.9 * ate / 0.021, 1.1 * ate / 0.021]}})
    horizon = {"1": 0.001, "10": 0.012, "50": 0.15, "sum": 3.0}
    metrics = {"position_mae_m": horizon, "velocity_mae_m_s": horizon, "attitude_mae_rad": horizon,
               "rate_mae_rad_s": {**horizon, "50": None}}
    sysid_rows = [
        {"model": "naive", "information": "state", "truth": "onboard", "group": "all", "n_windows": 900, "n_flights": 9,
         "metrics": {k: {h: None if v is None else 3 * v for h, v in m.items()} for k, m in metrics.items()}},
        {"model": "physics", "information": "state", "truth": "onboard", "group": "all", "n_windows": 900,
         "n_flights": 9, "metrics": metrics, "ci95": {"position_mae_m": {"1": [0.0009, 0.0011]}},
         "published": {"position_mae_m": {"1": 0.0003, "50": 0.6}, "velocity_mae_m_s": {"1": 0.05, "10": 0.5}}}]
    control_rows = [
        {"plant": "real", "protocol": protocol, "controller": "PID", "reference": reference, "speed_m_s": 0.5,
         "information": "as flown", "n": 3, "flights": names, "dropped": [],
         "metrics": {"rmse_m": rmse, "heading_deg": heading},
         "statistics": {"rmse_m": summary(rmse, 0.01), "heading_deg": summary(heading)}}
        for protocol, reference, rmse, heading in (("as-published", "as-published", 0.3, 6.0),
                                                   ("clean", "circle", 0.27, 1.0))]
    per_flight = [{"protocol": "clean", "method": "onboard EKF", "flight": name, "clock": clock,
                   "metrics": {"ate_rmse_m": value}} for name in names
                  for clock, value in (("as-recorded", 0.021), ("retimed", 0.009))]
    per_flight += [{"protocol": protocol, "method": "onboard EKF", "flight": name, "speed": "slow",
                    "metrics": {"ate_rmse_m": value}} for name in names
                   for protocol, value in (("as-published", 0.4), ("as-published-corrected", 0.04))]
    return {"audit": envelope("audit", {"flights": [make_entry(f) for f in flights], "copies": [["a", "b"]]}),
            "estimate": envelope("estimate", {"rows": estimate_rows, "clocks": clocks, "per_flight": per_flight,
                                              **single_estimates()}),
            "sysid": envelope("sysid", {"rows": sysid_rows, "parameters": {
                "physics": {"mass": {"value": 0.04, "ci95": None, "unit": "kg"}}}}),
            "control": envelope("control", {"rows": control_rows})}


@pytest.fixture(scope="session")
def flights():
    return [make_flight("loop one"), make_flight("loop two", radius_m=0.4)]


@pytest.fixture(scope="session")
def results(flights):
    return make_results(flights)


@pytest.fixture(scope="session")
def make():
    """The makers: ``make.flight(...)``, ``make.entry(flight)``, ``make.results(flights)``."""
    class Makers:
        flight, entry, results = staticmethod(make_flight), staticmethod(make_entry), staticmethod(make_results)

    return Makers
