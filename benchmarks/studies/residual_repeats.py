"""Is what a simulator leaves chance, or the same in every flight of one path?

    python benchmarks/studies/residual_repeats.py --data DIR --mass KG

A simulator is identified from every other flight, as ``diagnose --simulated`` does. Its residual force, 0.2 to 2.5 Hz,
is compared between the two flights whose paths over time are most alike, one of them not fitted. Reports their
correlation, their size, and the part that is not common to both, which is chance. Where rotor speed was logged, the
same for the accelerometer less k_f times its square. This does not use thrust map, motion capture or clock.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

from identification.mismatch.believe import beliefs
from identification.mismatch.diagnosis import recorded
from identification.mismatch.wrench import FORCE_ROWS, ROW_S, Wrench
from nanobench_tools.flight import Flight
from nanobench_tools.physics import Vehicle
from nanobench_tools.sources.discover import load_recordings

BAND_HZ = 0.2, 2.5
STEP_S = FORCE_ROWS * ROW_S
LEAST_S = 3.0
ALIKE_M = 0.15


def lift(flight: Flight, time_s: np.ndarray, acc_z: np.ndarray) -> np.ndarray | None:
    """(n,) vertical accelerometer less what the squared rotor speeds explain of its mean, m/s^2."""
    if "rpm" not in flight:
        return None
    stream = flight["rpm"]
    square = sum(np.interp(time_s, stream.time_s, column**2) for column in stream.values.T)
    return acc_z - square * (acc_z.mean() / square.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, nargs="+", required=True)
    parser.add_argument("--mass", type=float, required=True)
    options = parser.parse_args()
    flights = load_recordings(options.data).flights
    fitted, others = recorded(flights[::2]), recorded(flights[1::2])
    model = beliefs(fitted, Vehicle(mass_kg=options.mass))
    print(f"REAL: fitted to {len(flights[::2])} flights: {', '.join(t.name for t in model.terms)}")
    band = butter(3, BAND_HZ, "band", fs=1.0 / STEP_S, output="sos")
    seen = []
    for mine in (fitted, others):
        wrench = Wrench(mine.tracks)
        force = wrench.residual(model)[0]
        at = wrench.force_at
        acc_z = wrench._smooth(np.concatenate([t.force_m_s2 for t in mine.tracks])[:, 2:], 0)[at, 0]
        for number in np.unique(wrench.flight[at]):
            here = wrench.flight[at] == number
            time_s, since = wrench.of("time_s", at)[here], wrench.of("since_s", at)[here]
            if np.ptp(since) < LEAST_S:
                continue
            other = lift(mine.flights[number], time_s, acc_z[here])
            left = np.column_stack([force[here], np.full(here.sum(), np.nan) if other is None else other])
            grid = np.arange(since[0], since[-1], STEP_S)
            even = np.stack([np.interp(grid, since, column) for column in left.T], axis=1)
            place = np.stack([np.interp(grid, since, c) for c in wrench.of("position_m", at)[here].T], axis=1)
            seen.append((mine is fitted, mine.flights[number].name, grid,
                         sosfiltfilt(band, even - even.mean(axis=0), axis=0), place))
    words = ("force x", "force y", "force z", "accelerometer z less rotor speed")
    rows = []
    for _, name, time_s, left, place in (s for s in seen if s[0]):
        pairs = []
        for _, other, time_2, left_2, place_2 in (s for s in seen if not s[0]):
            start, end = max(time_s[0], time_2[0]), min(time_s[-1], time_2[-1])
            if end - start < LEAST_S:
                continue
            grid = np.arange(start, end, STEP_S)

            def on(stamps: np.ndarray, values: np.ndarray, grid: np.ndarray = grid) -> np.ndarray:
                return np.stack([np.interp(grid, stamps, c) for c in values.T], axis=1)

            apart = on(time_s, place) - on(time_2, place_2)
            pairs.append((float(np.sqrt((apart**2).sum(axis=1).mean())), other, on(time_s, left), on(time_2, left_2)))
        if not pairs or min(pairs)[0] > ALIKE_M:
            continue
        apart, other, a, b = min(pairs, key=lambda p: p[0])
        alike = [float(np.corrcoef(x, y)[0, 1]) for x, y in zip(a.T, b.T, strict=True)]
        rows.append((alike, b.std(axis=0), (a - b).std(axis=0) / np.sqrt(2.0)))
        print(f"{name}, {other} ({apart:.3f} m apart): correlation " + ", ".join(f"{r:.2f}" for r in alike))
    if not rows:
        print("no two flights of one path")
        return
    for k, word in enumerate(words):
        alike, size, chance = (np.median([row[i][k] for row in rows]) for i in range(3))
        print(f"{word}, median of {len(rows)} pairs, {BAND_HZ[0]:g} to {BAND_HZ[1]:g} Hz: correlation {alike:.2f}, "
              f"{size:.3f} m/s^2 in the flight not fitted, of which by chance {chance:.3f}")


if __name__ == "__main__":
    main()
