"""Public 500 Hz logs with an RPM deck."""

import numpy as np
import pytest

from identification.motors import lag
from identification.motors.force import fit_force
from identification.motors.motor_study import hover
from identification.motors.rotor_rows import read_logs
from nanobench_tools.physics import Vehicle
from nanobench_tools.sources.discover import load_recordings

pytestmark = pytest.mark.real


def logs_of(folder, names):
    return read_logs(load_recordings([folder / name for name in names]).flights)


def fitted(logs, mass_kg):
    return lag.fit_lag(hover(logs, Vehicle(mass_kg=mass_kg)), lag.windows_of(logs), logs[0].row_s)


def test_brushless_motors_are_as_fast_down_as_up(real_data):
    logs, _ = logs_of(real_data / "crazyflie_usd" / "brushless_flights", ["eckart22", "eckart30"])
    found = fitted(logs, 0.037)
    assert not found.trouble
    assert 0.035 < found.tau_up_s < 0.045
    assert abs(found.tau_down_s - found.tau_up_s) < 0.005
    assert 0.002 < found.delay_s < 0.005
    values = fit_force(logs).per_flight
    assert np.ptp(values) < 0.01 * np.mean(values)  # k_f / m of two flights


def test_brushed_motors_coast_down(real_data):
    logs, _ = logs_of(real_data / "crazyflie_usd" / "brushed_flights", ["jana02", "jana06"])
    found = fitted(logs, 0.0347)
    assert not found.trouble
    assert 0.04 < found.tau_up_s < 0.07
    assert found.tau_down_s > 1.4 * found.tau_up_s


def test_a_rotor_whose_speed_was_not_measured_is_named(real_data):
    logs, reasons = logs_of(real_data / "crazyflie_usd" / "brushed_flights", ["jana23"])
    assert not logs
    assert "motor 1" in reasons["jana23"]
    assert "not measured" in reasons["jana23"]
