"""Thinning a series hides no extreme and no gap; packing it costs no more than it says."""

import base64

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nanobench_tools.report.decimate import MISSING, at_rate, extreme_rows, pack

values_with_gaps = arrays(float, st.integers(1, 400), elements=st.one_of(st.just(np.nan), st.floats(-1e3, 1e3)))


def unpack(packed):
    """What the page's script does, in NumPy."""
    if "f" in packed:
        return np.frombuffer(base64.b64decode(packed["f"]), "<f4").astype(float)
    steps = np.frombuffer(base64.b64decode(packed["b"]), "<i2")
    return np.where(steps == MISSING, np.nan, packed["o"] + packed["s"] * steps.astype(float))


@settings(deadline=None)
@given(values_with_gaps, st.integers(1, 50))
def test_extremes_ends_and_gaps_of_every_bucket_survive(values, buckets):
    rows = extreme_rows(values, buckets)
    assert np.all(np.diff(rows) > 0)
    assert rows[0] == 0
    assert rows[-1] == len(values) - 1
    assert len(rows) <= max(3 * buckets + 2, 1)
    size = 1 if len(values) <= 2 * buckets else -(-len(values) // buckets)
    for start in range(0, len(values), size):
        bucket, kept = values[start:start + size], values[rows[(rows >= start) & (rows < start + size)]]
        assert np.isnan(bucket).any() == np.isnan(kept).any()
        if np.isfinite(bucket).any():
            assert np.nanmin(kept) == np.nanmin(bucket)
            assert np.nanmax(kept) == np.nanmax(bucket)


@settings(deadline=None)
@given(values_with_gaps, st.floats(1e-4, 1.0))
def test_packing_errs_by_less_than_the_resolution(values, resolution):
    packed = pack(values, resolution)
    back = unpack(packed)
    assert packed["n"] == len(back) == len(values)
    assert np.array_equal(np.isnan(back), np.isnan(values))
    good = np.isfinite(values)
    assert np.all(np.abs(back[good] - values[good]) <= resolution + 1e-6 * np.abs(values[good]))


def test_a_wide_range_is_kept_as_floats_and_infinity_is_a_gap():
    assert "f" in pack(np.array([0.0, 1e6]), 1e-3)
    assert np.isnan(unpack(pack(np.array([0.0, np.inf]), 1e-3))[1])
    assert unpack(pack(np.array([]), 1e-3)).size == 0


def test_a_rate_takes_the_first_row_of_every_slot_and_the_last_row():
    t = np.arange(0, 1.001, 0.01)
    assert at_rate(t, 20.0).tolist() == [*range(0, 101, 5)]
    assert at_rate(np.array([0.0, 0.3, 0.31]), 20.0).tolist() == [0, 1, 2]
    assert at_rate(np.array([]), 20.0).tolist() == []
    assert len(at_rate(t + 7.0, 10.0)) == pytest.approx(11, abs=1)
