"""What the onboard filter's error on NanoBench recordings comes from, in mm: re-timing and replay, effect by effect.

python benchmarks/onboard_attribution.py [--data DIR]

First block: the logged estimate as recorded, with the constant offset of every flight taken out, and with the moving
error that gyro and accelerometer alone show (the estimate is not used to find the clock that judges it). Second block:
the firmware's filter run again on the re-timed IMU with a pose every 10 ms, then with one thing changed; "moves" is the
RMS distance between the two estimates, "ATE" how much the mean error changes. Intervals: 95 %, flights drawn.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from estimators.drag_ekf import DragMatrixEkf
from estimators.firmware_ekf import FirmwareEkf
from estimators.onboard_ekf import OnboardEkf
from nanobench_tools import so3
from nanobench_tools.cli.options import Options
from nanobench_tools.errors import NanobenchError
from nanobench_tools.firmware.kalman import defaults
from nanobench_tools.flight import Flight
from nanobench_tools.methods import Estimate
from nanobench_tools.metrics.statistics import bootstrap_interval
from nanobench_tools.protocols import aided, task3
from nanobench_tools.protocols.selection import distinct

WHOLE = aided.Aiding(rate_hz=100.0, delay_s=0.0, noise_m=0.0)
LATE_S, LOST = 0.02, 0.13
"""The lag of the logged position behind the gyro, and the share of IMU packets that did not arrive."""


def grounded(flight: Flight) -> Flight:
    """The same flight with motors that stand: the filter then integrates all of the accelerometer, not thrust alone,
    so that it sees the drag it else leaves out."""
    motor = flight["motor"]
    return flight.with_streams(motor=replace(motor, values=np.zeros_like(motor.values)))


def noisier(flight: Flight, factor: float) -> Estimate:
    """The filter with the process noise of its accelerations scaled; it starts at the first pose all the same."""
    found, mocap = defaults(), flight["mocap"]
    found["initial_m"] = mocap["px", "py", "pz"][0]
    found["initial_yaw_rad"] = so3.euler_zyx(mocap["qx", "qy", "qz", "qw"][:1])[0, 2]
    for name in ("acc_xy_m_s2", "acc_z_m_s2"):
        found[name] = factor * found[name]
    return FirmwareEkf(found).estimate(flight)


Variant = Callable[[task3.Case, task3.Case], Estimate]
REPLAYS: dict[str, Variant] = {
    "replay on the re-timed IMU": lambda _, case: FirmwareEkf().estimate(aided.given_to(case, WHOLE)),
    "IMU as recorded (telemetry clock)": lambda case, _: FirmwareEkf().estimate(aided.given_to(case, WHOLE)),
    f"poses {1e3 * LATE_S:.0f} ms late": lambda _, case: FirmwareEkf().estimate(
        aided.given_to(case, replace(WHOLE, delay_s=LATE_S))),
    f"{100 * LOST:.0f} % of the poses lost": lambda _, case: FirmwareEkf().estimate(
        aided.given_to(case, replace(WHOLE, loss=LOST))),
    "IMU rows held, not on lines": lambda _, case: FirmwareEkf(held=True).estimate(aided.given_to(case, WHOLE)),
    "drag seen (all of the accelerometer)": lambda _, case: FirmwareEkf().estimate(
        grounded(aided.given_to(case, WHOLE))),
    "process noise doubled (parameters)": lambda _, case: noisier(aided.given_to(case, WHOLE), 2.0),
    "another filter: drag_matrix_ekf": lambda _, case: DragMatrixEkf().estimate(aided.given_to(case, WHOLE)),
}


def scores(case: task3.Case, estimate: Estimate) -> dict[str, float]:
    """ATE (SE(3)), along and across the track without alignment, in m."""

    class Made:
        name, causal = "made", True

        def estimate(self, _: Flight) -> Estimate:
            return estimate

    found = task3.score_given(case, Made(), "clean", case.flight, -np.inf)["metrics"]
    return {"ATE": found["ate_rmse_m"], "along": found["along_track_rmse_m"], "across": found["across_track_rmse_m"]}


def apart(case: task3.Case, a: Estimate, b: Estimate) -> float:
    """RMS distance of two estimates in the scored spans [m], at the stamps of a."""
    rows = task3.inside(case.spans, a.time_s)
    other = np.stack([np.interp(a.time_s[rows], b.time_s, b.position_m[:, k]) for k in range(3)], axis=1)
    return float(np.sqrt(np.mean(np.sum((a.position_m[rows] - other) ** 2, axis=1))))


def line(label: str, values: list[float]) -> str:
    low, high = bootstrap_interval(values) or (float("nan"), float("nan"))
    return f"{label} {1e3 * np.mean(values):6.2f} [{1e3 * low:6.2f}, {1e3 * high:6.2f}]"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, action="append", default=[])
    options = Options(data=tuple(parser.parse_args().data))
    flights = options.load()
    audits, _ = options.audit(flights)
    recorded = {case.flight.name: case for case in task3.select(flights, audits, "clean")}
    clocks = {"as recorded": recorded}
    for clock in ("offset", "retimed"):
        seen = replace(options, clock=clock).see_on_clock(distinct(flights)[0], audits, True)
        clocks[clock] = {case.flight.name: case for case in task3.select(seen.flights, seen.audits, "clean")}
    show(clocks)


def show(clocks: dict[str, dict[str, task3.Case]]) -> None:
    """Both blocks; ``clocks``: {clock: {flight: case}}, ``as recorded`` and ``retimed`` among them."""
    recorded = clocks["as recorded"]
    names = [name for name in recorded if all(name in cases for cases in clocks.values())]
    print(f"logged estimate, {len(names)} flights, mean over flights, mm [95 %]")
    for clock, cases in clocks.items():
        found = [scores(cases[name], OnboardEkf().estimate(cases[name].flight)) for name in names]
        print(f"  {clock:38s}", "  ".join(line(key, [f[key] for f in found]) for key in ("ATE", "along", "across")))
    results: dict[str, list[tuple[float, float, float]]] = {key: [] for key in REPLAYS}
    base_name = next(iter(REPLAYS))
    for name in names:
        case, retimed = recorded[name], clocks["retimed"][name]
        try:
            made = {key: make(case, retimed) for key, make in REPLAYS.items()}
            base = scores(retimed, made[base_name])
            rows = {}
            for key, estimate in made.items():
                one = scores(retimed, estimate)
                rows[key] = (one["ATE"], one["ATE"] - base["ATE"], apart(retimed, made[base_name], estimate))
        except NanobenchError as error:
            print(f"  left out: {error}")
            continue
        for key, row in rows.items():
            results[key].append(row)
    print(f"the filter run again, {len(results[base_name])} flights, mean over flights, mm [95 %]")
    for key, values in results.items():
        columns = list(zip(*values, strict=True))
        print(f"  {key:38s}", "  ".join(line(label, list(column)) for label, column in
                                         zip(("ATE", "change", "moves"), columns, strict=True)))


if __name__ == "__main__":
    main()
