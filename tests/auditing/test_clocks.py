"""Offsets, drift and wander of clocks, against signals made for it and against practice flights with known clocks."""

import numpy as np
import pytest

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.practice import LoggingChain
from nanobench_tools.practice.clock import draw_clock
from nanobench_tools.practice.inject import INJECTIONS
from nanobench_tools.signals.context import Context
from nanobench_tools.time_offsets.constant.drift_and_wander import moving_clocks
from nanobench_tools.time_offsets.constant.readings import read_clocks
from nanobench_tools.time_offsets.mathematics.lag_windows import KEPT
from nanobench_tools.time_offsets.mathematics.lags import best_lag, lag_sums

STEP = 0.01


def signals(rng, delay_s, n=3000, noise=0.0, matrix=None):
    """Sums of sines from 0.3 to 6 Hz, three axes, and the same turned and ``delay_s`` later, exactly."""
    t = np.arange(n) * STEP
    frequency, phase, size = (
        rng.uniform(0.3, 6.0, (40, 3)),
        rng.uniform(0, 2 * np.pi, (40, 3)),
        rng.normal(size=(40, 3)),
    )

    def at(t):
        return np.sum(size * np.sin(2 * np.pi * frequency * t[:, None, None] + phase), axis=1)

    matrix = np.eye(3) if matrix is None else matrix
    return at(t - delay_s) @ matrix.T + noise * rng.normal(size=(n, 3)), at(t)


@pytest.mark.parametrize("delay_ms", [-123.4, -10.0, 0.0, 3.3, 47.9, 100.0])
@pytest.mark.parametrize("free", [True, False])
def test_lag_without_noise_is_exact(delay_ms, free):
    late, reference = signals(np.random.default_rng(1), 1e-3 * delay_ms)
    lag = best_lag(lag_sums(late, reference, np.ones(len(late), bool), STEP), free)
    assert lag.offset_s == pytest.approx(1e-3 * delay_ms, abs=1e-4)
    assert lag.explained.min() > 0.9999


def test_a_turned_mirrored_scaled_sensor_has_the_same_lag():
    turn = np.array([[0.0, -2.0, 0.1], [0.9, 0.05, 0.0], [0.0, 0.1, -57.3]])
    late, reference = signals(np.random.default_rng(2), 0.0314, matrix=turn)
    lag = best_lag(lag_sums(late, reference, np.ones(len(late), bool), STEP))
    assert lag.offset_s == pytest.approx(0.0314, abs=1e-4)
    np.testing.assert_allclose(lag.matrix, turn, atol=0.05 * 57.3)


@pytest.mark.slow
def test_intervals_of_the_lag_cover():
    rng = np.random.default_rng(3)
    inside, widths = 0, []
    for _ in range(50):
        delay = rng.uniform(-0.1, 0.1)
        late, reference = signals(rng, delay, noise=3.0)
        lag = best_lag(lag_sums(late, reference, np.ones(len(late), bool), STEP))
        inside += abs(lag.offset_s - delay) < lag.half_width_s
        widths.append(lag.half_width_s)
    assert inside >= 45
    assert np.median(widths) < 0.005


def test_rows_left_out_do_not_matter():
    late, reference = signals(np.random.default_rng(4), 0.02)
    use = np.ones(len(late), bool)
    use[700:1100] = False
    broken = late.copy()
    broken[700:1100] = 1e3
    assert best_lag(lag_sums(broken, reference, use, STEP)).offset_s == pytest.approx(0.02, abs=1e-4)
    assert lag_sums(late, reference, np.zeros(len(late), bool), STEP) is None


@pytest.mark.slow
def test_offsets_put_into_practice_flights_come_back(flights):
    rng = np.random.default_rng(5)
    errors, inside, n = [], 0, 0
    for flight in flights:
        offset = float(rng.uniform(-0.1, 0.1))
        late, _ = INJECTIONS["clock_offset"].function(flight, rng, offset)
        reading = read_clocks(Context(late))["imu"]  # what an audit repeats
        if not reading.identifiable:
            assert flight.metadata["family"] == "linear_ramp"
            assert "rotation" in reading.reason
            continue
        errors.append(abs(reading.offset_s - offset))
        inside += reading.ci95_s[0] <= offset <= reading.ci95_s[1]
        n += 1
    assert n >= 25
    assert np.median(errors) < 0.002
    assert np.max(errors) < 0.01
    assert inside >= 0.8 * n  # 95 % in benchmarks/studies/audit_power.py, where there are more


