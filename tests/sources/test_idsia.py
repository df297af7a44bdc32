"""Recordings of the IDSIA benchmark, written to the facts of the format from a flight that is known."""

from __future__ import annotations

import io

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from test_draft_axes import G, flown

from nanobench_tools.sources import load_recordings

EPOCH_S = 1.7e9
ERPM = 1750.0 * 60.0 / (2.0 * np.pi) * 6.0
"""Electrical speed of a rotor at 1750 rad/s, in hundreds as it is logged."""


def columns(truth="{}_poses", wanted="{}_setpoint"):
    """A flight on the grid of 100 Hz, name -> (n,)."""
    t, p, v, a, turn, w = flown()
    grid = np.arange(round(100.0 * t[-1])) / 100.0
    held = np.clip(np.searchsorted(t, grid + 1e-9, side="right") - 1, 0, None)
    q = turn.as_quat()
    found = {"t": grid, "ros_timestamp": EPOCH_S + grid + 0.01}
    found |= {truth.format(x): p[held, k] for k, x in enumerate("xyz")}
    found |= {x: np.round(p[held, k], 3) for k, x in enumerate("xyz")}
    found |= {f"v{x}": np.round(v[held, k], 3) for k, x in enumerate("xyz")}
    found |= {f"q{x}": q[held, k] for k, x in enumerate("xyzw")}
    found |= {f"w{x}": np.round(w[held, k], 3) for k, x in enumerate("xyz")}
    found |= {f"a{x}": (a + G)[held, k] for k, x in enumerate("xyz")}
    found |= {f"m{k}_thrust": np.full(len(grid), (30000 + 100 * k) / 65535.0) for k in (1, 2, 3, 4)}
    found |= {f"m{k}_erpm": np.full(len(grid), 100.0 * round(ERPM / 100.0)) for k in (1, 2, 3, 4)}
    found |= {"thrust": np.full(len(grid), 0.5), "torch_yaw": np.full(len(grid), 0.5)}
    found |= {wanted.format(x): np.where(grid < 2.0, 0.0, p[held, k] + 0.01) for k, x in enumerate("xyz")}
    return found | {"Vbat": np.full(len(grid), 3.9), "is_flying": grid > 3.0}


def text(table):
    rows = [",".join(["", *table])]
    rows += [",".join([str(k), *("" if isinstance(v, float) and np.isnan(v) else repr(v) for v in row)])
             for k, row in enumerate(zip(*(c.tolist() for c in table.values()), strict=True))]
    return ("\n".join(rows) + "\n").encode()


def parquet(table):
    file = io.BytesIO()
    pq.write_table(pa.table(table), file)
    return file.getvalue()


def read(tmp_path, data):
    (tmp_path / "run").write_bytes(data)
    return load_recordings([tmp_path / "run"], cache=False)


@pytest.mark.parametrize("write", [text, parquet])
def test_every_stream_has_its_unit_and_frame(tmp_path, write):
    names = ("{}_poses", "{}_setpoint") if write is text else ("{}_mocap", "{}_r")
    table = columns(*names)
    if write is parquet:
        table["qx_mocap"] = np.full(len(table["t"]), np.nan)
    (flight,) = read(tmp_path, write(table)).flights
    assert flight.provenance.source == "idsia"
    assert set(flight.streams) == {"mocap", "estimator", "attitude_qw", "imu", "estimator_acc", "motor", "rpm",
                                   "command", "battery", "setpoint"}
    assert flight.epoch_s == pytest.approx(EPOCH_S + 0.01)
    assert "acc_x" not in flight["imu"]
    np.testing.assert_allclose(flight["rpm"].values, 1750.0, atol=1.0)
    np.testing.assert_allclose(flight["motor"].values[0], [(30000 + 100 * k) / 65535.0 for k in (1, 2, 3, 4)])
    np.testing.assert_allclose(flight["estimator_acc"]["az"], table["az"] - 9.81)
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"].T, [table[names[0].format(x)] for x in "xyz"])
    assert flight["setpoint"].time_s[0] == pytest.approx(2.0)
    yaw = names[1].format("yaw")
    (with_yaw,) = read(tmp_path, write({**table, yaw: 0.1 * table["t"]})).flights
    np.testing.assert_allclose(with_yaw["setpoint"]["yaw"], 0.1 * with_yaw["setpoint"].time_s)


def test_invalid_cells_are_missing(tmp_path):
    table = columns()
    table["m2_erpm"][100] = 65535.0
    table["m3_erpm"][101] = np.nan
    for q in "xyzw":
        table[f"q{q}"][50:53] = 0.2
    (flight,) = read(tmp_path, text(table)).flights
    assert np.isnan(flight["rpm"]["m2"][100])
    assert not np.isin(table["t"][50:53], flight["attitude_qw"].time_s).any()
    assert any("3 quaternions without unit length" in f.evidence for f in flight.provenance.findings)


def test_rows_that_the_grid_displaces_are_left_out(tmp_path):
    table = columns()
    table["ros_timestamp"][-1] += 9.3
    (flight,) = read(tmp_path, text(table)).flights
    assert len(flight["imu"]) == len(table["t"]) - 1
    assert any("1 rows left out" in f.evidence for f in flight.provenance.findings)


def test_arrivals_are_the_time_where_the_grid_is_no_clock(tmp_path):
    table = columns()
    table["ros_timestamp"] = EPOCH_S + 1.4 * table["t"]
    table["ros_timestamp"][301] = table["ros_timestamp"][300]
    (flight,) = read(tmp_path, text(table)).flights
    assert flight["imu"].span.end_s == pytest.approx(1.4 * table["t"][-1], abs=1e-5)
    assert len(flight["imu"]) == len(table["t"]) - 1
    assert any("time is ros_timestamp" in n for n in flight.provenance.notes)


def test_what_is_in_another_unit_is_refused_or_left_out(tmp_path):
    table = columns()
    wrong = {**table, **{f"m{k}_thrust": 65535.0 * table[f"m{k}_thrust"] for k in (1, 2, 3, 4)}}
    assert "where a share of full command belongs" in read(tmp_path, text(wrong)).failed[0]["error"]
    wrong = {**table, **{f"m{k}_erpm": table[f"m{k}_erpm"] / 100.0 for k in (1, 2, 3, 4)}}
    (flight,) = read(tmp_path, text(wrong)).flights
    assert "rpm" not in flight


def test_a_parquet_file_of_far_too_many_rows_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("nanobench_tools.sources.payload.SMALL_BYTES", 1 << 20)
    monkeypatch.setattr("nanobench_tools.sources.payload.MOST_RATIO", 2)
    table = {name: np.zeros(40_000) for name in columns("{}_mocap", "{}_r")}
    (failure,) = read(tmp_path, parquet(table)).failed
    assert "unpacks to" in failure["error"]


def test_filtered_tables_are_no_recordings(tmp_path):
    table = {**columns(), "m1_rads": np.zeros(1)}
    table["m1_rads"] = 0.0 * table["t"]
    assert read(tmp_path, text(table)).flights == []
