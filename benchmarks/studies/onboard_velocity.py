"""Why the vehicle's own velocity is wrong by a share that differs between flights: its filter, run again.

    python benchmarks/studies/onboard_velocity.py [--data DIR] [--limit N] [--json FILE]

Real recordings, re-timed. Of every flight with a streamed path: slope of the estimated on the true horizontal
velocity, and correlation of the residual along the track. Both for the logged estimate and for the firmware's filter
fed with the recorded IMU and poses. The SD of poses is that of the firmware's default and that of Crazyswarm2. Both
also run with every pose that was sent in a gap of the radio arriving at its end. Gaps are read from missing packets of
the log alone (``signals.radio_gaps``). No number is fitted, but the cause was found by looking at these flights.
"""

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from controllers.plants.kalman_senses import POSE_SD_M, POSE_SD_RAD
from estimators.firmware_ekf import FirmwareEkf
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import InputError
from nanobench_tools.firmware.kalman import ATTITUDE_SD_RAD, POSITION_SD_M
from nanobench_tools.flight import Flight, Span
from nanobench_tools.metrics.statistics import bootstrap_interval
from nanobench_tools.protocols.gate import select
from nanobench_tools.protocols.phases import streamed_phase
from nanobench_tools.protocols.sessions import labels_of
from nanobench_tools.results.result_files import write_json
from nanobench_tools.sources.discover import default_data, load_recordings
from nanobench_tools.time_offsets.moving.apply import retimed

LATE_S = 0.015
"""Of a pose on its way; a constant one does not move the slope."""
SETTLED_S = 3.0
BY_DEFAULT, CRAZYSWARM2 = (POSITION_SD_M, ATTITUDE_SD_RAD), (POSE_SD_M, POSE_SD_RAD)
FILTERS = {"default, on time": (*BY_DEFAULT, False), "default, gaps": (*BY_DEFAULT, True),
           "Crazyswarm2, on time": (*CRAZYSWARM2, False), "Crazyswarm2, gaps": (*CRAZYSWARM2, True)}
"""Row -> standard deviations of a pose in the filter, and whether poses wait for the radio."""


def again(flight: Flight, silent: Sequence[Span], told: tuple[float, float, bool], time_s: np.ndarray) -> np.ndarray:
    """(m, 2) m/s: level velocity of the firmware's filter at ``time_s``."""
    poses = flight["mocap"]
    arrival = poses.time_s + LATE_S
    if told[2]:
        for span in silent:
            waiting = (arrival > span.start_s) & (arrival < span.end_s)
            arrival[waiting] = span.end_s
    late = flight.with_streams(mocap=dataclasses.replace(poses, time_s=arrival))
    found = FirmwareEkf(pose_sd=told[:2]).estimate(late)
    return np.column_stack([np.interp(time_s, found.time_s, found.velocity_m_s[:, k]) for k in range(2)])


def against(velocity: np.ndarray, true: np.ndarray) -> tuple[float, np.ndarray]:
    """Slope, and what is left along the track (m,)."""
    slope = float((velocity * true).sum() / (true**2).sum())
    along = true / np.maximum(np.linalg.norm(true, axis=1), 0.05)[:, None]
    return slope, ((velocity - slope * true) * along).sum(axis=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, help="folder of recordings; default: where nanobench looks")
    parser.add_argument("--limit", type=int, help="only so many flights")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    places = [given.data] if given.data else default_data()
    if not places:
        print("REAL RECORDINGS ABSENT: nothing to compare with; set NANOBENCH_DATA")
        return
    flights = load_recordings(places).flights
    cases, _ = select(flights, {flight.name: audit(flight) for flight in flights})
    slopes: dict[str, list[float]] = {name: [] for name in ("logged", *FILTERS)}
    correlations: dict[str, list[float]] = {name: [] for name in FILTERS}
    share, flown = [], []
    for case in cases[:given.limit]:
        phase = streamed_phase(case.flight, [case.span])
        try:
            flight = retimed(case.flight)
        except InputError:  # its clock is unknown
            continue
        if phase is None:
            continue
        t = case.time_s[(case.time_s > phase.start_s + SETTLED_S) & (case.time_s < phase.end_s)]
        if len(t) < 500:
            continue
        true = flight["mocap"].interpolate(("vx", "vy"), t)
        slope, rest = against(flight["estimator"].interpolate(("vx", "vy"), t), true)
        slopes["logged"].append(slope)
        silent = np.zeros(len(t), bool)
        for span in case.silent:
            silent |= span.mask(t)
        share.append(100.0 * float(silent.mean()))
        flown.append(flight)
        for name, told in FILTERS.items():
            slope, left = against(again(flight, case.silent, told, t), true)
            slopes[name].append(slope)
            correlations[name].append(float(np.corrcoef(rest, left)[0, 1]))
        print(f"{flight.name:32} radio silent {share[-1]:4.1f} %  " + "  ".join(
            f"{name} {values[-1]:.3f}" for name, values in slopes.items()), flush=True)
    n, logged = len(share), np.array(slopes["logged"])
    if n < 3:
        print(f"n = {n}: too few flights for a table")
        return
    print(f"\nn = {n} real flights, re-timed. Estimated over true velocity: logged {logged.mean():.3f}, from "
          f"{logged.min():.3f} to {logged.max():.3f}; correlation with the radio's silence over flights "
          f"{np.corrcoef(share, logged)[0, 1]:+.2f}")
    good = np.array(share) < 1.0
    rows: list[dict[str, object]] = []
    for name in FILTERS:
        off = np.array(slopes[name]) - logged
        low, high = bootstrap_interval(np.abs(off), sessions=labels_of(flown)) or (np.nan, np.nan)
        left = np.array(correlations[name])
        parts = [f"{np.median(left[some]):+.2f} in {some.sum()} flights {word}" for some, word in
                 ((good, "with less than 1 % silence"), (~good, "with more")) if some.any()]
        over_flights = np.corrcoef(slopes[name], logged)[0, 1]
        rows.append({"filter": name, "off": np.abs(off).mean(), "off_ci95": [low, high], "correlation": over_flights,
                     "along_quiet": np.median(left[good]), "along_gaps": np.median(left[~good])})
        print(f"{name:22} off by {np.abs(off).mean():.3f} ({low:.3f} .. {high:.3f}, 95 %), correlation of slopes over "
              f"flights {over_flights:+.2f}; of what is left along the track, median: "
              + ", ".join(parts))
    if given.json:
        write_json(given.json, {"synthetic": False, "rows": rows, "logged": {
            "n": n, "quiet": good.sum(), "gaps": (~good).sum(), "least_off": logged.min() - 1.0,
            "most_off": logged.max() - 1.0, "with_silence": np.corrcoef(share, logged)[0, 1]}})


if __name__ == "__main__":
    main()
