"""Do the parameters of the fitted vehicle agree with a scale, a ruler, a thrust stand and a tachometer?

    python -m benchmarks.studies.vehicle_truths DIR [--mass KG] [--arm M]

One table for each way of logging. Logs with measured rotor speed are fitted three times: as they are, with commands
alone, and with commands alone in rows of 10 ms. Their truth comes from the measured rotor speed of the same flights,
which the fits to commands do not see. Flights without rotor speed are compared with TRUTHS of the Crazyflie 2.x.

Columns: value in the file, value of the flights alone, share of the prior, truth, ratio of file and truth, aim
reached. A row with 100 % prior tests the prior alone: its sources and these truths overlap.
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.greybox.fit_windows import cases_of
from identification.motors import lag, torque
from identification.motors.force import fit_force
from identification.motors.motor_study import hover
from identification.motors.rotor_rows import Log, read_logs
from identification.vehicle.motion_sums import SLOW_HZ
from identification.vehicle.vehicle_fit import VehicleFit, fit_vehicle
from identification.vehicle.vehicle_priors import priors_of
from nanobench_tools.auditing.selection import distinct
from nanobench_tools.flight import Flight
from nanobench_tools.physics import Vehicle
from nanobench_tools.physics.vehicle import sized
from nanobench_tools.protocols.completed import completed
from nanobench_tools.protocols.task1 import Case
from nanobench_tools.sources.discover import load_recordings

ROW_S = 0.01
"""Row of a radio log [s]."""
FULL_V = 3.6
"""Voltage of a motor at full command on a charged battery under load [V]."""
STOCK = (0.7, 1.4)
"""Thrust levels of the motors and propellers that TRUTHS is about."""
BY_STAND = ("k_m, mm", "J_z, 1e-5 kg m^2")
"""Rotor speed does not show these: about z, the share of the rotors' reaction depends on the band."""


@dataclass(frozen=True)
class Truth:
    """``source``: how it was measured."""

    value: float
    source: str


TRUTHS = {
    "J_x, 1e-5 kg m^2": Truth(1.66, "firmware controller_lee.c 1.66 (27 g); rotor speed 1.59 (34.7 g), 1.67 (37 g)"),
    "J_y, 1e-5 kg m^2": Truth(1.67, "firmware controller_lee.c 1.67 (27 g); rotor speed 1.57 (34.7 g), 1.72 (37 g)"),
    "J_z, 1e-5 kg m^2": Truth(2.93, "firmware controller_lee.c (27 g)"),
    "k_m, mm": Truth(7.0, "firmware 2025.12.1 THRUST2TORQUE, from thrust stands"),
    "lag up, ms": Truth(54.6, "rotor speed of brushed motors"),
    "lag down, ms": Truth(118.9, "rotor speed of brushed motors"),
    "drag x, mN s/m": Truth(16.0, "accelerometer against velocity, whole flights, mean removed"),
    "drag y, mN s/m": Truth(16.5, "accelerometer against velocity, whole flights, mean removed"),
    "thrust at 3.6 V, N": Truth(0.180, "firmware thrust curve, from thrust stands; they differ by 6 %"),
}
"""Of the Crazyflie 2.x with brushed motors and 46 mm propellers."""
AIMS = {"J": 0.15, "k": 0.1, "d": 0.1, "t": 0.1}
"""Largest share a parameter may be off, by the first letter of its name."""
LAG_AIM_MS = 10.0


def quantities(found: VehicleFit) -> dict[str, tuple[float, float, float]]:
    """(value, of the flights alone, share of the prior) by name, in the units of the table."""
    shares = {name: p.prior_share if p.prior_share is not None else 0.0 for name, p in found.parameters.items()}
    value, priors = found.model.parameters, priors_of(found.model.vehicle).believed

    def of(name: str, unit: float) -> tuple[float, float, float]:
        share = shares[name]
        alone = (value[name] - share * priors[name].mean) / (1.0 - share) if share < 1.0 else float("nan")
        return value[name] / unit, alone / unit, share

    curve = np.polynomial.polynomial.polyval(FULL_V, np.array(found.model.values_of("thrust_voltage")["c"]))
    full = value["thrust_scale.s"] * float(curve)
    return {**{f"J_{axis}, 1e-5 kg m^2": of(f"inertia.inertia_kg_m2[{i}]", 1e-5) for i, axis in enumerate("xyz")},
            "k_m, mm": of("yaw_torque.k_m", 1e-3),
            "lag up, ms": of("motor_lag.tau_up_s", 1e-3), "lag down, ms": of("motor_lag.tau_down_s", 1e-3),
            "drag x, mN s/m": of("drag_linear.d[0]", 1e-3), "drag y, mN s/m": of("drag_linear.d[1]", 1e-3),
            f"thrust at {FULL_V} V, N": (full, full, shares["thrust_scale.s"]),
            "thrust level": of("thrust_scale.s", 1.0)}


