"""Numbers on their way to the page and back: nothing between the extremes' ends is lost, and gaps stay gaps."""

import base64
import json
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nanobench_tools.pages.packed import as_json, compressed, envelope, on_grid, rounded

VALUES = arrays(float, st.integers(1, 300), elements=st.one_of(st.floats(-1e4, 1e4), st.just(np.nan), st.just(np.inf)))


def numbers(values):
    return np.array([np.nan if v is None else v for v in json.loads(json.dumps(as_json(values)))])


@given(VALUES)
def test_values_come_within_half_a_resolution_and_what_is_no_number_is_a_gap(values):
    back = numbers(rounded(values, 0.01))
    good = np.isfinite(values)
    assert np.array_equal(np.isnan(back), ~good)
    assert np.abs(back[good] - values[good]).max(initial=0.0) <= 0.005 + 1e-9


def test_numbers_are_short_and_texts_stay():
    assert as_json([0.12345678, None, "a", float("nan")]) == [0.123457, None, "a", None]
    assert as_json(rounded(np.array([0.3, 12.34567]), 0.1)) == [0.3, 12.3]


@given(VALUES, st.integers(1, 40))
def test_an_envelope_keeps_the_extremes_of_every_stretch(values, buckets):
    t = np.linspace(0.0, 10.0, len(values))
    x, y = envelope(t, values, (0.0, 10.0), buckets, 1e-6)
    low_high = y.reshape(-1, 2)
    assert (len(x), len(y)) == (2 * buckets, 2 * buckets)
    slot = np.minimum((t / (10.0 / buckets)).astype(int), buckets - 1)
    for k in range(buckets):
        mine = values[slot == k]
        good = mine[np.isfinite(mine)]
        if not len(good):
            assert np.isnan(low_high[k]).all()
        elif np.isfinite(mine).all():
            ends = [good.min(), good.max()]  # as numbers in whole multiples of the resolution
            np.testing.assert_allclose(np.sort(low_high[k]), ends, rtol=1e-15, atol=0.51e-6)
        else:
            assert np.isnan(low_high[k, 1])  # a gap in it stays seen
    assert x.min() >= 0.0
    assert x.max() <= 10.0


def test_a_gap_is_not_drawn_across():
    t = np.array([0.0, 0.1, 0.2, 1.0, 1.1])
    found = on_grid(t, np.column_stack([t, 2.0 * t]), np.array([0.05, 0.6, 1.05, 2.0]), 0.25)
    assert found[[0, 2]] == pytest.approx(np.array([[0.05, 0.1], [1.05, 2.1]]))
    assert np.isnan(found[[1, 3]]).all()
    assert np.isnan(on_grid(t[:1], t[:1, None], t, 0.25)).all()


def test_compressed_is_zlib_in_base64_of_plain_json():
    body = {"a": [1, None, "é<script>"]}
    assert json.loads(zlib.decompress(base64.b64decode(compressed(body)))) == body
    with pytest.raises(ValueError, match="JSON"):
        compressed({"a": float("nan")})
