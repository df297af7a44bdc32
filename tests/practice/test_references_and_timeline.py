"""Paths against finite differences, their own speed and the recorded setpoints; the timeline."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from nanobench_tools.errors import UsageError
from nanobench_tools.practice.references import FAMILIES, RECORDED, path_spec
from nanobench_tools.practice.timeline import HOVER, LANDING, OFF, PATH, TAKEOFF, Timeline, draw_events
from nanobench_tools.sources.discover import find_recordings, read

CORNERED = {"star", "linear_ramp", "staircase_climb", "random_waypoints"}
STEADY = ("circle", "figure_eight", "helix", "lissajous", "oval", "star", "trefoil")


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("speed", ["slow", "fast"])
def test_velocity_acceleration_and_jerk_are_the_derivatives(family, speed):
    spec = path_spec(family, speed)
    t = np.linspace(0.1, 8.9, 400)
    h = 1e-5
    here, before, after = (spec.at(t + d) for d in (0.0, -h, h))
    velocity = (after.position_m - before.position_m) / (2 * h)
    acceleration = (after.velocity_m_s - before.velocity_m_s) / (2 * h)
    jerk = (after.acceleration_m_s2 - before.acceleration_m_s2) / (2 * h)
    smooth = np.abs(velocity - here.velocity_m_s).max(axis=1) < 1e-6
    assert smooth.all() or (family in CORNERED and smooth.mean() > 0.97)
    np.testing.assert_allclose(acceleration[smooth], here.acceleration_m_s2[smooth], atol=1e-5)
    np.testing.assert_allclose(jerk[smooth], here.jerk_m_s3[smooth], atol=1e-4)


def test_heading_and_its_rate():
    spec = replace(path_spec("circle", "slow"), turn=(0.7, 5.0))
    t, h = np.linspace(0.0, 10.0, 101), 1e-6
    np.testing.assert_allclose((spec.yaw_at(t + h) - spec.yaw_at(t - h)) / (2 * h), spec.yaw_rate_at(t), atol=1e-6)
    told = spec.reference(t)
    np.testing.assert_array_equal(told.yaw_rad, spec.yaw_at(t))
    np.testing.assert_array_equal(told.jerk_m_s3, spec.at(t).jerk_m_s3)


def test_paths_of_which_only_sheets_are_public_keep_to_their_sheets():
    t = np.arange(0.0, 60.0, 0.01)
    stairs = path_spec("staircase_climb").at(t)
    assert stairs.position_m.max(axis=0) == pytest.approx([1.5, 0.0, 1.4])
    assert stairs.position_m.min(axis=0) == pytest.approx([0.0, 0.0, 0.5])
    assert np.linalg.norm(stairs.velocity_m_s, axis=1).max() == pytest.approx(0.3)
    way = path_spec("random_waypoints")
    way_m = way.at(t).position_m
    assert np.all(way_m >= [-1.0, -1.7, 0.7])
    assert np.all(way_m <= [2.0, 1.0, 1.5])
    np.testing.assert_array_equal(way_m[0], [0.0, 0.0, 1.1])
    sines = path_spec("multisine_sysid").at(t)
    assert np.abs(sines.position_m - [0.0, 0.0, 1.1]).max(axis=0) == pytest.approx([0.8, 0.8, 0.35], rel=0.01)
    spectrum = np.abs(np.fft.rfft(sines.position_m[1000:4000], axis=0))  # 30 s without a fade
    tones = spectrum > 1e-8 * spectrum[1:].max(axis=0)
    assert tones[1:].sum(axis=0).tolist() == [15, 15, 15]
    assert tones[1:].sum(axis=1).max() == 1
    assert np.flatnonzero(tones[1:].any(axis=1))[[0, -1]] + 1 == pytest.approx([3, 150])
    assert not path_spec("hover_until_landing").at(t).velocity_m_s.any()


@pytest.mark.parametrize("family", STEADY)
def test_mean_speed_over_many_laps_is_the_one_asked_for(family):
    spec = path_spec(family, "medium", speed_m_s=0.8)
    speed = np.linalg.norm(spec.at(np.linspace(0.0, 400.0, 200_000)).velocity_m_s, axis=1)
    assert speed.mean() == pytest.approx(0.8, rel=0.09)  # rounded lap lengths of the published ones: 8 %


@pytest.mark.real
@pytest.mark.parametrize("speeds", ["one", pytest.param("all", marks=pytest.mark.slow)])
def test_paths_are_those_of_the_recorded_setpoints(real_data, speeds):
    chosen = {}
    for recording in find_recordings([real_data / "nanobench" / "datasets"])[0]:
        chosen.setdefault(recording.name.rsplit("_rep")[0], recording)
    families = set()
    for name, recording in chosen.items():
        if speeds == "one" and any(family in name for family in families):
            continue
        flight = read(recording)
        if flight.metadata.get("family") not in RECORDED or "params" not in flight.metadata:
            continue
        if flight.span.duration_s < 20.0:
            continue
        spec = path_spec(flight.metadata["family"], flight.metadata["speed"] or "slow", **flight.metadata["params"])
        setpoint = flight["setpoint"]
        rows = (setpoint.time_s > 7.0) & (setpoint.time_s < 5.0 + min(spec.duration_s, 12.0))
        t, told = setpoint.time_s[rows], setpoint["x", "y", "z"][rows]
        # the start is not in the sheet, and the vehicle's clock wanders by 0.03 s and more: along the path the middle
        # error is judged, across it what no shift of time explains
        grid = 7.0 + np.arange(-2.0, 12.0, 0.004)
        path = spec.at(grid - 5.3).position_m
        errors = [np.median(np.linalg.norm(spec.at(t - start).position_m - told, axis=1))
                  for start in np.arange(5.3, 6.0, 0.02)]
        assert min(errors) < 0.05, name
        across = cKDTree(path).query(told)[0]
        assert np.median(across) < 0.003, name
        families.add(spec.family)
    assert families == set(RECORDED)


@pytest.mark.parametrize(("call", "says"), [
    ({"family": "spiral"}, "known: circle"), ({"speed": "quick"}, "known: slow, medium, fast"),
    ({"family": "circle", "scale_m": 1.0}, "circle has no parameter scale_m")])
def test_unknown_names_are_answered_with_the_known_ones(call, says):
    with pytest.raises(UsageError, match=says):
        path_spec(**call)


@pytest.mark.slow
def test_the_timeline_is_the_published_one():
    specs = [path_spec("circle", "slow", duration_s=15.0), path_spec("helix", "fast")]
    events = [draw_events(s, np.random.default_rng(i)) for i, s in enumerate(specs)]
    line = Timeline(specs, events)
    place, yaw = np.array([[0.02, 0.01, 0.06], [0.0, 0.0, 0.07]]), np.array([0.1, -0.2])
    seen = []
    heights = []
    for tick in range(line.ticks):
        armed, reference, _ = line.at(tick, place, yaw)
        seen.append(line.phase[tick].tolist())
        heights.append(reference.position_m[:, 2].tolist())
        assert np.isfinite(reference.position_m).all()
        flown = line.as_flown(tick, reference)
        for i in range(2):
            streamed = line.phase[tick, i] in (HOVER, PATH)
            assert not (streamed and flown.velocity_m_s[i].any())
            assert armed[i] == (line.phase[tick, i] != OFF)
    seen, heights, time = np.array(seen), np.array(heights), 0.01 * np.arange(line.ticks)
    for i, event in enumerate(events):
        phases = seen[:, i]
        order = [p for k, p in enumerate(phases) if k == 0 or p != phases[k - 1]]
        assert order == [OFF, TAKEOFF, HOVER, PATH, LANDING, OFF]
        assert np.sum(phases == PATH) == pytest.approx(100 * (specs[i].duration_s + 0.15), abs=2)
        hover = heights[phases == HOVER, i]
        np.testing.assert_allclose(hover, specs[i].altitude_m)
        landing = heights[phases == LANDING, i]
        assert landing[-1] == pytest.approx(0.08)
        assert np.abs(np.diff(heights[phases == TAKEOFF, i])).max() < 0.012  # 2.2/2 m/s at most
        assert time[phases != OFF][-1] < event.end_s
