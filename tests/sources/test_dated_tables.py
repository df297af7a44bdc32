"""Tables whose time is a column of dates, in Parquet and in text."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from test_draft_axes import flown

from nanobench_tools.errors import InputError
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings

START_S = 1_772_689_631


def read(folder, path):
    (folder / "map.toml").write_text(draft_columns(path).text)
    return load_recordings([path], columns=folder / "map.toml", cache=False).flights[0]


@pytest.mark.parametrize("name", ["t", "__index_level_0__"])
@pytest.mark.parametrize(("unit", "zone"), [("ns", None), ("us", "UTC"), ("ms", "Europe/Berlin")])
def test_timestamps_of_parquet_are_the_time(tmp_path, name, unit, zone):
    t, p, *_ = flown()
    per_s = {"ns": 10**9, "us": 10**6, "ms": 10**3}[unit]
    stamps = START_S * per_s + np.round(t * per_s).astype(np.int64)
    table = pa.table({name: pa.array(stamps, pa.timestamp(unit, tz=zone)),
                      **dict(zip(("px", "py", "pz"), p.T, strict=True))})
    pq.write_table(table, tmp_path / "a.parquet")
    flight = read(tmp_path, tmp_path / "a.parquet")
    np.testing.assert_allclose(flight["mocap"].time_s, t, atol=1e-6)
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p)


def test_a_date_that_stands_still_is_no_time(tmp_path):
    rows = [f"2026-11-05,{x:.3f},{x:.3f},1.0" for x in np.linspace(0.0, 1.0, 50)]
    (tmp_path / "a.csv").write_text("\n".join(["day,px,py,pz", *rows]) + "\n")
    with pytest.raises(InputError, match="no column is named like a time"):
        draft_columns(tmp_path / "a.csv")


def test_a_column_of_dates_is_the_time_by_any_name(tmp_path):
    t, p, *_ = flown()
    rows = [f"2026-11-05T10:00:{s:06.3f}," + ",".join(f"{c:.6f}" for c in row) for s, row in zip(t, p, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["recorded,px,py,pz", *rows]) + "\n")
    np.testing.assert_allclose(read(tmp_path, tmp_path / "a.csv")["mocap"].time_s, t, atol=1e-6)


FIRST = datetime(2026, 11, 25, 12, 59, 50, tzinfo=UTC)


def dated(folder, style, first=FIRST, name="Time"):
    """A path on a clock written in ``style``, which passes from 12:59 to 13:00."""
    t, p, *_ = flown()
    stamps = [(first + timedelta(seconds=s)).strftime(style) for s in t]
    (folder / "a.csv").write_text("\n".join([f"{name};px;py;pz", *(
        ";".join([s, *(f"{c:.6f}" for c in row)]) for s, row in zip(stamps, p, strict=True))]) + "\n")
    return folder / "a.csv"


@pytest.mark.parametrize("style", [
    "%d.%m.%Y %H:%M:%S,%f", "%m/%d/%Y %H:%M:%S.%f", "%d/%m/%Y %H:%M:%S.%f", "%m/%d/%Y %I:%M:%S.%f %p",
    "%d-%b-%Y %H:%M:%S.%f", "%Y/%m/%d %H:%M:%S.%f", "%Y-%m-%dT%H:%M:%S.%f+00:00", "%Y-%m-%d %H:%M:%S.%fZ",
    "%d.%m.%Y, %H:%M:%S:%f"])
def test_dates_as_programs_write_them(tmp_path, style):
    flight = read(tmp_path, dated(tmp_path, style))
    assert flight.epoch_s == FIRST.timestamp()
    np.testing.assert_allclose(flight["mocap"].time_s, flown()[0], atol=2e-6)


@pytest.mark.parametrize("style", ["%I:%M:%S.%f %p", "%H:%M:%S:%f", "%I:%M:%S.%f p.m."])
def test_times_of_day(tmp_path, style):
    np.testing.assert_allclose(read(tmp_path, dated(tmp_path, style))["mocap"].time_s, flown()[0], atol=2e-6)


def test_a_date_that_is_one_of_two_days_is_a_question_until_the_name_states_it(tmp_path):
    early = datetime(2026, 4, 3, tzinfo=UTC)
    with pytest.raises(InputError, match="day or month first"):
        draft_columns(dated(tmp_path, "%d/%m/%Y %H:%M:%S.%f", early))
    flight = read(tmp_path, dated(tmp_path, "%d/%m/%Y %H:%M:%S.%f", early, "Time [day/month/year]"))
    assert flight.epoch_s == early.timestamp()
    flight = read(tmp_path, dated(tmp_path, "%d/%m/%Y %H:%M:%S.%f", early, "Time [month/day/year]"))
    assert flight.epoch_s == early.replace(month=3, day=4).timestamp()
