"""Lines of names below the first row, counters that begin again, and columns of dates, in tables of others."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import flown
from test_other_spellings import read, vector, written

from nanobench_tools.errors import InputError
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources.timestamps import counted_on

NAMES = ("px", "py", "pz")


def appended(folder, header, second):
    """A table whose second half has the columns ``second`` below a line of these names."""
    t, p, *_ = flown()
    columns = {"t": t, **vector(NAMES, p)}
    rows = ["t," + ",".join(header)]
    for k in range(len(t)):
        if k == len(t) // 2:
            rows.append("t," + ",".join(second))
        here = header if k < len(t) // 2 else second
        rows.append(",".join(f"{columns[n.partition(' ')[0]][k]:.6f}" for n in ("t", *here)))
    (folder / "flight.csv").write_text("\n".join(rows) + "\n")
    return folder / "flight.csv"


@pytest.mark.parametrize("second", [("py", "px", "pz"), ("px [mm]", "py [mm]", "pz [mm]")])
def test_other_names_below_the_first_row_are_refused(tmp_path, second):
    with pytest.raises(InputError, match=r"line 402: another line of names \(t, p"):
        draft_columns(appended(tmp_path, NAMES, second))


def test_the_same_names_once_more_are_a_line_without_numbers(tmp_path):
    flight, _ = read(appended(tmp_path, NAMES, NAMES))
    np.testing.assert_allclose(flight["mocap"][NAMES], flown()[1], atol=1e-6)
    assert [f.kind for f in flight.provenance.findings] == ["bad_cell"]


@pytest.mark.parametrize(("name", "size", "per_s"), [
    ("time_us", 2**32, 1e6), ("t", 2**32, 1e6), ("time_ms", 2**16, 1e3)])
def test_counters_that_begin_again_are_counted_on(tmp_path, name, size, per_s):
    t, p, *_ = flown()
    count = (np.round(per_s * t).astype(np.int64) + size - round(8.0 * per_s)) % size
    flight, draft = read(written(tmp_path, {name: [str(c) for c in count], **vector(NAMES, p)}))
    np.testing.assert_allclose(flight["mocap"].time_s, t, atol=1e-6)
    assert "begins again at 0" in draft.text


@pytest.mark.parametrize("stamps", [
    np.r_[0.0:40000.0:20.0, 0.0:40000.0:20.0], np.r_[65000.5, 65500.5, 464.5, 964.5], np.r_[-5.0:65536.0, 0.0:5.0],
    np.r_[65520.0, 65530.0, 4.0, 70000.0]], ids=["two recordings", "fractions", "negative", "beyond the counter"])
def test_other_steps_backwards_stay(stamps):
    np.testing.assert_array_equal(counted_on(stamps), stamps)


@pytest.mark.parametrize("name", ["vx", "gyro_z", "m1", "vbat", "yaw", "thrust"])
def test_dates_are_no_quantity(tmp_path, name):
    t, p, *_ = flown()
    dates = [f"2026-11-05 10:00:{s:06.3f} UTC" for s in t]
    flight, draft = read(written(tmp_path, {name: dates, **vector(NAMES, p)}))
    assert draft.mapped["", "time"] == (name, "iso8601")
    np.testing.assert_allclose(flight["mocap"].time_s, t, atol=1e-6)


def test_dates_that_cannot_be_read_are_text(tmp_path):
    t, p, *_ = flown()
    with pytest.raises(InputError, match="no column is named like a time"):
        draft_columns(written(tmp_path, {"time": [f"2026-11-05 10:00:{s:06.3f} CETX" for s in t], **vector(NAMES, p)}))


def test_seconds_and_milliseconds_in_two_columns(tmp_path):
    t, p, *_ = flown()
    ms = np.round(1e3 * t).astype(int)
    columns = {"sec": [str(1_709_290_000 + k // 1000) for k in ms], "msec": [str(k % 1000) for k in ms]}
    flight, _ = read(written(tmp_path, {**columns, **vector(NAMES, p)}))
    np.testing.assert_allclose(flight["mocap"].time_s, t, atol=1e-6)


@pytest.mark.parametrize(("start", "per_s", "unit", "status"), [
    (1_709_290_000_000_000_000, 10**9, "ns", "known"), (13_550_000, 10**6, "us", "assumed")])
def test_names_of_kalibr_mean_nanoseconds_only_since_1970(tmp_path, start, per_s, unit, status):
    t, *_, w = flown()
    stamps = [str(start + round(per_s * s)) for s in t]
    draft = draft_columns(written(tmp_path, {"timestamp": stamps, **vector(("omega_x", "omega_y", "omega_z"), w)}))
    assert (draft.mapped["", "time"], draft.status["timestamp"]) == (("timestamp", unit), status)


@pytest.mark.parametrize("line", ["# battery changed", "t,px,py,pz,vx,vy,vz", "1e12,0,0,0,0,0,0"])
def test_a_line_of_something_else_hides_no_question(tmp_path, line):
    """A velocity in the body is found with the line as without it."""
    t, p, v, _, turn, _ = flown()
    columns = {"t": t, **vector(NAMES, p), **vector(("vx", "vy", "vz"), turn.inv().apply(v)),
               **vector(("qx", "qy", "qz", "qw"), turn.as_quat())}
    path = written(tmp_path, columns)
    questions, unknown = draft_columns(path).questions, draft_columns(path).unknown
    assert "a velocity in the body frame" in " ".join(unknown.values())
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:300], line + ",0,0,0,0" * line.startswith("1e12"), *lines[300:]]) + "\n")
    assert (draft_columns(path).questions, draft_columns(path).unknown) == (questions, unknown)
