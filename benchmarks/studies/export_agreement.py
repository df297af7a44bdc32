"""How far RotorPy, with exported parameters, flies from the model itself on logged commands; and what that comes from.

    python benchmarks/studies/export_agreement.py [SIMULATOR.toml] [--data PATH ...] [--windows N] [--json FILE]

Both start in the same state and get the same PWM and battery voltage for 50 rows of 10 ms. First row: what both can
express, where only the integrators differ; then each effect that RotorPy approximates or lacks, added alone, and the
whole model. Mean difference of position, velocity, attitude and rate after 10 and 50 rows. Without arguments: a typical
Crazyflie on practice flights (SYNTHETIC).
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from nanobench_tools import so3
from nanobench_tools.physics import Model, Vehicle, numeric
from nanobench_tools.physics.adapters.rotorpy import RotorPySimulator
from nanobench_tools.physics.export import export_model
from nanobench_tools.physics.simulator import read_simulator
from nanobench_tools.practice.flights import practice_flights
from nanobench_tools.protocols.task1 import training_cases
from nanobench_tools.protocols.windows import RATE_HZ, cut_windows
from nanobench_tools.results.result_files import write_json
from nanobench_tools.steps.options import Options

TYPICAL = {
    "thrust_voltage": {"c": (-0.0248, 0.0652, -0.0268, 0.00678)}, "thrust_rpm": {"k_f": 2.3e-8},
    "yaw_torque": {"k_m": 0.006}, "motor_lag": {"tau_up_s": 0.03, "tau_down_s": 0.04},
    "drag_linear": {"d": (0.016, 0.0165, 0.006)}, "drag_torque": {"c": -1.5e-4}, "inflow": {"k_z": 0.014, "k_h": 0.005},
    "angular_damping": {"d_r": (3e-5, 3e-5, 1e-5)}}
TOLERANCE = 1e-7


def difference(model: Model, starts: np.ndarray, motor: np.ndarray, battery_V: np.ndarray) -> np.ndarray:
    """Mean over windows of (position, velocity, attitude, rate) differences after 10 and 50 rows, (2, 4)."""
    fine = model.on(rate_hz=max(model.vehicle.rate_hz, 400.0))
    ours = numeric.rollout(fine, starts, motor, battery_V, row_hz=RATE_HZ)
    with TemporaryDirectory() as folder:
        there = RotorPySimulator.from_file(export_model(model, "rotorpy", folder).files[0], TOLERANCE)
    theirs = np.array([there.rollout(first, there.speeds(m, b, row_hz=RATE_HZ), 1.0 / RATE_HZ)
                       for first, m, b in zip(ours[:, 0], motor, battery_V, strict=True)])
    gap = [np.linalg.norm((ours - theirs)[..., part], axis=-1) for part in (slice(0, 3), slice(3, 6), slice(10, 13))]
    gap.insert(2, so3.geodesic_angle(ours[..., 6:10], theirs[..., 6:10]))
    return np.array([[values[:, h].mean() for values in gap] for h in (10, 50)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("simulator", nargs="?", type=Path)
    parser.add_argument("--data", action="append", type=Path)
    parser.add_argument("--windows", type=int, default=20)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    model = read_simulator(given.simulator) if given.simulator else Model(Vehicle(), TYPICAL)
    options = Options(data=tuple(given.data or ()), quiet=True)
    flights = options.load() if given.data else practice_flights(3, seed=3, duration_s=12.0)
    cases = training_cases(flights, options.audit(flights)[0])
    windows = [found[0] for case in cases if (found := cut_windows(case.flight, case.spans, "mocap"))]
    starts = np.concatenate([np.concatenate([w.position_m, w.velocity_m_s, w.quaternion, w.rate_rad_s], 1)
                             for w in windows])
    motor, battery = np.concatenate([w.motor for w in windows]), np.concatenate([w.battery_V for w in windows])
    chosen = np.unique(np.linspace(0, len(starts) - 1, given.windows).astype(int))
    with TemporaryDirectory() as folder:
        account = export_model(model, "rotorpy", folder).account
    bent = {**dict.fromkeys(account.approximated, "approximated"), **dict.fromkeys(account.left_out, "left out")}
    base = model.without(*bent)
    rows, only = {"what both express": base}, {"what both express": "nothing"}
    for term, fate in bent.items():
        try:
            rows[f"+ {term} ({fate})"] = model.without(*(other for other in bent if other != term))
        except ValueError:  # an effect that does nothing alone
            continue
        only[f"+ {term} ({fate})"] = term
    rows["the whole model"] = model
    kind = "SYNTHETIC" if all(f.provenance.synthetic for f in flights) else "REAL"
    print(f"{len(chosen)} windows of {len(cases)} {kind} flights; after 0.1 s | 0.5 s: m, m/s, rad, rad/s")
    gaps = []
    for name, candidate in rows.items():
        found = difference(candidate, starts[chosen], motor[chosen], battery[chosen])
        print(f"{name:36s} " + "  |  ".join(" ".join(f"{value:8.1e}" for value in row) for row in found))
        gaps.append({"term": only.get(name, "all"), "position_m": dict(zip((10, 50), found[:, 0], strict=True))})
    if given.json:
        write_json(given.json, {"synthetic": kind == "SYNTHETIC", "windows": len(chosen), "flights": len(cases),
                                "rows": gaps})


if __name__ == "__main__":
    main()
