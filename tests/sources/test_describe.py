"""Family and speed from content, on references written down here and never on a name."""

from __future__ import annotations

import numpy as np
import pytest

from nanobench_tools import Flight, Provenance, make_stream
from nanobench_tools.sources.describe import describe

T = 0.01 * np.arange(4000)


def flown(position, duration_s=30.0, height=None):
    """A recording: 2 s on the ground, hover at 1 m from 4 s, the curve from 6 s, then down; stamps late by 0-40 ms."""
    curve = position(np.clip(T - 6.0 - 0.02 * (1.0 + np.sin(1.7 * T)), 0.0, duration_s))
    during = (T >= 6.0) & (6.0 + duration_s > T)
    hover = np.where(T < 2.0, 0.0, np.clip((T - 2.0) / 2.0, 0.0, 1.0))
    end = curve[np.searchsorted(T, 6.0 + duration_s) - 1]
    down = np.clip(1.0 - (T - 6.0 - duration_s) / 2.0, 0.0, 1.0)
    setpoint = np.where(during[:, None], curve, np.stack([0 * T, 0 * T, hover], axis=1))
    after = 6.0 + duration_s <= T
    setpoint[after] = np.stack([0 * T + end[0], 0 * T + end[1], end[2] * down], axis=1)[after]
    motion = make_stream(
        "mocap", T, setpoint if height is None else np.column_stack((setpoint[:, :2], height)), ("px", "py", "pz")
    )
    return Flight(
        "x",
        {"mocap": motion, "setpoint": make_stream("setpoint", T, setpoint, ("x", "y", "z"))},
        {},
        Provenance("x", "", "test"),
    )


def ellipse(a, b, speed, climb=0.0):
    w = speed / np.sqrt((a * a + b * b) / 2)
    return lambda t: np.stack([a * np.cos(w * t), b * np.sin(w * t), 1.0 + climb * (t - 15.0)], axis=1)


def trefoil(w):
    return lambda t: np.stack(
        [
            (np.sin(w * t) + 2 * np.sin(2 * w * t)) / 3,
            (np.cos(w * t) - 2 * np.cos(2 * w * t)) / 3,
            1.0 - 0.15 * np.sin(3 * w * t),
        ],
        axis=1,
    )


def star(speed, r=1.0):
    corner = r * np.stack([np.cos(4 * np.pi / 5 * np.arange(6)), np.sin(4 * np.pi / 5 * np.arange(6))], axis=1)
    length = np.linalg.norm(corner[1] - corner[0])

    def at(t):
        s = (t * speed / length) % 5.0
        i = np.minimum(s.astype(int), 4)
        xy = corner[i] + (corner[i + 1] - corner[i]) * (s - i)[:, None]
        return np.column_stack((xy, np.ones_like(t)))

    return at


def figure_eight(w):
    return lambda t: np.stack([np.sin(w * t), 0.5 * np.sin(2 * w * t), np.ones_like(t)], axis=1)


def lissajous(w):
    return lambda t: np.stack([0.6 * np.sin(3 * w * t + np.pi / 2), 0.6 * np.sin(2 * w * t), np.ones_like(t)], axis=1)


def ramp(t):
    x = np.abs((t / 10.0) % 2.0 - 1.0)
    return np.stack([x, 0 * x, 1.0 + 0 * x], axis=1)


@pytest.mark.parametrize(
    ("curve", "family", "speed"),
    [
        (ellipse(1.0, 1.0, 0.5), "circle", "slow"),
        (ellipse(1.0, 1.0, 1.0), "circle", "fast"),
        (ellipse(1.0, 0.4, 0.75), "oval", "medium"),
        (ellipse(1.0, 1.0, 0.75, climb=0.033), "helix", "medium"),
        (trefoil(0.738), "trefoil", "fast"),
        (trefoil(0.369), "trefoil", "medium"),
        (star(0.5), "star", "slow"),
        (star(1.0), "star", "fast"),
        (star(0.75, 0.6), "star", "medium"),
        (figure_eight(0.55), "figure_eight", "slow"),
        (lissajous(0.686), "lissajous", "fast"),
        (ramp, "linear_ramp", None),
    ],
)
def test_families(curve, family, speed):
    found = describe(flown(curve))
    assert (found["family"], found["speed"]) == (family, speed)


def test_slow_and_medium_trefoil_differ_in_length():
    assert describe(flown(trefoil(0.369), 15.0))["speed"] == "slow"


def test_turned_world_and_shifted_clock_change_nothing():
    def turned(t):
        p = trefoil(0.369)(t)
        return np.stack([-p[:, 1] + 0.3, p[:, 0], p[:, 2]], axis=1)

    assert describe(flown(turned))["family"] == "trefoil"


@pytest.mark.parametrize("seed", range(12))
def test_what_is_no_family_gets_no_name(seed):
    """Random waypoints, stairs and hovering."""
    rng = np.random.default_rng(seed)
    corners = np.cumsum(rng.uniform(-0.8, 0.8, (12, 3)), axis=0) * [1, 1, 0.1] + [0, 0, 1]
    knots = np.sort(rng.uniform(0, 30, 12))
    kinds = [
        lambda t: np.stack([np.interp(t, knots, c) for c in corners.T], axis=1),
        lambda t: np.stack([0 * t, 0 * t, 0.5 + 0.3 * (t // 5)], axis=1),
        lambda t: np.stack([0 * t, 0 * t, 1 + 0 * t], axis=1),
        lambda t: np.stack([np.sin(0.7 * t) + 0.6 * np.sin(5.1 * t), np.cos(1.3 * t), 1 + 0 * t], axis=1),
    ]
    assert describe(flown(kinds[seed % 4]))["family"] is None


def test_without_setpoints_nothing_is_said():
    flight = flown(ramp)
    assert describe(flight.without_streams("setpoint"))["family"] is None
