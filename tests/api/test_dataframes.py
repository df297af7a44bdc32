"""Streams as DataFrames and back: units, indexes, one grid; against hand-worked values and SciPy."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation, Slerp

from nanobench_tools import Flight, InputError, UsageError, make_stream
from nanobench_tools.results.dataframes import frame_of, interpolated, seconds_of

TIME = np.arange(5) / 10.0


def imu(columns=("acc_z", "gyro_x"), index=TIME, values=None):
    values = np.ones((len(index), len(columns))) if values is None else values
    return pd.DataFrame(values, index=index, columns=list(columns))


@given(hnp.arrays(float, st.tuples(st.integers(2, 20), st.just(3)), elements=st.floats(-1e6, 1e6)))
def test_there_and_back_is_the_same_to_the_bit(values):
    time_s = np.arange(len(values)) * 0.01
    stream = make_stream("imu", time_s, values, ("gyro_x", "gyro_y", "gyro_z"))
    again = Flight.from_pandas({"imu": stream.to_pandas()})["imu"]
    np.testing.assert_array_equal(again.values, stream.values)
    np.testing.assert_array_equal(again.time_s, stream.time_s)
    assert again.unit == stream.unit


def test_a_frame_says_its_units_in_the_columns_and_in_attrs():
    frame = make_stream("battery", TIME, TIME[:, None] + 3.0, ("vbat",)).to_pandas()
    assert frame.columns.tolist() == [("vbat", "V")]
    assert frame.attrs["units"] == {"vbat": "V"}
    assert frame.index.name == "time_s"


@pytest.mark.parametrize("how", ["argument", "columns", "attrs"])
def test_units_come_from_wherever_they_are_said(how):
    frame = imu()
    units = {"acc_z": "g", "gyro_x": "deg/s"}
    if how == "columns":
        frame.columns = pd.MultiIndex.from_tuples(list(units.items()))
    if how == "attrs":
        frame.attrs["units"] = units
    flight = Flight.from_pandas({"imu": frame}, {"imu": units} if how == "argument" else None)
    np.testing.assert_allclose(flight["imu"].values[0], [9.81, np.pi / 180.0])


@pytest.mark.parametrize("index", [
    pd.to_timedelta(TIME, unit="s"),
    pd.Timestamp("2026-01-01") + pd.to_timedelta(TIME, unit="s"),
    pd.Timestamp("2026-01-01T01:00", tz="Europe/Berlin") + pd.to_timedelta(TIME, unit="s"),
    TIME + 1e6, TIME,
])
def test_every_kind_of_time_begins_at_zero(index):
    flight = Flight.from_pandas({"imu": imu(index=index)})
    np.testing.assert_allclose(flight["imu"].time_s, TIME, atol=1e-6)
    if isinstance(index, pd.DatetimeIndex):
        assert flight.epoch_s == pd.Timestamp("2026-01-01", tz="UTC").timestamp()


@pytest.mark.parametrize(("frames", "units", "words"), [
    ({"imy": imu()}, None, ("imy", "imu")),
    ({"imu": imu(("acc_z", "gyrox"))}, None, ("gyrox", "did you mean 'gyro_x'")),
    ({"imu": imu(("acc_z", "acc_z"))}, None, ("acc_z", "two columns")),
    ({"imu": imu(index=range(5))}, None, ("counts rows", "set_index")),
    ({"imu": imu(index=list("abcde"))}, None, ("'a'", "seconds")),
    ({"imu": imu(index=[0, 1, np.nan, 3, 4])}, None, ("row 3", "time")),
    ({"imu": imu()}, {"imu": {"acc_z": "furlong"}}, ("acc_z", "furlong")),
    ({"imu": imu()}, {"imu": {"acc_x": "g"}}, ("acc_x", "no column")),
    ({"imu": imu(values=np.array([["1", "x"]] * 5, object))}, None, ("gyro_x", "row 1", "'x'")),
    ({"imu": imu()[:0]}, None, ("no row",)),
    ({}, None, ("no row",)),
    ({"imu": [1, 2]}, None, ("list", "DataFrame")),
])
def test_what_is_wrong_is_said_in_one_line(frames, units, words):
    with pytest.raises(InputError) as told:
        Flight.from_pandas(frames, units)
    assert all(word in str(told.value) for word in words), str(told.value)
    assert "\n" not in str(told.value)


def test_text_that_is_numbers_is_read_and_unsorted_rows_are_kept_for_the_audit():
    frame = imu(("acc_z",), [0.0, 0.2, 0.1], np.array([["1.5"], ["2.5"], ["3.5"]], object))
    assert Flight.from_pandas({"imu": frame})["imu"].time_s.tolist() == [0.0, 0.2, 0.1]


def test_one_grid_draws_lines_turns_angles_the_short_way_and_ends_with_the_stream():
    yaw = make_stream("attitude", [0.0, 1.0], [[0.0, 0.0, 3.0], [0.0, 0.0, -3.0]], ("roll", "pitch", "yaw"))
    volts = make_stream("battery", [0.5, 1.5], [[4.0], [3.0]], ("vbat",))
    flight = Flight.from_pandas({"attitude": yaw.to_pandas(), "battery": volts.to_pandas()})
    frame = flight.to_pandas(rate_hz=4.0)
    assert frame.index.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5]
    np.testing.assert_allclose(frame["battery.vbat", "V"], [np.nan, np.nan, 4.0, 3.75, 3.5, 3.25, 3.0])
    assert abs(frame["attitude.yaw", "rad"].iloc[2]) == pytest.approx(np.pi)
    assert frame["battery.interpolated", "1"].tolist() == [1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.0]


def test_quaternions_turn_as_scipy_turns_them():
    rng = np.random.default_rng(1)
    turns = Rotation.random(6, rng=rng)
    time_s, at = np.arange(6.0), np.linspace(0.0, 5.0, 40)
    found = interpolated(time_s, turns.as_quat(), ("qx", "qy", "qz", "qw"), at)
    off = (Slerp(time_s, turns)(at).inv() * Rotation.from_quat(found)).magnitude()
    np.testing.assert_allclose(off, 0.0, atol=1e-9)


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, np.nan, np.inf, 1e12])
def test_a_rate_that_is_none_is_refused(rate_hz):
    with pytest.raises(UsageError):
        Flight.from_pandas({"imu": imu()}).to_pandas(rate_hz)


def test_no_frame_of_a_single_row():
    with pytest.raises(InputError, match="two rows"):
        Flight.from_pandas({"imu": imu()[:1]}).to_pandas()


def test_dates_before_and_after_an_hour_that_occurs_twice():
    index = pd.date_range("2026-10-25 00:59:59.9", periods=3, freq="100ms", tz="UTC").tz_convert("Europe/Berlin")
    np.testing.assert_allclose(np.diff(seconds_of("f", index)), 0.1, atol=1e-6)


def test_a_frame_takes_a_quantity_without_its_unit():
    frame = frame_of(TIME, np.column_stack([TIME, TIME]), ("a", "b"), ("m", "s"))
    assert frame["a"].shape == (5, 1)
