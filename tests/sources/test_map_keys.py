"""Keys of a column map: frames, dates, two columns of time, numbers of frames, pulses, offsets, assumptions."""

from __future__ import annotations

import numpy as np
import pytest

from nanobench_tools.errors import InputError
from nanobench_tools.sources import load_recordings
from nanobench_tools.sources.column_map import read_column_map

HEAD = 'schema = "nanobench-columns/1"\n'


def read(tmp_path, rows, text):
    (tmp_path / "table.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (tmp_path / "map.toml").write_text(HEAD + text, encoding="utf-8")
    loaded = load_recordings([tmp_path / "table.csv"], columns=tmp_path / "map.toml", cache=False)
    assert loaded.failed == []
    return loaded.flights[0]


def test_a_frame_turns_the_whole_stream(tmp_path):
    rows = ["t,n,e,d,w,x,y,z", *(f"{0.01 * k},{k},{10 * k},{-k},1,0,0,0" for k in range(20))]
    flight = read(tmp_path, rows, 'time = "t"\n[streams.mocap]\nframe = "NED/FRD"\npx = "n"\npy = "e"\npz = "d"\n'
                  'qw = "w"\nqx = "x"\nqy = "y"\nqz = "z"\n')
    k = np.arange(20.0)
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], np.stack([10 * k, k, k], axis=1))
    half = np.sqrt(0.5)  # level, facing north: yaw +90 deg
    np.testing.assert_allclose(np.abs(flight["mocap"]["qx", "qy", "qz", "qw"]), [[0, 0, half, half]] * 20, atol=1e-12)
    assert flight["mocap"].columns[:2] == ("e", "n")


@pytest.mark.parametrize(("first", "second"), [("2026-03-01T12:00:00.000Z", "2026-03-01T12:00:00.500Z"),
                                               ("2026-03-01 12:00:00,000", "2026-03-01 12:00:00,500"),
                                               ("2026-03-01T13:00:00+01:00", "2026-03-01T13:00:00.5+01:00")])
def test_dates_are_times(tmp_path, first, second):
    rows = ["when;h", f"{first};1.0", f"{second};1.5", f"{second[:-3]}broken;2.5"]
    flight = read(tmp_path, rows, 'time = {column = "when", unit = "iso8601"}\n[streams.mocap]\npz = "h"\n')
    assert flight.epoch_s == pytest.approx(1772366400.0)
    np.testing.assert_allclose(flight["mocap"].time_s, [0.0, 0.5], atol=1e-6)
    assert [f.kind for f in flight.provenance.findings] == ["bad_cell"]


def test_a_time_of_day_passes_midnight(tmp_path):
    rows = ["when,h", "23:59:59.500,1.0", "00:00:00.250,1.5", "00:00:01.000,2.5"]
    flight = read(tmp_path, rows, 'time = {column = "when", unit = "iso8601"}\n[streams.mocap]\npz = "h"\n')
    np.testing.assert_allclose(flight["mocap"].time_s, [0.0, 0.75, 1.5], atol=1e-9)


def test_seconds_and_nanoseconds_stand_in_two_columns(tmp_path):
    rows = ["secs,nsecs,h", "1700000000,990000000,1.0", "1700000001,10000000,1.5", "1700000001,30000000,1.6"]
    flight = read(tmp_path, rows, 'time = {column = "secs", unit = "s", add = {column = "nsecs", unit = "ns"}}\n'
                  '[streams.mocap]\npz = "h"\n')
    np.testing.assert_allclose(flight["mocap"].time_s, [0.0, 0.02, 0.04], atol=1e-12)


def test_a_number_of_frames_is_a_time_by_its_rate(tmp_path):
    rows = ["frame,h", *(f"{100 + k},{k}" for k in range(5))]
    flight = read(tmp_path, rows, 'time = {column = "frame", rate_hz = 200}\n[streams.mocap]\npz = "h"\n')
    np.testing.assert_allclose(flight["mocap"].time_s, 0.005 * np.arange(5), atol=1e-12)


def test_pulses_per_cent_and_kilograms(tmp_path):
    rows = ["t,u,p,f,a", "0.0,900,0,0.1,9810", "0.1,1000,50,0.2,0", "0.2,2000,100,0.3,1"]
    flight = read(tmp_path, rows, 'time = "t"\n[streams.motor]\nm1 = {column = "u", unit = "pulse_us"}\n'
                  'm2 = {column = "p", unit = "%"}\n[streams.command]\nthrust = {column = "f", unit = "kgf"}\n'
                  '[streams.estimator_acc]\naz = {column = "a", unit = "mm/s^2", offset = -9.81, assumed = true}\n')
    np.testing.assert_allclose(flight["motor"]["m1", "m2"], [[0.0, 0.0], [0.0, 0.5], [1.0, 1.0]])
    np.testing.assert_allclose(flight["command"]["thrust"], [0.981, 1.962, 2.943])
    assert flight["command"].unit == ("N",)
    np.testing.assert_allclose(flight["estimator_acc"]["az"][:2], [0.0, -9.81], atol=1e-9)
    (assumed,) = flight.provenance.assumptions
    assert (assumed.stream, assumed.column, assumed.unit) == ("estimator_acc", "a", "mm/s^2")
    again = load_recordings([tmp_path / "table.csv"], columns=tmp_path / "map.toml").flights[0]  # from the cache
    kept = load_recordings([tmp_path / "table.csv"], columns=tmp_path / "map.toml").flights[0]
    assert again.provenance.assumptions == kept.provenance.assumptions == (assumed,)


@pytest.mark.parametrize(("text", "says"), [
    ('time = "t"\n[streams.mocap]\nframe = "NEU"\npz = "h"\n', "line 4, streams.mocap.frame: frame 'NEU'"),
    ('time = "t"\n[streams.mocap]\nframe = "NED"\n', "names no quantity"),
    ('time = {column = "t", rate_hz = 0}\n[streams.mocap]\npz = "h"\n', "time.rate_hz"),
    ('time = {column = "t", rate_hz = 9, unit = "s"}\n[streams.mocap]\npz = "h"\n', "rate_hz beside a unit"),
    ('time = {column = "t", unit = "iso8601", add = "n"}\n[streams.mocap]\npz = "h"\n', "dates need no second"),
    ('time = "t"\n[streams.mocap]\npz = {column = "h", offset = "x"}\n', "offset 'x'"),
    ('time = "t"\n[streams.mocap]\npz = {column = "h", assumed = 1}\n', "assumed 1"),
    ('time = "t"\n[streams.mocap]\npz = {column = "h", unit = "kgf"}\n', "unit 'kgf'; here: m, mm, cm")])
def test_a_wrong_key_is_named_with_its_line(tmp_path, text, says):
    (tmp_path / "map.toml").write_text(HEAD + text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_column_map(tmp_path / "map.toml")
    assert says in str(caught.value)


def test_a_frame_that_cannot_turn_what_is_there_is_refused(tmp_path):
    (tmp_path / "table.csv").write_text("t,a\n0,1\n1,2\n")
    (tmp_path / "map.toml").write_text(HEAD + 'time = "t"\n[streams.attitude]\nframe = "NED/FRD"\nroll = "a"\n')
    loaded = load_recordings([tmp_path / "table.csv"], columns=tmp_path / "map.toml", cache=False)
    assert "streams.attitude.frame" in loaded.failed[0]["error"]
    assert "without pitch, yaw" in loaded.failed[0]["error"]
