"""A unit that is wrong gets the exact factor of the known units which the flight allows, else an interval."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.auditing.faults import unit
from nanobench_tools.signals.context import Context
from nanobench_tools.signals.known_factors import named_factor
from nanobench_tools.signals.stream_frames import IMU

DEG = 180.0 / np.pi


def _read_as_si(flight, stream, names, factor):
    s = flight[stream]
    values = s.values.copy()
    values[:, [s.index(q) for q in names]] *= factor
    return flight.with_streams(**{stream: replace(s, values=values)})


@pytest.mark.parametrize(("stream", "names", "factor", "called"), [
    ("imu", IMU[0], 1e3 * DEG, "millidegrees"), ("imu", IMU[0], DEG, "deg for rad"),
    ("imu", IMU[0], 1e3, "thousandths"), ("imu", IMU[0], 16.4 * DEG, "counts of 16.4"),
    ("imu", IMU[1], 1e3 / 9.81, "mg"), ("imu", IMU[1], 100.0, "hundredths"),
    ("estimator", ("vx", "vy", "vz"), 3.6, "km/h"), ("estimator", ("x", "y", "z"), 100.0, "hundredths"),
])
def test_the_exact_factor_is_among_those_that_are_named(crowd, stream, names, factor, called):
    flight = _read_as_si(crowd.log("fast figure_eight")[0], stream, names, factor)
    (fault,) = unit.find(flight, Context(flight))
    assert called in fault.evidence
    assert f"{factor:.4g}" in fault.evidence or (stream == "imu" and names == IMU[1])
    assert fault.size == pytest.approx(factor, rel=0.1)


def test_a_factor_of_no_unit_has_an_interval_that_contains_it(crowd):
    flight = _read_as_si(crowd.log("star")[0], "imu", IMU[0], 42.0)
    (fault,) = unit.find(flight, Context(flight))
    low, high = (float(x) for x in fault.evidence.split("(")[1].split(")")[0].split(" to "))
    assert low < 42.0 < high < 2.0 * low
    assert "unknown unit" in fault.evidence


def test_usual_units_come_before_counts():
    assert list(named_factor("rad/s", 940.0, 1.2).known) == ["thousandths", "counts of 16.4 per deg/s"]


def test_one_axis_in_another_unit_is_named_alone(crowd):
    flight = _read_as_si(crowd.log("star")[0], "imu", ("gyro_y",), DEG)
    (fault,) = unit.find(flight, Context(flight))
    assert fault.columns == ("imu_gyro_y",)
    assert "gyro_y of imu is 57.3 times" in fault.evidence
