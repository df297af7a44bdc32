"""An estimated angle that turns against the gyro is a fault of one of them, also without motion capture."""

import numpy as np
import pytest

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Flight, Provenance, make_stream

ANGLES = ("roll", "pitch", "yaw")


@pytest.mark.parametrize(("negated", "delay_s"), [(None, 0.0), (None, 0.04), (0, 0.0), (1, 0.04), (2, 0.0)])
def test_an_angle_against_the_gyro_is_negated(negated, delay_s):
    t = np.arange(0.0, 8.0, 0.02)
    rng = np.random.default_rng(3)
    size, pace = np.array([0.2, 0.15, 0.3]), np.array([2.0, 3.1, 1.3])
    angles = size * np.sin(pace * t[:, None]) + 1e-3 * rng.standard_normal((len(t), 3))
    gyro = size * pace * np.cos(pace * (t[:, None] - delay_s)) + 0.02 * rng.standard_normal((len(t), 3))
    if negated is not None:
        angles[:, negated] *= -1.0
    imu = np.column_stack([gyro, 0.05 * rng.standard_normal((len(t), 2)), 9.81 + 0.05 * rng.standard_normal(len(t))])
    flight = Flight("made", {
        "attitude": make_stream("attitude", t, angles, ANGLES, rate_hz=50.0),
        "imu": make_stream("imu", t, imu, ("gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z"), rate_hz=50.0),
    }, {}, Provenance("made", "", "test"))
    found = [f.columns for f in audit(flight).faults if f.kind in ("sign", "frame")]
    assert set(found) == (set() if negated is None else {(ANGLES[negated],), (f"gyro_{'xyz'[negated]}",)})
