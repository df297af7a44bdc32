"""The row of a set of recordings in a table of data sets, against recordings that are known."""

import numpy as np
import pytest

from nanobench_tools.auditing.dataset_facts import facts_of, rows_of
from nanobench_tools.auditing.recording_audit import Audit
from nanobench_tools.flight import Fault, Flight, Provenance, Span, make_stream
from nanobench_tools.results.result import to_json
from nanobench_tools.signals.rates import RateReading
from nanobench_tools.time_offsets.constant.reading import ClockReading

SECONDS = 10.0


def flight(name, path, speed, volt, family="circle", word="slow"):
    """A straight path, ``speed`` m/s from 2 s to 8 s; before and after it stands and the battery is fuller."""
    t = np.arange(0.0, SECONDS, 0.01)
    air = (t >= 2.0) & (t <= 8.0)
    v = np.zeros((len(t), 3))
    v[air, 0] = speed
    mocap = np.hstack([np.cumsum(v, axis=0) * 0.01, np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1)), v])
    battery = np.where(air, volt, 4.2)[:, None]
    names = ("px", "py", "pz", "qx", "qy", "qz", "qw", "vx", "vy", "vz")
    return Flight(name, {"mocap": make_stream("mocap", t, mocap, names), "battery": make_stream(
        "battery", t, battery, ("vbat",))}, {"family": family, "speed": word, "reference_speed_m_s": speed},
        Provenance(str(path), "", "nanobench"))


def audit(name, offset_s, known=True, faults=()):
    clock = ClockReading(offset_s, (offset_s, offset_s), True, "") if known else ClockReading.unknown("still")
    return Audit(name, name, "", "pid", (Span(2.0, 8.0),), (), tuple(faults), {"imu": clock},
                 {"mocap": RateReading(1000, 100.0), "battery": RateReading(100, 10.0)}, Span(0.0, SECONDS))


@pytest.fixture
def facts(tmp_path):
    for k, size in enumerate((1000, 2000, 3000)):
        (tmp_path / f"{k}.csv").write_bytes(b"x" * size)
    flights = [flight("a", tmp_path / "0.csv", 0.5, 3.9), flight("b", tmp_path / "1.csv", 1.0, 3.4, word="fast"),
               flight("c", tmp_path / "2.csv", 1.5, 3.2, family="star", word="fast")]
    jump = Fault("pose_jump", "mocap", (), 5.0, 5.5, 1.0, "m", "")
    audits = {"a": audit("a", 0.010), "b": audit("b", 0.030, faults=[jump]), "c": audit("c", 9.0, known=False)}
    return to_json(facts_of(flights, audits, [["a", "b"]]))


def test_the_facts_are_those_of_the_files(facts):
    assert (facts["recordings"], facts["copies"], facts["sources"]) == (3, 1, {"nanobench": 3})
    assert facts["size_MB"] == pytest.approx(0.006)
    assert (facts["length_s"], facts["flight_s"]) == (pytest.approx(29.97), 18.0)
    assert facts["trajectories"] == {"circle": {"slow": 1, "fast": 1}, "star": {"fast": 1}}
    assert facts["voltage_V"] == [3.2, 3.9]
    assert facts["top_speed_m_s"]["median"] == pytest.approx(1.0)
    assert (facts["reference_speed_m_s"]["low"], facts["reference_speed_m_s"]["high"]) == (0.5, 1.5)
    assert facts["rates_Hz"]["battery"] == {"median": 10.0, "sd": 0.0, "low": 10.0, "high": 10.0, "n": 3}


def test_the_offset_is_of_flights_that_show_it(facts):
    assert facts["offset_s"]["n"] == 2
    assert facts["offset_s"]["median"] == pytest.approx(0.020)
    assert facts["offset_s"]["sd"] == pytest.approx(0.0141421, rel=1e-5)


def test_the_table_says_them(facts):
    rows = dict(rows_of(facts))
    assert rows["recordings"] == "3, 1 of them copies"
    assert rows["battery in the air"] == "3.20 to 3.90 V"
    assert rows["imu late"] == "median 20.0 ms, SD 14.1 ms over 2 flights"
    assert rows["flights of circle"] == "1 slow, 1 fast"
    assert rows["battery"] == "10 (10 to 10) Hz: vbat"


def test_nothing_known_is_nothing_said():
    t = np.array([0.0, 0.1])
    bare = Flight("a", {"imu": make_stream("imu", t, np.zeros((2, 1)), ("gyro_x",))}, {}, Provenance("", "", "table"))
    found = to_json(facts_of([bare], {"a": Audit("a", "", "", "unknown", (), (), (), {}, {}, Span(0.0, 0.1))}, []))
    assert (found["offset_s"], found["voltage_V"], found["top_speed_m_s"]) == (None, None, None)
    assert "imu late" not in dict(rows_of(found))
