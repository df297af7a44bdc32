"""Tracking errors by hand, and lag and contour on a path whose answers are known."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from nanobench_tools.metrics import tracking
from nanobench_tools.metrics.trajectory import rms

HAND = tomllib.loads((Path(__file__).parents[1] / "references" / "metrics_by_hand.toml").read_text())["tracking"]
T = np.arange(0, 12, 0.01)


def circle(t):
    return np.stack([np.cos(0.5 * t), np.sin(0.5 * t), np.ones_like(t)], axis=1)


def test_by_hand():
    errors = tracking.position_errors(HAND["position"], np.zeros((4, 3)))
    assert rms(errors) == pytest.approx(HAND["rmse_m"])
    assert errors.mean() == pytest.approx(HAND["ade_m"])
    assert tracking.divergence_percent(errors) == HAND["divergence_percent"]
    assert tracking.worst_decile(errors) == pytest.approx(1.2)
    assert tracking.worst_decile(np.arange(20.0)) == 18.5


def test_heading_wraps_and_the_published_one_takes_degrees_for_radians():
    assert tracking.heading_error_deg([np.pi - 0.05], [-np.pi + 0.05]) == pytest.approx(np.degrees(0.1))
    assert tracking.published_heading_error_deg([0.0], [1.0]) == pytest.approx(np.degrees(1.0))
    assert tracking.published_heading_error_deg([1.0], [7.0]) == pytest.approx(np.degrees(2 * np.pi - 6.0))


def test_setpoint_velocity_is_the_derivative():
    found = tracking.setpoint_velocity(T, circle(T))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 0.5, atol=2e-3)
    with pytest.raises(ValueError, match="fewer"):
        tracking.setpoint_velocity(T[:30], circle(T[:30]))


def test_published_velocity_counts_steps():
    setpoint = np.zeros((5, 3))
    setpoint[3:, 0] = 0.5
    # one of the four steps is 0.5 m in 0.01 s = 50 m/s: sqrt(2500 / 4) = 25
    assert tracking.published_velocity_rmse(T[:5], np.zeros((5, 3)), setpoint) == pytest.approx(25.0)


@pytest.mark.parametrize("delay", [0.25, 0.53])
def test_a_vehicle_that_only_lags_has_no_other_error(delay):
    position, setpoint = circle(T - delay), circle(T)
    found, left = tracking.lag(T, position, setpoint)
    assert found == pytest.approx(delay, abs=1e-4)
    assert left < 1e-4
    assert tracking.contour_errors(position, setpoint)[60:].max() < 2e-6
    assert rms(tracking.position_errors(position, setpoint)) > 0.1


def test_contour_is_the_distance_to_the_path():
    out = circle(T) * [1.1, 1.1, 1.0]
    np.testing.assert_allclose(tracking.contour_errors(out, circle(T))[5:-5], 0.1, atol=1e-5)


def test_saturated_share():
    motor = np.array([[0.5] * 4, [0.5, 0.5, 0.5, 0.999], [1.0] * 4, [0.9] * 4])
    assert tracking.saturated_percent(motor) == 50.0
