"""Broken files: each ends in right numbers with the fault reported, or in one line that names the file."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from source_samples import EPOCH, MUTATIONS, NAMES, TO_SI, Broken, csv_text, table, usd_log

from nanobench_tools import Flight
from nanobench_tools.sources import load_recordings

SEEDS = range(12)
FURTHER = range(12, 36)
VALUES = table()


def read_one(folder: Path, data: bytes, name: str = "recording") -> Flight | str:
    """The flight, or the one line that was given instead. Any other exception fails the test."""
    path = folder / name
    path.write_bytes(data)
    loaded = load_recordings([path], cache=False)
    assert len(loaded.flights) + len(loaded.failed) == 1
    if loaded.flights:
        return loaded.flights[0]
    line = loaded.failed[0]["error"]
    assert "\n" not in line
    assert str(path) in line
    assert "failed," not in line, f"an exception that is no NanobenchError: {line}"
    return line


def check_numbers(flight: Flight, broken: Broken) -> set[int]:
    """Every value whose row or column was not touched equals the original; returns the original rows that survive."""
    survived: set[int] = set()
    for name, stream in flight.streams.items():
        if name == "extra":
            continue
        step = (flight.epoch_s + stream.time_s - EPOCH) * 100.0
        rows = np.arange(60) if len(stream) == 60 else np.round(step).astype(int)
        ours = (rows >= 0) & (rows < 60) & ((np.abs(step - rows) < 1e-3) | (len(stream) == 60))
        survived.update(rows[ours].tolist())
        hit = np.isin(rows, list(broken.rows))
        for k, column in enumerate(stream.columns):
            check = ours & ~hit if column in broken.columns or not broken.columns else ours
            right = VALUES[rows[check], NAMES.index(column)] * TO_SI.get(column, 1.0)
            np.testing.assert_allclose(stream.values[check, k], right, rtol=1e-12, atol=1e-15, err_msg=column)
    return survived


@pytest.mark.slow
def test_enough_distinct_mutations():
    digests = {
        hashlib.sha256(mutate(VALUES, np.random.default_rng(seed)).data).digest()
        for mutate in MUTATIONS.values()
        for seed in (*SEEDS, *FURTHER)
    }
    digests |= {hashlib.sha256(b).digest() for b in broken_logs()}
    assert len(digests) >= 500


@pytest.mark.parametrize("seeds", [SEEDS, pytest.param(FURTHER, marks=pytest.mark.slow)], ids=["some", "more"])
@pytest.mark.parametrize("kind", MUTATIONS)
def test_mutated_recording(kind, seeds, tmp_path):
    read = 0
    for seed in seeds:
        broken = MUTATIONS[kind](VALUES, np.random.default_rng(seed))
        result = read_one(tmp_path, broken.data)
        if isinstance(result, str):
            continue
        read += 1
        survived = check_numbers(result, broken)
        whole_rows_hit = (
            broken.rows if not broken.columns or "t" in broken.columns or len(broken.columns) == 52 else set()
        )
        assert survived >= set(range(len(VALUES))) - set(whole_rows_hit), f"seed {seed}: untouched rows are gone"
        found = {f.kind for f in result.provenance.findings}
        assert not broken.kinds or found & broken.kinds, f"seed {seed}: not reported, only {found}"
    assert read > 0 or kind in ("header_bytes",)


@pytest.mark.slow
def test_cut_anywhere_reports_or_loses_nothing(tmp_path):
    """A cut behind a whole row cannot be seen without a sheet; every other cut is reported."""
    whole = csv_text(VALUES[:6]).encode()
    header = whole.index(b"\n") + 1
    for end in range(header + 1, len(whole), 29):
        result = read_one(tmp_path, whole[:end])
        if isinstance(result, str):
            assert whole[:end].count(b"\n") == 1
            continue
        check_numbers(result, Broken(b"", frozenset(), frozenset()))
        rows, last = whole[:end].count(b"\n") - 1, whole[:end].rpartition(b"\n")[2]
        kept = len(result["mocap"])
        assert kept == rows + (kept > rows)
        if last and kept == rows:
            assert "truncated" in {f.kind for f in result.provenance.findings}
        if kept > rows:
            assert whole[end : end + 1] == b"\n"


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(max_size=3000))
def test_arbitrary_bytes(tmp_path, data):
    read_one(tmp_path, data)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    prefix=st.sampled_from(
        [
            csv_text(VALUES[:4]).encode(),
            b"pwm,vbat[V],rpm1,thrust[g]\n1,2,3,4\n",
            usd_log().data,
            b"1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n",
            b"PAR1",
            b"\xfd7zXZ\x00",
            b"\x1f\x8b\x08\x00",
        ]
    ),
    cut=st.integers(0, 4000),
    tail=st.binary(max_size=400),
)
def test_start_of_a_format_and_then_anything(tmp_path, prefix, cut, tail):
    read_one(tmp_path, prefix[:cut] + tail)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    row=st.integers(0, 59),
    column=st.integers(1, 51),
    cell=st.text(max_size=12).filter(lambda s: "\n" not in s and "\r" not in s),
)
@pytest.mark.slow
def test_any_text_in_a_cell(tmp_path, row, column, cell):
    """Either the number that was written, or NaN and a finding, or the row is left out and reported."""
    cells = [[f"{v:.9f}" for v in line] for line in VALUES]
    cells[row][column] = cell
    data = "\n".join([",".join(NAMES), *map(",".join, cells)]) + "\n"
    flight = read_one(tmp_path, data.encode("utf-8", errors="replace"))
    if isinstance(flight, str):
        return
    check_numbers(flight, Broken(b"", frozenset([row]), frozenset([NAMES[column]])))
    stream = next(s for s in flight.streams.values() if NAMES[column] in s.columns)
    try:
        number = float(cell.strip()) if cell.isascii() and "_" not in cell else float("nan")  # as it is read
    except ValueError:
        number = float("nan")
    if len(stream) == 60 and np.isfinite(stream[NAMES[column]][row]):
        assert stream[NAMES[column]][row] == pytest.approx(number * TO_SI.get(NAMES[column], 1.0), rel=1e-12)
    else:
        assert "bad_cell" in {f.kind for f in flight.provenance.findings}


def broken_logs() -> list[bytes]:
    """uSD logs cut at many places, with flipped bytes and with noise."""
    whole = usd_log().data
    logs = [whole[:end] for end in range(0, len(whole), 23)]
    rng = np.random.default_rng(5)
    for _ in range(60):
        data = bytearray(whole)
        for at in rng.integers(0, len(data), int(rng.integers(1, 4))):
            data[at] ^= int(rng.integers(1, 256))
        logs.append(bytes(data))
    for _ in range(30):
        at = int(rng.integers(0, len(whole)))
        logs.append(whole[:at] + rng.integers(0, 256, 50, dtype=np.uint8).tobytes() + whole[at:])
    return logs


def test_broken_logs(tmp_path):
    """Every damage is reported; in a log that was only cut, what is read is the original's beginning."""
    sample = usd_log()
    for data in broken_logs():
        result = read_one(tmp_path, data)
        if isinstance(result, str) or data == sample.data:
            continue
        assert {f.kind for f in result.provenance.findings} & {"truncated", "checksum"}
        if sample.data.startswith(data):
            whole = sum(end <= len(data) for end in sample.ends)
            rows = sum(len(result[n]) for n in ("imu", "mocap") if n in result)
            assert rows == whole
            assert result["imu"]["gyro_y"] == pytest.approx(
                np.radians([v[1] for _, v in sample.fixed][: len(result["imu"])])
            )


