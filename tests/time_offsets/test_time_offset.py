"""The moving clock error on practice flights whose truth is known, and a re-timed flight's promises."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.cli.run_clocks import COMPARED_CLOCKS
from nanobench_tools.flight import Flight
from nanobench_tools.harness.audits import audit_flights
from nanobench_tools.harness.clocks import on_clock
from nanobench_tools.results.result import to_json
from nanobench_tools.signals.context import Context
from nanobench_tools.time_offsets.moving.apply import apply_time_offset, find_time_offset
from nanobench_tools.time_offsets.moving.confirm import believed
from nanobench_tools.time_offsets.moving.infer import infer
from nanobench_tools.time_offsets.moving.time_offset import TimeOffset, retime


def lateness(clock, stamps_s):
    """Inverts the stamps of the logging chain, independently of the estimator."""
    sent = np.arange(stamps_s[0] - 1.0, stamps_s[-1] + 1.0, 0.0005)
    return stamps_s - np.interp(stamps_s, sent + clock.late_s(sent), sent)


@pytest.fixture(scope="module")
def flown(crowd):
    return crowd


def recording(crowd, row, **chain):
    return crowd.log(("fast figure_eight", "medium trefoil")[row], **chain)


@pytest.mark.parametrize("row", [0, 1])
@pytest.mark.slow
def test_an_injected_sawtooth_is_recovered_and_its_interval_is_honest(flown, row):
    flight, clock = recording(flown, row, wander_sd_s=0.03, offset_s=0.02)
    time_offset = believed(Context(flight))
    assert time_offset.moving
    inside = (time_offset.time_s > 6.0) & (time_offset.time_s < 16.0)
    error = (time_offset.offset_s - lateness(clock, time_offset.time_s))[inside]
    assert np.std(lateness(clock, time_offset.time_s)[inside]) > 0.015
    assert np.sqrt(np.mean(error**2)) < 0.005
    assert np.mean(np.abs(error) < 1.96 * np.hypot(time_offset.sd_s[inside], 0.002)) > 0.85


def test_nothing_is_claimed_without_wander(flown):
    flight, _ = recording(flown, 0, offset_s=-0.03)
    time_offset = believed(Context(flight))
    assert not time_offset.moving
    assert np.ptp(time_offset.offset_s) == 0.0
    assert time_offset.constant_s == pytest.approx(-0.03, abs=0.005)
    assert "no moving error confirmed" in time_offset.reason


def test_a_later_clock_is_a_later_clock(flown):
    """Shifting every firmware stamp shifts the answer by as much."""
    flight, _ = recording(flown, 0, wander_sd_s=0.02)
    late = retime(flight, constant(-0.04))
    first, second = infer(Context(flight), ("gyro",)), infer(Context(late), ("gyro",))
    grid = np.arange(7.0, 15.0, 0.01)
    assert np.median(second.at(grid + 0.04) - first.at(grid)) == pytest.approx(0.04, abs=0.002)


def constant(offset_s):
    return TimeOffset(np.zeros(0), np.zeros(0), np.zeros(0), offset_s, 0.0, False, {}, "test")


@pytest.mark.slow
def test_retiming_keeps_samples_and_their_order(flown):
    flight, _ = recording(flown, 0, wander_sd_s=0.03)
    time_offset = believed(Context(flight))
    moved = retime(flight, time_offset)
    assert moved["mocap"] is flight["mocap"]
    for name in ("imu", "estimator", "battery"):
        assert np.array_equal(moved[name].values, flight[name].values)
        assert np.all(np.diff(moved[name].time_s) >= 0.0)
        assert moved[name].samples == flight[name].samples
    assert "re-timed" in moved.provenance.notes[-1]


def test_retiming_brings_the_estimate_closer_without_having_seen_it(flown):
    flight, _ = recording(flown, 0, wander_sd_s=0.03)
    truth = flight["mocap"]

    def error(seen):
        """Smallest over constant lags: the estimator's own delay belongs to it and stays."""
        e = seen["estimator"]
        inside = (e.time_s > 6.0) & (e.time_s < 16.0)
        p, t = e["x", "y", "z"][inside], e.time_s[inside]
        residuals = (p - truth.interpolate(("px", "py", "pz"), t - lag) for lag in np.arange(-0.04, 0.08, 0.002))
        return min(np.sqrt(np.mean(np.sum(r**2, axis=1))) for r in residuals)

    time_offset = find_time_offset(flight, "retimed", judged=("position", "velocity"))
    assert time_offset.moving
    assert error(apply_time_offset(flight, time_offset)) < 0.5 * error(flight)


def test_a_flight_that_never_moves_keeps_its_clock(flown):
    flight, _ = recording(flown, 0)
    still = {k: s.rows(s.time_s < 1.0) for k, s in flight.streams.items()}
    ground = Flight("ground", still, {}, flight.provenance)
    assert believed(Context(ground)) is None
    assert find_time_offset(ground, "offset") is None
    assert apply_time_offset(ground, find_time_offset(ground, "retimed")) is ground


@pytest.mark.slow
def test_clocks_found_with_the_audit_are_those_found_alone(flown, tmp_path):
    flights = [replace(recording(flown, row, wander_sd_s=0.03, offset_s=0.02)[0], name=name)
               for row, name in enumerate(("a", "b"))]
    alone, both = audit_flights(flights), audit_flights(flights, tmp_path, clocks=COMPARED_CLOCKS, moved={"a"})
    assert {n: a.to_json() for n, a in both.audits.items()} == {n: a.to_json() for n, a in alone.audits.items()}
    assert {name for name, _ in both.time_offsets} == {"a"}
    again = audit_flights(flights, tmp_path, clocks=COMPARED_CLOCKS, moved={"a"}).time_offsets
    assert [to_json(w) for w in again.values()] == [to_json(w) for w in both.time_offsets.values()]
    for clock, judged in COMPARED_CLOCKS:
        expected = on_clock(flights, alone.audits, clock, judged)
        given = on_clock(flights, alone.audits, clock, judged, known=both.time_offsets)
        found, wanted = (to_json(x.time_offsets) for x in (given, expected))
        assert found == wanted
        assert given.time_offsets["a"] is not None
        assert given.evidence == expected.evidence
