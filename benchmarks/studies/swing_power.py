"""The smallest swing that is found, put into real flights: a sideways acceleration to and fro that no tilt asks for.

    python benchmarks/studies/swing_power.py --normal DIR --data DIR [--hertz 0.63]

Flights of --data with a swing of growing size added to their sideways velocity (SYNTHETIC on real), against --normal.
First the size that a verdict would state, from the flights as they are, at this frequency and over the band.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.mismatch.steady.periodic import Swing, swing_in, swing_of
from identification.mismatch.steady.reconstruct import states_of
from identification.mismatch.steady.smallest_swing import smallest_swing
from identification.mismatch.steady.trim import runs_of
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Flight
from nanobench_tools.sources.discover import load_recordings


def swinging(flights: Sequence[Flight], size_m_s2: float, hertz: float) -> list[Swing]:
    found = []
    for k, flight in enumerate(flights):
        stream = flight["estimator"]
        values = stream.values.copy()
        values[:, stream.index("vy")] -= size_m_s2 / (2.0 * np.pi * hertz) * np.cos(
            2.0 * np.pi * hertz * stream.time_s + k)
        pushed = flight.with_streams(estimator=replace(stream, values=values))
        states = states_of(pushed)
        command = flight["motor"]["m1", "m2", "m3", "m4"]
        found.append(swing_in(states, runs_of(flight, audit(flight), command, states.time_s)))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--normal", type=Path, required=True)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--hertz", type=float, default=0.63)
    options = parser.parse_args()
    usual = swinging(load_recordings([options.normal]).flights, 0.0, options.hertz)
    flights = load_recordings([options.data]).flights
    stated = smallest_swing(swinging(flights, 0.0, options.hertz), usual, 0.035)
    if stated["minimum_detectable"] is None:
        print(f"stated: cannot be computed for, {stated['why']}")
    else:
        near = min(stated["by_hz"], key=lambda row: abs(row[0] - options.hertz))
        print(f"stated: from {near[1]:.3f} m/s^2 on at {near[0]:.2f} Hz, from {stated['minimum_detectable']:.3f} on at "
              f"all of {stated['band_hz'][0]:.2f} to {stated['band_hz'][1]:.2f} Hz, axes {', '.join(stated['axes'])}")
    for size in (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3):
        found = swing_of(swinging(flights, size, options.hertz), usual)
        said = "nothing" if found is None else f"{found['frequency_hz']:.2f} Hz, p = {found['p']:.0e}"
        print(f"{size:.2f} m/s^2 at {options.hertz:g} Hz in {len(flights)} flights, {len(usual)} normal: {said}")


if __name__ == "__main__":
    main()