def test_bad_sheet_is_reported_and_the_recording_is_read(tmp_path):
    (tmp_path / "a.csv").write_text(csv_text(VALUES))
    (tmp_path / "a_metadata.yaml").write_text(
        "trajectory_type: trefoil\nrow_counts:\n  imu: [1, 2\nrecording_start_utc: x\n"
    )
    loaded = load_recordings([tmp_path], cache=False)
    assert len(loaded.flights) == 1
    assert len(loaded.failed) == 1
    assert "a_metadata.yaml: line" in loaded.failed[0]["error"]


@pytest.mark.parametrize(
    "sheet",
    [
        "trajectory_type: [1, 2]\ntrajectory_id: {a: 1}\nrow_counts: 7\nparams: no\n",
        "trajectory_id: x\nrecording_start_utc: yesterday\nrow_counts: {imu: many, vicon: -4}\n",
        "trajectory_id: null\nrecording_start_utc: 2026-03-05T05:47:11Z\nparams: {speed_mps: fast}\n",
    ],
)
def test_sheet_with_values_of_the_wrong_type(tmp_path, sheet):
    (tmp_path / "a.csv").write_text(csv_text(VALUES))
    (tmp_path / "a_metadata.yaml").write_text(sheet)
    loaded = load_recordings([tmp_path], cache=False)
    assert len(loaded.flights) == 1
    assert loaded.failed == []
    assert loaded.flights[0].metadata["reference_speed_m_s"] is None
