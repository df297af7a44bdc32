"""Several flights in one log: every one is a span in the air, and the ground between them is none."""

import numpy as np
import pytest

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Flight, Provenance, make_stream

POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")


def hops(*spans, seconds, rate_hz=50.0, ground_m=0.0, noise_m=4e-4, motor=False, low_m=None, seed=3):
    """A vehicle that flies 1 m above ``ground_m`` during spans (s), 0.6 s up and down; ``low_m``: flies so low instead
    of standing between them."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate_hz)
    height = np.zeros_like(t)
    for start, end in spans:
        rise = np.clip(np.minimum(t - start, end - t) / 0.6, 0.0, 1.0)
        height = np.maximum(height, rise * rise * (3.0 - 2.0 * rise))
    moves = height > 0.0 if low_m is None else np.ones_like(t, dtype=bool)
    x = np.cumsum(np.where(moves, 0.4 * np.cos(t), 0.0)) / rate_hz
    between = 0.0 if low_m is None else np.where((t > spans[0][1]) & (t < spans[-1][0]), low_m, 0.0)
    position = np.column_stack([x, 0.2 * x, ground_m + np.maximum(height, between)])
    pose = np.column_stack([position + noise_m * rng.standard_normal((len(t), 3)),
                            np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1))])
    streams = {"mocap": make_stream("mocap", t, pose, POSE)}
    if motor:
        on = np.where(height > 0.0, 0.5 + 0.02 * np.sin(7.0 * t), 0.0)
        streams["motor"] = make_stream("motor", t, np.repeat(on[:, None], 4, axis=1), ("m1", "m2", "m3", "m4"))
    return Flight("hops", streams, {}, Provenance("hops", "", "test"))


@pytest.mark.parametrize("options", [{}, {"rate_hz": 10.0}, {"ground_m": -0.7}, {"motor": True}, {"noise_m": 2e-3},
                                     {"rate_hz": 200.0, "ground_m": 12.0}])
@pytest.mark.parametrize("spans", [((2.0, 8.0), (13.0, 20.0)), ((2.0, 6.0), (8.0, 12.0), (20.0, 25.0)),
                                   ((0.0, 5.0), (9.0, 14.0))])
def test_each_flight_is_a_span(spans, options):
    found = audit(hops(*spans, seconds=30.0, **options)).airborne
    assert len(found) == len(spans)
    for span, (start, end) in zip(found, spans, strict=True):
        assert (span.start_s, span.end_s) == pytest.approx((start, end), abs=0.35)


def test_a_touch_of_the_ground_separates_nothing():
    (span,) = audit(hops((2.0, 8.0), (8.4, 14.0), seconds=20.0)).airborne
    assert (span.start_s, span.end_s) == pytest.approx((2.0, 14.0), abs=0.3)


def test_flight_close_to_the_ground_is_flight():
    (span,) = audit(hops((2.0, 8.0), (13.0, 18.0), seconds=24.0, low_m=0.03)).airborne
    assert (span.start_s, span.end_s) == pytest.approx((2.0, 18.0), abs=0.3)


def test_nothing_on_the_ground_is_usable_flight():
    found = audit(hops((2.0, 8.0), (13.0, 20.0), seconds=30.0))
    assert sum(s.duration_s for s in found.airborne) == pytest.approx(13.0, abs=0.7)
