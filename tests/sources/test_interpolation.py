"""The chord test and the packet counts against streams resampled here, whose packets are known."""

from __future__ import annotations

import numpy as np
import pytest

from nanobench_tools.sources.interpolation import carries_no_packet, count_changes, count_packets


def resampled(arrives: np.ndarray, rows: np.ndarray, columns: int = 3, seed: int = 0, digits: int = 9) -> np.ndarray:
    """(n, columns): noise sent at the times ``arrives``, interpolated onto ``rows`` and printed."""
    rng = np.random.default_rng(seed)
    sent = rng.normal(size=(len(arrives), columns))
    ahead = np.clip(np.searchsorted(arrives, rows), 1, len(arrives) - 1)
    share = (rows - arrives[ahead - 1]) / (arrives[ahead] - arrives[ahead - 1])  # beyond the end: straight on
    return np.round(sent[ahead - 1] + (sent[ahead] - sent[ahead - 1]) * share[:, None], digits)


ROWS = 0.01 * np.arange(4000)


def test_flags_are_the_rows_whose_neighbours_share_their_packets():
    rng = np.random.default_rng(1)
    arrives = np.sort(rng.choice(0.01 * np.arange(4000) + 0.003, 3300, replace=False))
    arrives = np.concatenate(([-1.0], arrives, [50.0]))
    flags = carries_no_packet(ROWS, resampled(arrives, ROWS), 1e-9)
    block = np.searchsorted(arrives, ROWS)
    right = np.zeros(len(ROWS), dtype=bool)
    right[1:-1] = (block[:-2] == block[1:-1]) & (block[1:-1] == block[2:])
    np.testing.assert_array_equal(flags, right)


@pytest.mark.parametrize("loss", [0.0, 0.1, 0.25, 0.5])
@pytest.mark.parametrize("burst", [1.0, 2.0, 4.0])
def test_counts_with_losses_in_bursts(loss, burst):
    """Two-state losses (mean length ``burst``): the count is right to 10 % in the mean of draws, and in most of them.

    A single draw of few, short losses may be off by a quarter. Losses that avoid each other (every second packet
    missing) leave no straight row and cannot be counted: bursts are at least as long as those of independent losses.
    """
    errors = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        length = max(burst, 1.0 / (1.0 - loss))
        start = min(loss / length / max(1.0 - loss, 1e-9), 1.0)
        lost, state = np.zeros(4000, dtype=bool), False
        for i, u in enumerate(rng.random(4000)):
            state = u < (1.0 - 1.0 / length if state else start)
            lost[i] = state
        arrives = (0.01 * np.arange(4000) - 0.004)[~lost]
        errors.append(count_packets(ROWS, resampled(arrives, ROWS, seed=seed), 1e-9).count / len(arrives) - 1.0)
    assert abs(np.mean(errors)) < 0.10
    assert np.mean(np.abs(errors) < 0.10) >= 0.7


@pytest.mark.parametrize("rate_hz", [5.0, 9.0, 20.0])
def test_slow_streams(rate_hz):
    rng = np.random.default_rng(2)
    arrives = np.arange(-0.05, 40.2, 1.0 / rate_hz) + rng.uniform(
        -0.005, 0.005, len(np.arange(-0.05, 40.2, 1.0 / rate_hz))
    )
    assert count_packets(ROWS, resampled(arrives, ROWS, 1), 1e-9).count == pytest.approx(len(arrives), rel=0.05)


def test_straight_tail_is_no_packet_and_its_start_is_found():
    arrives = 0.01 * np.arange(1300) + 0.002
    packets = count_packets(ROWS, resampled(arrives, ROWS), 1e-9)
    assert packets.count == pytest.approx(1300, rel=0.02)
    assert packets.last_s == pytest.approx(13.0, abs=0.03)


def test_standstill_counts_with_the_rate_of_the_rest():
    arrives = 0.02 * np.arange(2001)
    values = resampled(arrives, ROWS)
    values[1000:2000] = values[1000]
    assert carries_no_packet(ROWS, values, 1e-9)[1005:1995].sum() == 0
    whole = count_packets(ROWS + 0.003, resampled(arrives, ROWS + 0.003), 1e-9).count
    assert count_packets(ROWS, np.zeros((4000, 2)), 1e-9).count == 4000
    assert whole <= 4000


def test_without_resolution_a_share_of_the_range_is_used():
    arrives = np.concatenate(([-1.0], 0.05 * np.arange(801) + 0.001))
    values = resampled(arrives, ROWS, digits=17)
    assert carries_no_packet(ROWS, values).mean() == pytest.approx(0.6, abs=0.02)


@pytest.mark.parametrize("n", [0, 1, 2])
def test_too_few_rows(n):
    assert count_packets(ROWS[:n], np.zeros((n, 2))).count == n
    assert not carries_no_packet(ROWS[:n], np.zeros((n, 2))).any()


def test_nan_and_times_that_do_not_advance_are_no_evidence():
    time_s, values = ROWS[:50].copy(), np.linspace(0.0, 1.0, 50)[:, None].copy()
    values[20], time_s[30] = np.nan, time_s[29]
    flags = carries_no_packet(time_s, values, 1e-9)
    assert not flags[[19, 20, 21, 29, 30]].any()


def test_changes_of_held_values():
    rng = np.random.default_rng(4)
    assert count_changes(np.repeat(rng.normal(size=(100, 2)), 4, axis=0)) == pytest.approx(100, rel=0.02)
    assert count_changes(rng.normal(size=(100, 1))) == 100
    assert count_changes(np.ones((100, 1))) is None
    still = np.repeat(rng.normal(size=100), 2)
    still = np.concatenate((still, np.full(200, still[-1])))[:, None]
    assert count_changes(still) == pytest.approx(200, rel=0.03)
