"""Vibration and battery against signals whose frequency, size and resistance are known."""

import numpy as np
import pytest

from nanobench_tools.auditing.audit_verdict import entry_of
from nanobench_tools.auditing.flight_health import health_of, sentence_of
from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.flight import Fault, Flight, Provenance, Span, make_stream
from nanobench_tools.signals.rates import RateReading

RATE_HZ, SECONDS = 500.0, 20.0
IMU = ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")
MOTORS = ("m1", "m2", "m3", "m4")


def flight(lines=((80.0, 0.4),), rotor_hz=None, battery=None, noise=0.01, seconds=SECONDS, sweep=0.0):
    """gyro_x vibrates with the lines (Hz, amplitude rad/s); a slow motion of 1 Hz is no vibration."""
    t = np.arange(round(RATE_HZ * seconds)) / RATE_HZ
    rng = np.random.default_rng(3)
    values = noise * rng.standard_normal((len(t), 6)) + np.array([0.0, 0.0, 9.81, 0.0, 0.0, 0.0])
    values[:, 3] += 2.0 * np.sin(2.0 * np.pi * t)
    for hz, amplitude in lines:
        values[:, 3] += amplitude * np.sin(2.0 * np.pi * (hz * t + 0.5 * sweep * t**2))
    streams = {"imu": make_stream("imu", t, values, IMU, rate_hz=RATE_HZ)}
    if rotor_hz is not None:
        speed = 2.0 * np.pi * (rotor_hz + sweep * t)
        streams["rpm"] = make_stream("rpm", t, np.tile(speed[:, None], 4), MOTORS)
    return Flight("a", streams | (battery or {}), {}, Provenance("a", "", "made"))


def audit(flown=(2.0, 18.0), faults=(), rate_hz=RATE_HZ):
    return Audit("a", "a", "", "pid", (Span(*flown),), (Span(0.0, SECONDS),), tuple(faults), {},
                 {"imu": RateReading(round(rate_hz * SECONDS), rate_hz)}, Span(0.0, SECONDS))


@pytest.mark.parametrize(("hz", "amplitude"), [(80.0, 0.4), (33.3, 0.1), (211.7, 1.0)])
def test_a_vibration_has_its_frequency_and_size(hz, amplitude):
    found = health_of(flight([(hz, amplitude)]), audit()).vibration["gyro"]
    assert found.peak_hz == pytest.approx(hz, abs=0.3)
    assert found.peak_rms == pytest.approx(amplitude / np.sqrt(2.0), rel=0.03)
    assert found.rms == pytest.approx(amplitude / np.sqrt(2.0), rel=0.03)
    assert (found.unit, found.up_to_hz) == ("rad/s", pytest.approx(250.0))
    frequency, density = np.array(found.spectrum).T
    assert frequency[np.argmax(density)] == pytest.approx(hz, abs=1.0)
    assert len(frequency) <= 100


def test_noise_alone_has_no_line_and_its_own_size():
    found = health_of(flight([], noise=0.05), audit()).vibration["gyro"]
    assert found.peak_hz is None
    assert found.rms == pytest.approx(0.05 * np.sqrt(3.0 * 230.0 / 250.0), rel=0.03)
    acc = health_of(flight([], noise=0.05), audit()).vibration["acc"]
    assert acc.highest == pytest.approx(9.81, abs=0.5)


@pytest.mark.parametrize(("rotor_hz", "seen_hz"), [(120.0, 120.0), (290.0, 210.0), (420.0, 80.0)])
def test_a_rotor_faster_than_half_the_rate_is_found_where_it_shows(rotor_hz, seen_hz):
    first = health_of(flight([(rotor_hz, 0.4)], rotor_hz), audit()).vibration["gyro"].rotors[0]
    assert (first.order, first.rotor_hz) == (1, pytest.approx(rotor_hz))
    assert first.seen_at_hz == pytest.approx(seen_hz)
    assert first.rms == pytest.approx(0.4 / np.sqrt(2.0), rel=0.05)
    assert first.share > 0.95


def test_a_rotor_that_speeds_up_is_followed_and_another_line_is_not_its():
    found = health_of(flight([(100.0, 0.4)], 100.0, sweep=2.0), audit()).vibration["gyro"]
    assert found.rotors[0].share > 0.9
    assert found.load == "rotor speed, Hz"
    speeds = [load for load, _ in found.against]
    assert speeds == sorted(speeds)
    assert speeds[0] == pytest.approx(108.0, abs=3.0)
    assert speeds[-1] == pytest.approx(132.0, abs=3.0)
    other = health_of(flight([(180.0, 0.4)], 120.0), audit()).vibration["gyro"]
    assert other.rotors[0].share < 0.02


def test_only_the_flight_counts():
    made = flight([])
    values = made["imu"].values.copy()
    outside = (made["imu"].time_s < 2.0) | (made["imu"].time_s > 18.0)
    values[outside, 3] += np.sin(2.0 * np.pi * 60.0 * made["imu"].time_s[outside])
    shaken = made.with_streams(imu=make_stream("imu", made["imu"].time_s, values, IMU))
    assert health_of(shaken, audit()).vibration["gyro"].peak_hz is None


def test_a_shock_is_no_vibration():
    made = flight()
    values = made["imu"].values.copy()
    values[5000:5010, 2] += 60.0
    shaken = made.with_streams(imu=make_stream("imu", made["imu"].time_s, values, IMU))
    assert health_of(shaken, audit()).vibration["acc"].rms == pytest.approx(
        health_of(made, audit()).vibration["acc"].rms, rel=0.05)