def measured(logs: Sequence[Log], vehicle: Vehicle, cases: Sequence[Case]) -> dict[str, Truth]:
    """The truth of flights with rotor speed."""
    base, k_f = hover(logs, vehicle), fit_force(logs).k_f_per_kg * vehicle.mass_kg
    lags = lag.fit_lag(base, lag.windows_of(logs), logs[0].row_s)
    turns = {axis: [found.values for log in logs if (found := torque.regress(
        log, i, torque.moments(log, vehicle, k_f)[axis])) is not None] for i, axis in enumerate("xy")}
    x, y = (float(np.median(turns[axis])) for axis in "xy")
    speed = "measured rotor speed"
    found = {"J_x, 1e-5 kg m^2": Truth(1e5 / x, f"{speed} against angular acceleration"),
             "J_y, 1e-5 kg m^2": Truth(1e5 / y, f"{speed} against angular acceleration"),
             "lag up, ms": Truth(1e3 * lags.tau_up_s, speed), "lag down, ms": Truth(1e3 * lags.tau_down_s, speed)}
    drags = np.array([drag for case in cases if (drag := _drag(case.flight, vehicle)) is not None])
    for axis, values in zip("xy", drags.T if len(drags) else (), strict=False):
        found[f"drag {axis}, mN s/m"] = Truth(float(np.median(values)), "accelerometer against velocity by flight")
    return found


def _drag(flight: Flight, vehicle: Vehicle) -> np.ndarray | None:
    """(2,) mN s/m: specific force below SLOW_HZ against the onboard velocity, mean removed; None without a force."""
    from scipy.signal import butter, sosfiltfilt

    from nanobench_tools import so3

    if not {"estimator", "imu", "attitude_qw"} <= set(flight.streams) or "acc_x" not in flight["imu"]:
        return None
    t = np.arange(flight.span.start_s + 1.0, flight.span.end_s - 1.0, ROW_S)
    attitude = flight["attitude_qw"]
    q = so3.interpolate(attitude.time_s, so3.make_continuous(attitude["qx", "qy", "qz", "qw"]), t)
    moves = so3.rotate_inverse(q, flight["estimator"].interpolate(("vx", "vy", "vz"), t))[:, :2]
    sos = butter(2, 2.0 * ROW_S * SLOW_HZ, output="sos")
    v, f = (sosfiltfilt(sos, x, axis=0) for x in (moves, flight["imu"].interpolate(("acc_x", "acc_y"), t)))
    v, f = v - v.mean(axis=0), f - f.mean(axis=0)
    return np.asarray(-1e3 * vehicle.mass_kg * np.sum(v * f, axis=0) / np.sum(v * v, axis=0))


def thinned(flight: Flight) -> Flight:
    """Its streams without rotor speed, one sample in each ROW_S: the newest."""
    streams = {}
    for name, stream in flight.without_streams("rpm").streams.items():
        _, first = np.unique(np.floor(stream.time_s / ROW_S), return_index=True)
        keep = np.zeros(len(stream), bool)
        keep[first] = True
        rate = min(stream.rate_hz, 1.0 / ROW_S)
        streams[name] = stream if keep.all() else replace(stream.rows(keep), rate_hz=rate)
    return flight.with_streams(**streams) if "rpm" not in flight.streams else replace(
        flight.without_streams("rpm"), streams=streams)


def show(title: str, found: VehicleFit, truths: Mapping[str, Truth]) -> list[bool]:
    """Print one table; whether each parameter with a truth is inside its aim."""
    if STOCK[0] < found.model.parameters["thrust_scale.s"] < STOCK[1]:
        truths = {**{name: TRUTHS[name] for name in BY_STAND}, **truths}
    print(f"\n{title}: {found.flights} flights, {found.seconds:.0f} s")
    print(f"  {'parameter':<24}{'file':>9}  {'flights':>8}  {'prior':>5}  {'truth':>9}  {'ratio':>6}  aim   source")
    inside = []
    for name, (value, alone, share) in quantities(found).items():
        if (truth := truths.get(name)) is None:
            print(f"  {name:<24}{value:>9.4g}  {alone:>8.4g}  {100 * share:>3.0f} %")
            continue
        ratio = value / truth.value
        close = (abs(value - truth.value) <= LAG_AIM_MS if name.startswith("lag")
                 else abs(ratio - 1.0) <= AIMS[name[0]])
        inside.append(close)
        print(f"  {name:<24}{value:>9.4g}  {alone:>8.4g}  {100 * share:>3.0f} %  {truth.value:>9.4g}  {ratio:>6.2f}  "
              f"{'met ' if close else 'NOT '}  {truth.source}")
    for note in found.notes:
        print(f"  {note}")
    bound = [name for name, value, low, high in zip(found.model.names, found.model.values, found.model.lower,
                                                    found.model.upper, strict=True) if value in (low, high)]
    print(f"  on a bound: {', '.join(bound) or 'no parameter'}")
    return inside


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", nargs="+", type=Path)
    parser.add_argument("--mass", type=float, default=Vehicle.mass_kg)
    parser.add_argument("--arm", type=float)
    given = parser.parse_args()
    vehicle = sized(given.mass, given.arm)
    flights = completed(distinct(load_recordings(given.places).flights)[0])
    inside: list[bool] = []
    if any("rpm" in flight.streams for flight in flights):
        logs, _ = read_logs(flights)
        cases = cases_of(flights)
        truths = measured(logs, vehicle, cases)
        alone = [replace(case, flight=case.flight.without_streams("rpm")) for case in cases]
        rows = [replace(case, flight=thinned(case.flight)) for case in cases]
        for title, part in (("as logged, with rotor speed", cases), ("as logged, commands alone", alone),
                            ("in rows of 10 ms, commands alone", rows)):
            inside += show(title, fit_vehicle(part, vehicle), truths)
    else:
        from nanobench_tools.auditing.recording_audit import audit
        from nanobench_tools.protocols import task1

        train = task1.split(flights, {flight.name: audit(flight) for flight in flights}).train
        inside += show("training flights of Task 1", fit_vehicle(train, vehicle), TRUTHS)
    print(f"\n{sum(inside)} of {len(inside)} inside their aim")


if __name__ == "__main__":
    main()
