"""Timestamps far away from all others: a damaged one is left out, another clock or recording is refused."""

from __future__ import annotations

import numpy as np
import pytest
from test_changed_columns import table
from test_draft_axes import flown
from test_other_spellings import read, vector, written

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings
from nanobench_tools.sources.clock_jumps import far_rows, on_one_clock

UNIX_S = 1_709_290_000.0


@pytest.mark.parametrize("row", [0, 400, -1], ids=["first", "middle", "last"])
def test_a_damaged_timestamp_is_left_out(tmp_path, row):
    t, p, *_ = flown()
    stamps = t + UNIX_S
    stamps[row] = 0.0 if row == 0 else 3.0 * UNIX_S
    flight, _ = read(written(tmp_path, {"t": [f"{s:.6f}" for s in stamps], **vector(("px", "py", "pz"), p)}))
    kept = np.delete(np.arange(len(t)), row)
    np.testing.assert_allclose(flight.epoch_s + flight["mocap"].time_s, t[kept] + UNIX_S, atol=1e-6)
    np.testing.assert_allclose(flight["mocap"]["px"], p[kept, 0], atol=1e-9)
    (finding,) = flight.provenance.findings
    assert (finding.kind, finding.size) == ("bad_cell", 1.0)
    assert all(f.end_s < 100.0 for f in audit(flight).faults)


@pytest.mark.parametrize("later_s", [UNIX_S, 86400.0, -7200.0], ids=["from boot to unix", "a day later", "earlier"])
def test_two_clocks_or_recordings_are_refused(tmp_path, later_s):
    columns = table()
    columns["t"] = np.where(columns["t"] > 8.0, columns["t"] + later_s, columns["t"])
    with pytest.raises(InputError, match=r"row 402; .* rows lie an hour and more from the others"):
        draft_columns(written(tmp_path, columns))


def test_a_map_with_a_wrong_unit_of_time_is_refused(tmp_path):
    columns = table()
    path = written(tmp_path, {**columns, "t": 1e6 * columns["t"]})
    text = draft_columns(path).text.replace('column = "t", unit = "us"', 'column = "t", unit = "s"')
    assert 'column = "t", unit = "s"' in text
    (tmp_path / "map.toml").write_text(text)
    (failed,) = load_recordings([path], columns=tmp_path / "map.toml", cache=False).failed
    assert "another unit of time" in failed["error"]


def test_a_log_of_many_hours_is_one_recording():
    t = np.arange(0.0, 20.0 * 3600.0, 10.0)
    assert not far_rows(t).any()
    assert not far_rows(np.empty(0)).any()


def test_a_message_from_before_the_recording_is_left_out():
    t = np.arange(0.0, 10.0, 0.1)
    streams = {"battery": make_stream("battery", np.r_[-7200.0, t[:20]], np.full((21, 1), 4.0), ["vbat"]),
               "mocap": make_stream("mocap", t, np.zeros((100, 3)), ["px", "py", "pz"])}
    flight = on_one_clock(Flight("a", streams, {}, Provenance("a", "", "test"), epoch_s=5.0))
    assert (len(flight["battery"]), len(flight["mocap"]), flight.epoch_s) == (20, 100, 5.0)
