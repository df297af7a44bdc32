"""Thrust-stand tables and TUM trajectories."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.sources import load_recordings
from nanobench_tools.sources.stand import heading


def test_a_thrust_without_a_unit_is_asked_about(tmp_path):
    (tmp_path / "a.csv").write_text("throttle,thrust,voltage\n0.1,0.4,16\n0.9,7.5,15.5\n")
    (failure,) = load_recordings([tmp_path], cache=False).failed
    assert "column thrust: a thrust without a unit: g or N?" in failure["error"]


@pytest.mark.parametrize(("column", "times", "last_s"), [
    ("Time (s)", (3.0, 3.5, 4.0), 1.0), ("t [ms]", (0, 20, 40), 0.04), ("Time", (0, 20, 40), 2.0),
    ("Time (s)", (0.0, 0.5, 0.5), 2.0)])
def test_rows_have_the_time_that_the_file_gives(tmp_path, column, times, last_s):
    """In a unit that it names and increasing; else their numbers stand for it, which a note says."""
    rows = "\n".join(f"{t},{u},{f},16" for t, u, f in zip(times, (1100, 1500, 1900), (0.1, 0.5, 1.1), strict=True))
    (tmp_path / "a.csv").write_text(f"{column},ESC signal (us),Thrust (N),Voltage (V)\n{rows}\n")
    flight, = load(tmp_path).flights
    assert flight["motor"].time_s[-1] == pytest.approx(last_s)
    assert any("numbers replace it" in note for note in flight.provenance.notes) == (last_s == 2.0)


@pytest.mark.parametrize("speed", ["Motor Electrical Speed (RPM)", "Motor Optical Speed (RPM)"])
@pytest.mark.parametrize("factor", [0.102, 0.0022, 1.0, 9.81])
def test_thrust_that_no_propeller_has_at_its_power_and_speed_is_refused(tmp_path, speed, factor):
    """A propeller of 0.25 m at 0.6 of the efficiency of an ideal one, on motors with seven pole pairs."""
    n = np.linspace(40.0, 120.0, 30)
    thrust = 0.1 * 1.2 * n**2 * 0.25**4
    power = thrust**1.5 / np.sqrt(2.4 * np.pi * 0.125**2) / 0.6
    rpm = 60.0 * n * (7 if "Electrical" in speed else 1)
    rows = [f"{1000 + 8 * v:.0f},{f / 9.80665 * factor:.5f},15.0,{p / 15:.4f},{r:.0f}"
            for v, f, p, r in zip(n, thrust, power, rpm, strict=True)]
    (tmp_path / "a.csv").write_text(f"ESC signal (us),Thrust (kgf),Voltage (V),Current (A),{speed}\n" + "\n".join(rows))
    loaded = load(tmp_path)
    if factor == 1.0:
        np.testing.assert_allclose(loaded.flights[0]["stand"]["thrust"], thrust, rtol=1e-3)
    elif factor < 1.0 or "Optical" in speed:
        error = loaded.failed[0]["error"]
        assert "Thrust (kgf), Current (A), Voltage (V)" in error
        assert "N per W" in error or "N per motor where propellers with this power and speed give" in error


@pytest.mark.parametrize("full", [1.0, 100.0, 255.0, 1023.0, 2000.0])
def test_commands_of_a_series_that_are_no_counts_of_16_bits_are_refused(tmp_path, full):
    rows = "".join(f"{u * full / 100:g},{0.001 * u * u:.3f},4.0\n" for u in range(0, 101, 5))
    (tmp_path / "a.csv").write_text(f"pwm,thrust_g,vbat\n{rows}")
    assert f"column pwm: reaches {full:g}, and in pwm16 a series reaches 3277" in load(tmp_path).failed[0]["error"]


@pytest.mark.parametrize("names", ["PWM,", "pwm1,pwm2,pwm3,pwm4,"])
def test_a_pwm_in_the_length_of_pulses_is_one(tmp_path, names):
    """1000 us is 0 and 2000 us is 1, with one motor a column."""
    count = names.count(",")
    rows = "".join(f"{f'{u},' * count}{(0.001 * (u - 1000)) ** 2:.6f},16,{20 * (u - 1000)}\n"
                   for u in range(1000, 2001, 50))
    (tmp_path / "a.csv").write_text(f"{names}Thrust (kgf),Volts,RPM\n{rows}")
    flight, = load(tmp_path).flights
    assert len(flight["motor"].quantities) == count
    np.testing.assert_allclose(flight["stand"]["thrust"], 9.80665 * flight["motor"]["m1"] ** 2, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(flight["rpm"]["m1"], 20000 * flight["motor"]["m1"] * np.pi / 30, rtol=1e-6)


@pytest.mark.parametrize(("unit", "newton"), [("N", 1.0), ("mN", 1e-3), ("g", 9.80665e-3), ("kgf", 9.80665),
                                                ("-", 9.80665e-3)])
def test_a_row_of_units_counts_where_the_names_state_none(tmp_path, unit, newton):
    """``weight`` alone is in grams, and a voltage in volts."""
    rows = "".join(f"{u},{u * u / newton / 120000:.9f},{3900 - u}\n" for u in range(0, 101, 5))
    (tmp_path / "a.csv").write_text(f"throttle,weight,vbat\n%,{unit},mV\n{rows}")
    flight, = load(tmp_path).flights
    command = 100 * flight["motor"]["m1"]
    np.testing.assert_allclose(flight["stand"]["thrust"], command**2 / 120000, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(flight["battery"]["vbat"], 3.9 - 1e-3 * command)


@pytest.mark.parametrize(("speed", "thrust"), [(1 / 60, 1.0), (0.10472, 1.0), (1e-3, 1.0), (1.0, 1e-3), (1.0, 1.0)])
def test_thrust_that_no_propeller_has_at_its_speed_is_refused(tmp_path, speed, thrust):
    """Four propellers of 45 mm with 24 000 rpm at full command, C_T 0.1: tips at 57 m/s. In rev/s, rad/s, thousands,
    and kgf called g."""
    n = np.linspace(100.0, 400.0, 20)
    force = 4 * 0.1 * 1.2 * n**2 * 0.045**4 / 9.80665e-3
    rows = "".join(f"{163.8 * v:.0f},{f * thrust:.6g},3.9,{60 * v * speed:.6g}\n"
                   for v, f in zip(n, force, strict=True))
    (tmp_path / "a.csv").write_text(f"pwm,thrust_g,vbat,rpm1\n{rows}")
    loaded = load(tmp_path)
    if (speed, thrust) == (1.0, 1.0):
        np.testing.assert_allclose(loaded.flights[0]["stand"]["thrust"], 9.80665e-3 * force, rtol=1e-3)
    else:
        assert "columns thrust_g, rpm1: propellers with this thrust and speed have tips at" in loaded.failed[0]["error"]


@pytest.mark.parametrize(("command", "motors"), [("pwm", 4), ("pwm_percent", 1)])
def test_one_command_for_four_motors_is_reported(tmp_path, command, motors):
    full = 65535 if command == "pwm" else 100
    rows = "".join(f"{u * full // 100},{0.001 * u * u:.3f},4.0\n" for u in range(0, 101, 5))
    (tmp_path / "a.csv").write_text(f"{command},thrust_g,vbat\n{rows}")
    (flight,) = load_recordings([tmp_path], cache=False).flights
    assert len(flight["motor"].quantities) == motors
    assert ("commands 4 motors" in str(flight.metadata.get("read_as"))) == (motors == 4)


def test_a_load_cell_that_counts_down_is_refused(tmp_path):
    rows = [f"{1000 + 20 * i},{12 - 30 * i},{16.4 - 0.02 * i}" for i in range(50)]
    (tmp_path / "a.csv").write_text("ESC signal (us),Thrust (g),Voltage (V)\n" + "\n".join(rows) + "\n")
    assert "the load cell counts downwards; write the column with the other sign" in load(tmp_path).failed[0]["error"]


def test_a_straight_ramp_on_a_stand_is_no_gap(tmp_path):
    ramp = [*range(1000, 2001, 50), *range(2000, 999, -50)]
    rows = [f"{u},{1.9 * (u - 1000)},{16.4 - 1e-3 * (u - 1000)}" for u in ramp]
    (tmp_path / "a.csv").write_text("ESC signal (us),Thrust (g),Voltage (V)\n" + "\n".join(rows) + "\n")
    assert audit(load(tmp_path).flights[0]).faults == ()


def load(folder):
    return load_recordings([folder], cache=False)


@pytest.mark.parametrize(
    "header",
    [
        "pwm,vbat[V],rpm1,rpm2,rpm3,rpm4, weight",
        "pwm,vbat[V],rpm1,rpm2,rpm3,rpm4,thrust[g]",
        "PWM, vbat (V), rpm_m1, rpm_m2, rpm_m3, rpm_m4, thrust[gf]",
    ],
)
def test_headers_that_differ(tmp_path, header):
    (tmp_path / "a").write_text(f"{header}\n65535,3.9,6000,12000,18000,600,100\n0,4.0,0,0,0,0,-1.5\n")
    flight = load(tmp_path).flights[0]
    assert flight.provenance.source == "stand"
    np.testing.assert_allclose(flight["stand"]["thrust"], [0.981, -0.014715])
    np.testing.assert_allclose(flight["motor"]["m1", "m2", "m3", "m4"], [[1.0] * 4, [0.0] * 4])
    np.testing.assert_allclose(flight["rpm"]["m1", "m4"][0], [200 * math.pi, 20 * math.pi])
    np.testing.assert_allclose(flight["battery"]["vbat"], [3.9, 4.0])
    assert flight["stand"].samples == 2


@pytest.mark.parametrize(("names", "command"), [
    ("Time (s),ESC throttle (µs),Thrust (lbf),Voltage (V),Optical Speed (RPM)", "{:.0f}"),
    ("Time (s),Powertrain 1 - ESC throttle (μs),Powertrain 1 - thrust (lbf),Powertrain 1 - voltage (V),"
     "Powertrain 1 - rotation speed (rpm)", "{:.0f}"),
    ("Time (s),Throttle,Thrust (lbf),Voltage (V),RPM", "{}%")])
def test_stands_of_one_motor_by_other_names(tmp_path, names, command):
    shares = np.linspace(0.1, 1.0, 19)
    rows = [f"{k},{command.format(round(100 * u) if '%' in command else 1000 + 1000 * u)},{u * u:.6f},16.0,"
            f"{9000 * u:.0f}" for k, u in enumerate(shares)]
    (tmp_path / "a.csv").write_text("\n".join([names, *rows]) + "\n")
    flight = load(tmp_path).flights[0]
    np.testing.assert_allclose(flight["motor"]["m1"], shares, atol=1e-3)
    np.testing.assert_allclose(flight["stand"]["thrust"], shares**2 * 4.4482216, atol=1e-4)
    np.testing.assert_allclose(flight["rpm"]["m1"], shares * 9000 * 2 * np.pi / 60, atol=0.1)


def test_units_in_names_and_columns_of_other_meaning(tmp_path):
    (tmp_path / "a.csv").write_text(
        "thrust[N],pwm,vbat[mV],v[V],i[A],note\n0.4,30000,3900,3.8,1.5,\n0.5,31000,3800,3.7,oops,\n"
    )
    flight = load(tmp_path).flights[0]
    np.testing.assert_allclose(flight["stand"]["thrust"], [0.4, 0.5])
    np.testing.assert_allclose(flight["battery"]["vbat"], [3.9, 3.8])
    np.testing.assert_allclose(flight["extra"]["v[V]"], [3.8, 3.7])
    assert np.isnan(flight["stand"]["current"][1])
    assert {f.kind for f in flight.provenance.findings} == {"bad_cell", "missing_column"}


def test_a_sensor_that_shows_zero_in_every_row_was_not_there(tmp_path):
    (tmp_path / "a.csv").write_text("weight[g],pwm,vbat[V],rpm1,rpm2\n0,0,4,0,0\n0,30000,3.9,12000,0\n")
    flight = load(tmp_path).flights[0]
    assert "stand" not in flight
    assert flight["rpm"].quantities == ("m1",)
    assert [f.columns for f in flight.provenance.findings] == [("weight[g]",), ("rpm2",)]
    assert {f.kind for f in flight.provenance.findings} == {"missing_column"}


def test_unknown_unit_names_the_column(tmp_path):
    (tmp_path / "a.csv").write_text("thrust[furlong],pwm\n0.4,30000\n")
    (failure,) = load(tmp_path).failed
    assert "column thrust[furlong]: unit 'furlong'; known here: " in failure["error"]


def test_heading():
    assert heading("rpm").quantities == ("m1",)
    assert heading("temperature[C]") is None
    found = [heading(name).quantities for name in ("pwm", "pwm3", "rpm_2", "RPM motor 4", "pwm2 (us)", "PWM (us)")]
    assert found == [("m1", "m2", "m3", "m4"), ("m3",), ("m2",), ("m4",), ("m2",), ("m1",)]


POSES = "# a comment\n1000.5 1 2 3 0 0 0 1\n1000.6 1.1 2 3 0 0 0.6 0.8\n1000.7 1.2 2 3 0 0 0 -1\n"


def test_tum(tmp_path):
    (tmp_path / "a").write_text(POSES)
    flight = load(tmp_path).flights[0]
    assert flight.provenance.source == "tum"
    assert flight.epoch_s == 1000.5
    np.testing.assert_allclose(flight["mocap"].time_s, [0.0, 0.1, 0.2], atol=1e-9)
    np.testing.assert_allclose(flight["mocap"]["px", "qz", "qw"], [[1, 0, 1], [1.1, 0.6, 0.8], [1.2, 0, -1]])
    assert flight["mocap"].rate_hz == pytest.approx(10.0)
    assert flight["mocap"].samples == 3


def test_tum_with_faults(tmp_path):
    (tmp_path / "a").write_text(
        POSES + "1000.8 1 2 3\n1000.9 x 2 3 0 0 0 1\nnan 1 2 3 0 0 0 1\n1001 1 2 3 0 0 0 1\n1001.1 4 5"
    )
    flight = load(tmp_path).flights[0]
    assert len(flight["mocap"]) == 5
    assert np.isnan(flight["mocap"]["px"][3])
    found = [(f.kind, f.evidence) for f in flight.provenance.findings]
    assert [k for k, _ in found] == ["bad_cell", "bad_cell", "bad_cell", "truncated"]
    assert "line 5" in found[1][1]


def test_eight_numbers_are_no_pose_without_a_quaternion(tmp_path):
    (tmp_path / "a").write_text("1 2 3 4 5 6 7 8\n2 3 4 5 6 7 8 9\n")
    assert "not a recording of any known format" in load(tmp_path).failed[0]["error"]


def stand(tmp_path, **columns):
    """A stand with a motor of a 5 inch propeller, 24 000 rpm and 3.5 N at full command."""
    share = np.linspace(0.1, 1.0, 30)
    given = {"throttle (%)": 100.0 * share, "thrust (N)": 3.5 * share**2, "voltage": 16.0 - share}
    given |= {name: of(share) for name, of in columns.items()}
    rows = [",".join(f"{v:.8g}" for v in row) for row in zip(*given.values(), strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([",".join(given), *rows]) + "\n")
    return load(tmp_path)


@pytest.mark.parametrize("name", ["rpm", "rpm1"])
def test_slow_rpm_of_a_stand_may_be_an_electrical_speed(tmp_path, name):
    (failed,) = stand(tmp_path, **{name: lambda u: 24000.0 * u * 7.0 / 100.0}).failed
    assert "eRPM/100" in failed["error"]
    flight, = stand(tmp_path, **{name: lambda u: 24000.0 * u}).flights
    assert flight["rpm"].values.max() == pytest.approx(24000.0 * np.pi / 30.0)


def test_a_large_propeller_is_named_otherwise(tmp_path):
    speeds = {"thrust (N)": lambda u: 60.0 * u**2, "rotation speed (rpm)": lambda u: 2800.0 * u}
    flight, = stand(tmp_path, **speeds).flights
    assert flight["rpm"].values.max() == pytest.approx(2800.0 * np.pi / 30.0)


def test_a_voltage_without_a_unit_that_no_battery_has(tmp_path):
    (failed,) = stand(tmp_path, voltage=lambda u: 16000.0 - 1000.0 * u).failed
    assert "voltage (mV)" in failed["error"]


def test_one_throttle_turns_all_motors_with_a_speed(tmp_path):
    """The load cell adds up their thrust."""
    speeds = {f"rpm{k}": lambda u: 24000.0 * u for k in range(1, 5)}
    flight, = stand(tmp_path, **speeds).flights
    assert flight["motor"].quantities == ("m1", "m2", "m3", "m4")
    assert "commands 4 motors" in flight.metadata["read_as"][0]


def test_a_stand_with_german_names(tmp_path):
    rows = "".join(f"{u};{u * u / 2000:.4f};{4.1 - u / 1000:.3f};{200 * u}\n".replace(".", ",")
                   for u in range(0, 101, 5))
    (tmp_path / "a.csv").write_text(f"Drossel (%);Schub (N);Spannung (V);Drehzahl (1/min)\n{rows}")
    flight, = load(tmp_path).flights
    command = 100 * flight["motor"]["m1"]
    np.testing.assert_allclose(flight["stand"]["thrust"], command**2 / 2000, atol=1e-4)
    np.testing.assert_allclose(flight["battery"]["vbat"], 4.1 - command / 1000, atol=1e-9)
    np.testing.assert_allclose(flight["rpm"]["m1"], 200 * command * np.pi / 30, rtol=1e-9)


def test_a_load_cell_and_french_names(tmp_path):
    rows = "".join(f"{1000 + 10 * u};{u * u / 20:.3f};{4100 - u}\n" for u in range(0, 101, 5))
    (tmp_path / "a.csv").write_text(f"gaz_us;load_cell_g;battery_mV\n{rows}")
    flight, = load(tmp_path).flights
    command = 100 * flight["motor"]["m1"]
    np.testing.assert_allclose(flight["stand"]["thrust"], command**2 / 20 * 9.81e-3, atol=1e-5)
    np.testing.assert_allclose(flight["battery"]["vbat"], 4.1 - command / 1000, atol=1e-9)