def test_rows_between_samples_are_not_a_spectrum():
    found = health_of(flight(), audit(rate_hz=120.0)).vibration["gyro"]
    assert found.interpolated
    assert found.up_to_hz == pytest.approx(60.0)
    assert health_of(flight(), audit(rate_hz=40.0)).vibration == {}
    assert "no vibration of the gyro: 40 Hz are too few" in health_of(flight(), audit(rate_hz=40.0)).lacks


def test_clipped_rows_are_those_of_the_audit():
    fault = Fault("saturated_sensor", "imu", ("gyro_x",), 3.0, 4.0, 17.0, "rows", "")
    found = health_of(flight(), audit(faults=[fault])).vibration
    assert (found["gyro"].clipped_rows, found["acc"].clipped_rows) == (17, 0)


def pack(ohm=0.08, noise=0.005, current=True, load=1.0):
    """A battery at 20 Hz behind ``ohm``: standing until 2 s, discharged by 20 mV/s, load steps every second."""
    t = np.arange(0.0, SECONDS, 0.05)
    rng = np.random.default_rng(9)
    steps = 1.0 + load * 0.5 * rng.uniform(-1.0, 1.0, 40)[(t // 0.5).astype(int)]
    ampere = np.where(t < 2.0, 0.2, 10.0 * steps)
    volt = 16.0 - 0.02 * t - ohm * ampere + noise * rng.standard_normal(len(t))
    command = np.where(t < 2.0, 0.0, 0.5 * steps)
    battery = make_stream("battery", t, np.column_stack([volt, ampere])[:, :2 if current else 1],
                          ("vbat", "current") if current else ("vbat",))
    return {"battery": battery, "motor": make_stream("motor", t, np.tile(command[:, None], 4), MOTORS)}


@pytest.mark.parametrize("ohm", [0.02, 0.08, 0.2])
def test_the_resistance_is_that_of_the_battery(ohm):
    found = health_of(flight(battery=pack(ohm)), audit()).battery
    assert found.resistance_ohm.value == pytest.approx(ohm, rel=0.05)
    assert found.resistance_ohm.low < ohm < found.resistance_ohm.high
    assert found.volt_per_command.value == pytest.approx(20.0 * ohm, rel=0.05)
    standing = 16.0 - 0.02 * 1.0 - 0.2 * ohm
    assert found.sag_V == pytest.approx(standing - found.start_V, abs=0.01)


def test_resistances_that_the_load_does_not_show_are_not_given():
    assert health_of(flight(battery=pack(current=False)), audit()).battery.resistance_ohm is None
    still = health_of(flight(battery=pack(noise=0.05, load=0.0)), audit()).battery
    assert (still.resistance_ohm, still.volt_per_command) == (None, None)
    assert health_of(flight(), audit()).battery is None


def test_intervals_contain_the_resistance_as_often_as_they_state():
    inside = 0
    for seed in range(40):
        t = np.arange(0.0, SECONDS, 0.05)
        rng = np.random.default_rng(seed)
        ampere = 10.0 + 3.0 * rng.uniform(-1.0, 1.0, 80)[(t // 0.25).astype(int)]
        volt = 16.0 - 0.02 * t - 0.05 * ampere + 0.05 * rng.standard_normal(len(t))
        made = {"battery": make_stream("battery", t, np.column_stack([volt, ampere]), ("vbat", "current"))}
        found = health_of(flight(battery=made, seconds=0.2), audit()).battery.resistance_ohm
        inside += found is not None and found.low < 0.05 < found.high
    assert inside >= 33


def test_constant_and_gigantic_readings_give_no_line_and_no_error():
    made = flight(battery=pack())
    still = made.with_streams(imu=make_stream("imu", made["imu"].time_s, np.zeros((len(made["imu"]), 6)), IMU))
    found = health_of(still, audit())
    assert (found.vibration["gyro"].peak_hz, found.vibration["gyro"].rms) == (None, 0.0)
    values, volts = made["imu"].values.copy(), made["battery"].values.copy()
    values[5000, 0], volts[100, 0] = 1e300, 1e300
    wild = made.with_streams(imu=make_stream("imu", made["imu"].time_s, values, IMU),
                             battery=make_stream("battery", made["battery"].time_s, volts, ("vbat", "current")))
    entry = entry_of(wild, audit())["health"]
    assert entry["vibration"]["acc"]["highest"] < 20.0
    assert entry["battery"]["resistance_ohm"]["value"] == pytest.approx(0.08, rel=0.05)
    assert sentence_of(entry)


def test_audit_json_has_it_and_a_line_of_it():
    made = flight(battery=pack())
    entry = entry_of(made, audit())
    assert entry["health"]["vibration"]["gyro"]["peak_hz"] == pytest.approx(80.0, abs=0.3)
    line = sentence_of(entry["health"])
    assert "gyro vibrates by 0.28" in line
    assert "strongest at 80 Hz" in line
    assert "80 mOhm" in line


def test_voltages_that_the_audit_cuts_do_not_count():
    battery = pack()["battery"]
    values = battery.values.copy()
    values[100:104] = (30.0, 40.0)
    made = flight(battery={"battery": make_stream("battery", battery.time_s, values, ("vbat", "current"))})
    spike = Fault("spike", "battery", ("vbat",), 4.9, 5.3, 14.0, "V", "")
    found = health_of(made, audit(faults=[spike])).battery
    assert found.resistance_ohm.value == pytest.approx(0.08, rel=0.05)
    assert found.lowest_V < 15.5
