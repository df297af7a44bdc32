"""Practice flights beside real ones: simple statistics, median (10th and 90th percentile) over flights.

    python benchmarks/studies/practice_realism.py [--flights 24] [--seed 0] [--data DIR]

Without real recordings only the practice column is shown.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

from nanobench_tools.flight import Flight, Span
from nanobench_tools.practice import LoggingChain, practice_flights
from nanobench_tools.sources.discover import default_data, load_recordings
from nanobench_tools.sources.interpolation import carries_no_packet

TAIL_S = 0.5


def lift_off_s(flight: Flight) -> float:
    mocap = flight["mocap"]
    return float(mocap.time_s[np.argmax(mocap["pz"] > mocap["pz"][0] + 0.05)])


def motors_s(flight: Flight) -> tuple[float, float]:
    motor = flight["motor"]
    on = np.flatnonzero(motor["m1"] > 0.02)
    return float(motor.time_s[on[0]]), float(motor.time_s[on[-1]])


def airborne(flight: Flight) -> Flight:
    """From one second after lift-off to three seconds before the motors stop."""
    return flight.during(Span(lift_off_s(flight) + 1.0, motors_s(flight)[1] - 3.0))


def rough(x: np.ndarray) -> float:
    """What white noise of that size would give the same second differences: mostly content above 20 Hz."""
    return float(np.median(np.abs(np.diff(x, 2))) / 0.6745 / math.sqrt(6.0))


def band(x: np.ndarray, low: float, high: float) -> np.ndarray:
    return sosfiltfilt(butter(2, [low, high], "bandpass", fs=100.0, output="sos"), x, axis=0)


def gyro_slope(flight: Flight, axis: int) -> tuple[float, float]:
    """Slope and correlation of the gyro on the mocap rate, 0.3-8 Hz, in the air."""
    air = airborne(flight)
    w = band(air["mocap"]["wx", "wy", "wz"][:, axis], 0.3, 8.0)
    g = band(air["imu"]["gyro_x", "gyro_y", "gyro_z"][:, axis], 0.3, 8.0)
    return float(w @ g / (w @ w)), float(np.corrcoef(w, g)[0, 1])


def actuator_lag_s(flight: Flight) -> float:
    """Lag of best correlation between roll command (PWM differences) and angular acceleration from the gyro."""
    air = airborne(flight)
    m = air["motor"]["m1", "m2", "m3", "m4"]
    torque = band((m[:, 2] + m[:, 3] - m[:, 0] - m[:, 1])[:, None], 0.5, 12.0)[:, 0]
    turn = band(np.gradient(air["imu"]["gyro_x"], 0.01)[:, None], 0.5, 12.0)[:, 0]
    lags = np.arange(0, 12)
    return 0.01 * float(lags[np.argmax([np.corrcoef(torque[:len(torque) - k], turn[k:])[0, 1] for k in lags])])


def hover(flight: Flight) -> tuple[float, float]:
    """Mean PWM and voltage in slow stretches at 1 g."""
    air = airborne(flight)
    speed = np.linalg.norm(air["mocap"]["vx", "vy", "vz"], axis=1)
    still = speed < 0.15
    if still.sum() < 10:
        return math.nan, math.nan
    return float(air["motor"].values[still].mean()), float(air["battery"]["vbat"][still].mean())


def estimate_error_mm(flight: Flight) -> float:
    """RMS distance of estimated from true position after the best constant delay (0-40 ms)."""
    air = airborne(flight)
    t, p, e = air["mocap"].time_s, air["mocap"]["px", "py", "pz"], air["estimator"]["x", "y", "z"]
    rms = [np.sqrt(np.mean(np.sum((e - np.stack([np.interp(t - d, t, c) for c in p.T], 1)) ** 2, axis=1)))
           for d in np.arange(0.0, 0.041, 0.0025)]
    return 1e3 * float(min(rms))


def tracking_rmse_m(flight: Flight) -> float:
    """Setpoint minus position on the path."""
    start, end = motors_s(flight)
    path = flight.during(Span(start + 5.5, end - 4.0))
    error = path["mocap"]["px", "py", "pz"] - path["setpoint"]["x", "y", "z"]
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


def at_rest(flight: Flight, stream: str, column: str) -> float:
    return float(np.std(flight.during(Span(0.0, 1.5))[stream][column]))


def collinear(flight: Flight, stream: str) -> float:
    air = airborne(flight)[stream]
    return 100.0 * float(np.mean(carries_no_packet(air.time_s, air.values)))


STATISTICS: dict[str, Callable[[Flight], float]] = {
    "imu packets / rows": lambda f: f["imu"].samples / len(f["imu"]),
    "motor packets / rows": lambda f: f["motor"].samples / len(f["motor"]),
    "battery packets / s": lambda f: f["battery"].samples / f.span.duration_s,
    "imu collinear rows, %": lambda f: collinear(f, "imu"),
    "estimator collinear rows, %": lambda f: collinear(f, "estimator"),
    "motors on, s": lambda f: motors_s(f)[0],
    "lift-off after motors on, s": lambda f: lift_off_s(f) - motors_s(f)[0],
    "battery at rest, V": lambda f: float(f["battery"]["vbat"][:50].mean()),
    "battery in the air, V": lambda f: float(np.median(airborne(f)["battery"]["vbat"])),
    "hover PWM + (V - 3.45) 14628 counts": lambda f: 65535.0 * hover(f)[0] + 14628.0 * (hover(f)[1] - 3.45),
    "acc z at rest, m/s^2": lambda f: at_rest(f, "imu", "acc_z"),
    "gyro x at rest, rad/s": lambda f: at_rest(f, "imu", "gyro_x"),
    "mocap px at rest, mm": lambda f: 1e3 * rough(f.during(Span(0.0, 1.5))["mocap"]["px"]),
    "mocap wy at rest, rad/s": lambda f: at_rest(f, "mocap", "wy"),
    "vbat roughness, mV": lambda f: 1e3 * rough(airborne(f)["battery"]["vbat"][::11]),
    "acc x roughness in the air": lambda f: rough(airborne(f)["imu"]["acc_x"]),
    "acc z roughness in the air": lambda f: rough(airborne(f)["imu"]["acc_z"]),
    "gyro x roughness in the air": lambda f: rough(airborne(f)["imu"]["gyro_x"]),
    "gyro z roughness in the air": lambda f: rough(airborne(f)["imu"]["gyro_z"]),
    "mocap wx roughness in the air": lambda f: rough(airborne(f)["mocap"]["wx"]),
    "motor 1 roughness, counts": lambda f: 65535.0 * rough(airborne(f)["motor"]["m1"]),
    "gyro x RMS in the air, rad/s": lambda f: float(np.std(airborne(f)["imu"]["gyro_x"])),
    "acc z SD in the air, m/s^2": lambda f: float(np.std(airborne(f)["imu"]["acc_z"])),
    "gyro x slope on mocap": lambda f: gyro_slope(f, 0)[0],
    "gyro x correlation with mocap": lambda f: gyro_slope(f, 0)[1],
    "gyro z slope on mocap": lambda f: gyro_slope(f, 2)[0],
    "actuator lag roll, s": actuator_lag_s,
    "EKF position error, mm": estimate_error_mm,
    "EKF velocity error, m/s": lambda f: float(np.sqrt(np.mean(np.sum(
        (airborne(f)["estimator"]["vx", "vy", "vz"] - airborne(f)["mocap"]["vx", "vy", "vz"]) ** 2, axis=1)))),
    "tracking RMSE, m": tracking_rmse_m,
    "largest tilt, deg": lambda f: math.degrees(np.abs(airborne(f)["mocap"]["roll", "pitch"]).max()),
    "motor ceiling reached, % of rows": lambda f: 100.0 * float(
        np.mean((airborne(f)["motor"].values > 0.99).any(axis=1))),
}
"""Name -> number of one flight."""


def complete(flight: Flight) -> bool:
    """Flew, and its log did not stop: what the practice flights imitate."""
    if "motor" not in flight or not np.any(flight["motor"].values > 0.02) or lift_off_s(flight) < 1.0:
        return False
    end = flight.during(Span(flight.span.end_s - 3.0, flight.span.end_s - TAIL_S))
    return bool(np.ptp(end["imu"]["acc_z"]) < 3.0 and np.all(np.abs(end["setpoint"].values) < 3.0)
                and flight.span.duration_s > 20.0 and np.ptp(flight["mocap"]["pz"]) > 0.4)


def column(flights: list[Flight]) -> dict[str, tuple[float, float, float]]:
    found = {}
    for name, function in STATISTICS.items():
        values = np.array([function(f) for f in flights], float)
        found[name] = tuple(np.nanpercentile(values, (50, 10, 90)))
    return found


def distinct(flights: list[Flight]) -> list[Flight]:
    """One of those that start in the same second."""
    return list({int(f.epoch_s): f for f in flights}.values())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--flights", type=int, default=24)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--data", type=Path, default=None)
    options = parser.parse_args()
    chain = LoggingChain()
    practice = practice_flights(options.flights, options.seed, chain=chain)
    wander = practice_flights(min(options.flights, 8), options.seed, chain=replace(chain, wander_sd_s=0.033))
    columns = {f"practice, n = {len(practice)}": column(practice), f"wander 33 ms, n = {len(wander)}": column(wander)}
    places = [options.data] if options.data else default_data()
    if places:
        real = [f for f in distinct(load_recordings(places).flights) if not f.provenance.synthetic and complete(f)]
        if real:
            columns[f"real, n = {len(real)}"] = column(real)
    else:
        print("REAL RECORDINGS ABSENT: only practice flights are shown")
    print(f"{'':38s}" + "".join(f"{name:>34s}" for name in columns))
    for name in STATISTICS:
        cells = "".join(f"{'{:.4g} ({:.4g} .. {:.4g})'.format(*c[name]):>34s}" for c in columns.values())
        print(f"{name:38s}{cells}")


if __name__ == "__main__":
    main()
