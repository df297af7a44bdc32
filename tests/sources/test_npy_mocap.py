"""Motion capture in a NumPy array, as Bitcraze's positioning data set has it."""

from __future__ import annotations

import io

import numpy as np
import pytest
from test_draft_axes import flown

from nanobench_tools.sources import load_recordings

START_MS = 188263.333


def cells(width=4):
    t, p, *_ = flown()
    around = np.array([[0.02, 0, 0], [-0.02, 0, 0], [0, 0.02, 0], [0, -0.02, 0]])
    markers = (p[:, None, :] + around).reshape(len(t), 12)
    return np.hstack([(START_MS + 1e3 * t)[:, None], p, markers])[:, :width]


def read(tmp_path, array):
    file = io.BytesIO()
    np.save(file, array)
    (tmp_path / "mocap01.npy").write_bytes(file.getvalue())
    return load_recordings([tmp_path], cache=False)


@pytest.mark.parametrize("width", [4, 16])
def test_positions_and_occlusions(tmp_path, width):
    array = cells(width)
    array[:2] = np.nan
    array[100:110, 1:] = np.nan
    (flight,) = read(tmp_path, array).flights
    t, p, *_ = flown()
    assert flight.provenance.source == "npy_mocap"
    assert flight.epoch_s == pytest.approx(1e-3 * START_MS + t[2])
    np.testing.assert_allclose(flight["mocap"].time_s, t[2:] - t[2], atol=1e-9)
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"][200:], p[202:])
    assert np.isnan(flight["mocap"].values[98:108]).all()
    assert any("2 rows without a time" in n for n in flight.provenance.notes)


@pytest.mark.parametrize(("array", "words"), [
    (cells() * [1e-3, 1, 1, 1], "no ms of motion capture"), (cells() * [1e3, 1, 1, 1], "no ms of motion capture"),
    (cells() * [1, 1e3, 1e3, 1e3], "not in m"), (cells(16) + np.r_[np.zeros(4), np.ones(12)], "no markers of it"),
    (cells() * np.nan, "without a row of numbers"), (np.zeros((5, 3)), "a NumPy array of the shape (5, 3)"),
    (np.zeros((5, 4), dtype=int), "a NumPy array of the shape (5, 4)")])
def test_other_arrays_are_refused(tmp_path, array, words):
    (failure,) = read(tmp_path, array).failed
    assert words in failure["error"]


def test_damage_is_refused(tmp_path):
    file = io.BytesIO()
    np.save(file, cells())
    whole = file.getvalue()
    huge = whole[:200].replace(b"(800, 4)", b"(800000000, 4)").ljust(len(whole), b"\0")
    for data in (whole[:500], whole[:60], huge, b"\x93NUMPY\x01\x00\xff\xff" + bytes(40)):
        (tmp_path / "a.npy").write_bytes(data)
        loaded = load_recordings([tmp_path / "a.npy"], cache=False)
        assert loaded.flights == []
        assert "failed," not in loaded.failed[0]["error"]