@pytest.mark.slow
def test_the_whole_link_is_late_or_one_stream_is(flights):
    flight = next(f for f in flights if f.metadata["family"] == "star")
    rng = np.random.default_rng(6)
    link, _ = INJECTIONS["clock_offset"].function(flight, rng, 0.06)
    result = audit(link)
    for name in ("imu", "estimator", "attitude", "attitude_qw"):
        assert result.clock[name].offset_s == pytest.approx(0.06, abs=0.003)
    assert {f.stream for f in result.faults if f.kind == "clock_offset"} >= {
        "imu",
        "estimator",
        "attitude",
        "attitude_qw",
    }
    for name in ("motor", "pid", "setpoint", "battery"):
        assert not result.clock[name].identifiable
        assert result.clock[name].reason
    alone, _ = INJECTIONS["clock_offset"].function(flight, rng, 0.12, stream="estimator")
    result = audit(alone)
    assert [f.stream for f in result.faults if f.kind == "clock_offset"] == ["estimator"]
    low, high = result.clock["estimator"].ci95_s
    assert low < 0.12 < high
    assert abs(result.clock["imu"].offset_s) < 0.002


@pytest.mark.slow
def test_an_estimators_own_delay_is_not_a_clock_fault(audited_flights):
    """Practice estimates follow by 5-20 ms, and more in what is logged late in a tick."""
    for flight, result in audited_flights:
        assert not [f for f in result.faults if f.kind == "clock_offset"]
        reading = result.clock["estimator"]
        if reading.identifiable and flight.metadata["family"] != "linear_ramp":
            assert "follow" in reading.reason
            assert abs(reading.offset_s) < 0.005


@pytest.mark.slow
def test_drift_and_wander_are_told_apart(flights):
    flight = next(f for f in flights if f.metadata["family"] == "trefoil")
    rng = np.random.default_rng(7)
    drifting, _ = INJECTIONS["clock_drift"].function(flight, rng, 0.003)
    kinds = {f.kind for f in audit(drifting).faults}
    assert "clock_drift" in kinds
    assert "clock_wander" not in kinds
    wandering, _ = INJECTIONS["clock_wander"].function(flight, rng, 0.03)
    result = audit(wandering)
    kinds = {f.kind for f in result.faults}
    assert "clock_wander" in kinds
    assert "clock_drift" not in kinds
    assert result.clock["imu"].wander_sd_s == pytest.approx(0.03, rel=0.4)


@pytest.mark.slow
def test_wander_made_by_the_chain_is_the_links(recorded):
    streams = {f.stream for f in audit(recorded(LoggingChain(wander_sd_s=0.033))).faults if f.kind == "clock_wander"}
    assert {"imu", "estimator"} <= streams


def test_an_offset_made_by_the_chain_comes_back(recorded):
    reading = audit(recorded(LoggingChain(offset_s=-0.042))).clock["imu"]
    assert reading.offset_s == pytest.approx(-0.042, abs=0.001)


def test_half_seconds_keep_of_a_fast_wander_what_its_smallest_size_allows_for():
    """Against the sawtooth itself: standard deviation of its means over half seconds."""
    kept = []
    for seed in range(20):
        late = draw_clock(np.random.default_rng(seed), 40.0, wander_sd_s=0.03).late_s(np.arange(0.0, 40.0, STEP))
        kept.append(late.reshape(-1, 50).mean(axis=1).std() / late.std())
    assert np.mean(kept) == pytest.approx(KEPT, abs=0.06)


@pytest.mark.parametrize("size", [0.01, pytest.param(0.03, marks=pytest.mark.slow), 0.06,
                                  pytest.param(0.1, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_a_wander_is_found_or_below_what_is_stated(flights, size):
    """Flights too slow for the track are told by half seconds alone, to which a fast wander is noise, too."""
    for i, flight in enumerate(flights[3::8]):  # linear ramps, most of which hover
        bad, _ = INJECTIONS["clock_wander"].function(flight, np.random.default_rng(i), size)
        clocks = Context(bad).once(moving_clocks).values()
        assert any(c.wanders for c in clocks) or all(c.detectable_wander_s > size for c in clocks)


def test_a_reference_that_stands_still_gives_no_lag():
    """A tracked attitude that never changes says nothing about anybody's clock."""
    moving = np.random.default_rng(0).standard_normal((2000, 3))
    use = np.ones(2000, bool)
    assert lag_sums(moving, moving, use, 0.005) is not None
    assert lag_sums(moving, np.ones((2000, 3)), use, 0.005) is None
    assert lag_sums(np.zeros((2000, 3)), moving, use, 0.005) is None
