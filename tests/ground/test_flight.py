"""The data model: span algebra against brute force, streams, errors that name the place."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nanobench_tools import Flight, InputError, Provenance, Span, make_stream
from nanobench_tools.errors import MissingExtraError, UsageError
from nanobench_tools.flight import intersect_spans, mask_of, merge_spans, subtract_spans
from nanobench_tools.units import factor, to_si

spans = st.lists(st.builds(lambda a, d: Span(float(a), float(a + d)), st.integers(0, 40), st.integers(1, 10)),
                 max_size=6)
# half-integers lie strictly inside or outside of spans with integer ends
GRID = np.arange(0.5, 60.0)


@given(spans, spans)
def test_span_algebra_equals_sets_of_points(a, b):
    inside_a, inside_b = mask_of(a, GRID), mask_of(b, GRID)
    assert np.array_equal(mask_of(merge_spans(a), GRID), inside_a)
    assert np.array_equal(mask_of(intersect_spans(a, b), GRID), inside_a & inside_b)
    assert np.array_equal(mask_of(subtract_spans(a, b), GRID), inside_a & ~inside_b)


@given(spans, spans)
def test_span_results_are_sorted_and_disjoint(a, b):
    for result in (merge_spans(a), intersect_spans(a, b), subtract_spans(a, b)):
        assert all(x.end_s <= y.start_s for x, y in itertools.pairwise(result))
        assert all(s.duration_s > 0 for s in result)


def stream():
    time_s = np.arange(10) * 0.1
    return make_stream("mocap", time_s, np.stack([time_s, 2 * time_s, 0 * time_s], 1), ["px", "py", "pz"],
                       columns=["x_m", "y_m", "z_m"], samples=5, rate_hz=10.0)


def test_columns_are_found_by_vocabulary_and_by_own_name():
    s = stream()
    assert np.array_equal(s["py"], s["y_m"])
    assert s["px", "pz"].shape == (10, 2)
    assert s.unit == ("m", "m", "m")
    assert s.frame == "world"
    assert "px" in s
    assert "z_m" in s
    assert "vx" not in s
    with pytest.raises(KeyError, match="it has px, py, pz"):
        s["vx"]


def test_cutting_keeps_the_share_of_true_samples():
    cut = stream().during(Span(0.0, 0.45))
    assert len(cut) == 5
    assert cut.samples == 2  # half of 5, interpolated rows never count in full
    assert np.allclose(stream().interpolate("py", np.array([0.05, 0.15])), [0.1, 0.3])


def test_a_stream_of_wrong_shape_cannot_be_made():
    with pytest.raises(ValueError, match="2 columns"):
        make_stream("mocap", np.zeros(3), np.zeros((3, 3)), ["px", "py"])


def test_a_missing_stream_is_one_line_that_names_the_file():
    flight = Flight("a", {"mocap": stream()}, {}, Provenance("a.csv", "0" * 64, "test"))
    with pytest.raises(InputError, match=r"^a\.csv: has no imu stream; it has mocap$"):
        flight["imu"]
    assert flight.span == Span(0.0, pytest.approx(0.9))
    assert len(flight.during(Span(0.2, 0.4))["mocap"]) == 3


def test_errors_survive_a_process_boundary():
    import pickle

    for error in (InputError("f.csv: row 3", "text", "mend it"), MissingExtraError("dask", "cluster"),
                  UsageError("no")):
        assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_units_go_out_as_they_came_in():
    assert to_si(1.0, "g") == pytest.approx(9.81)
    assert to_si(65535, "pwm16") == pytest.approx(1.0)
    assert to_si(60.0, "rpm") == pytest.approx(2 * np.pi)
    with pytest.raises(UsageError, match="unknown unit 'furlong'; known:"):
        factor("furlong")
