"""The firmware's control code against what real flights logged of it: median (10th, 90th percentile) over flights.

    python benchmarks/studies/firmware_internals.py [--data DIR] [--clock as-recorded|retimed]

Motors: PWM of the logged thrust command by the battery compensation, against the mean command that the four logged
PWMs decode to. Controllers: fed with the logged estimate, gyro, setpoint and battery (open loop, 100 Hz logs of a 1
kHz loop). Desired angles and thrust are compared with the logged ones. The Mellinger controller logs none, so its
thrust is judged by the decoded motor command, and in both by the PWM of every motor. Rows: airborne, without faults.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter1d

from nanobench_tools.auditing.recording_audit import Audit, audit
from nanobench_tools.auditing.selection import distinct
from nanobench_tools.errors import InputError
from nanobench_tools.firmware.motor_output import BUILD, compensated
from nanobench_tools.firmware.replay import CONTROLLERS, MOTORS, Replay, build_of, flown_command, replay
from nanobench_tools.flight import Flight, intersect_spans, mask_of
from nanobench_tools.sources.discover import default_data, load_recordings
from nanobench_tools.time_offsets.moving.apply import retimed
from nanobench_tools.units import PWM_FULL_SCALE

STREAMS = ("estimator", "attitude_qw", "imu", "setpoint", "motor", "battery", "pid")
SETTLED_S = 2.0
"""After lift-off: integrals that began on the ground have the same history by then."""
FEWEST_ROWS = 500
DRIFT_ROWS = 200
"""Open loop, integrals of logged states drift from those flown: 1 cm/s of climb is 150 counts a second."""
MOST_AT_CAP = 0.05
"""Share of rows at the cap above which thrust is not judged: an integral at its end remembers what no log shows."""


def judged(flight: Flight, verdict: Audit, time_s: np.ndarray) -> np.ndarray:
    """(m,) bool: in the air for a while, where no stream has a fault."""
    rows = mask_of(intersect_spans(verdict.airborne, verdict.clean_for(STREAMS)), time_s)
    return rows & (time_s > verdict.airborne[0].start_s + SETTLED_S) if verdict.airborne else rows


def motor_law(flight: Flight, rows: np.ndarray, time_s: np.ndarray) -> dict[str, float]:
    """Difference in counts of PWM between what the logged command gives and what was logged; rows below the cap."""
    command = PWM_FULL_SCALE * flight["pid"].interpolate("cmd_thrust", time_s)
    volt = flight["battery"].interpolate("vbat", time_s).astype(np.float32)
    free = rows & (flight["motor"].interpolate(MOTORS, time_s).max(axis=1) < 0.99) & (command < 0.99 * PWM_FULL_SCALE)
    if free.sum() < FEWEST_ROWS:
        return {}
    build = build_of(flight)
    if build is None:
        return {}
    law = compensated(command.astype(np.float32), volt, *build[0])
    flown = compensated(flown_command(flight, time_s, build).astype(np.float32), volt, *build[0])
    off = flown[free] - law[free]
    return {"thrust of 65535 counts [N]": float(build[0, 0]), "rows below the cap": float(free.sum()),
            "PWM of the command, median [counts]": float(np.median(off)),
            "PWM of the command, median distance [counts]": float(np.median(np.abs(off)))}


def internals(flight: Flight, controller: str, found: Replay, rows: np.ndarray) -> dict[str, float]:
    """Agreement of the replayed controller with the log."""
    out = {"rows": float(rows.sum())}
    if controller == "pid":
        angles = np.degrees(flight["pid"].interpolate(("roll", "pitch"), found.time_s)[rows])
        mine = np.degrees(found.attitude_rad[rows, :2])
        for k, name in enumerate(("roll", "pitch")):
            out[f"desired {name}, correlation"] = float(np.corrcoef(mine[:, k], angles[:, k])[0, 1])
            out[f"desired {name}, RMS difference [deg]"] = float(np.sqrt(np.mean((mine[:, k] - angles[:, k])**2)))
            out[f"desired {name}, SD of the log [deg]"] = float(angles[:, k].std())
        thrust = PWM_FULL_SCALE * flight["pid"].interpolate("cmd_thrust", found.time_s)
    else:
        thrust = flown_command(flight, found.time_s)
    motor = flight["motor"].interpolate(MOTORS, found.time_s)[rows]
    full = (motor.max(axis=1) > 0.99) | (thrust[rows] > 0.99 * PWM_FULL_SCALE)
    out["rows at the cap [%]"] = 100.0 * float(full.mean())
    if full.mean() < MOST_AT_CAP:
        out["thrust, correlation"] = float(np.corrcoef(found.thrust[rows], thrust[rows])[0, 1])
        fast = [x - uniform_filter1d(x, DRIFT_ROWS) for x in (found.thrust, thrust)]
        out["thrust without drift, correlation"] = float(np.corrcoef(fast[0][rows], fast[1][rows])[0, 1])
        out["thrust, mean difference [counts]"] = float(np.mean(found.thrust[rows] - thrust[rows]))
        away = PWM_FULL_SCALE * (found.motor[rows] - motor)
        out["motors, mean difference [counts]"] = float(away.mean())
        out["motors, RMS difference [counts]"] = float(np.sqrt(np.mean(away**2)))
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, help="folder of recordings; default: where nanobench looks")
    parser.add_argument("--clock", choices=("as-recorded", "retimed"), default="as-recorded")
    given = parser.parse_args()
    places = [given.data] if given.data else default_data()
    if not places:
        print("REAL RECORDINGS ABSENT: nothing to compare with; set NANOBENCH_DATA")
        return
    tables: dict[str, list[dict[str, float]]] = {"motors": [], **{name: [] for name in CONTROLLERS}}
    for flight in distinct(load_recordings(places).flights)[0]:
        if not set(STREAMS) <= set(flight.streams):
            continue
        verdict = audit(flight)
        if verdict.controller not in CONTROLLERS:
            continue
        if given.clock == "retimed":
            try:
                flight = retimed(flight)
            except InputError:  # its clock is unknown
                continue
        build = build_of(flight)
        found = replay(flight, verdict.controller, BUILD if build is None else build)
        rows = judged(flight, verdict, found.time_s) & found.on
        if rows.sum() < FEWEST_ROWS:
            continue
        tables[verdict.controller].append(internals(flight, verdict.controller, found, rows))
        if verdict.controller == "pid" and (law := motor_law(flight, rows, found.time_s)):
            tables["motors"].append(law)
    builds = [round(flight["thrust of 65535 counts [N]"], 4) for flight in tables["motors"]]
    print("builds: " + ", ".join(f"{builds.count(b)} flights of {b} N at 65535 counts" for b in sorted(set(builds))))
    for name, flights in tables.items():
        print(f"\n{name}, clock {given.clock}: n = {len(flights)} real flights")
        for key in dict.fromkeys(key for flight in flights for key in flight):
            values = [flight[key] for flight in flights if key in flight]
            low, middle, high = np.quantile(values, (0.1, 0.5, 0.9))
            print(f"  {key:57} {middle:10.4g}  ({low:.4g}, {high:.4g})  n = {len(values)}")


if __name__ == "__main__":
    main()
