"""Gaps of the radio, read from the rows that no packet carried."""

from dataclasses import replace

import numpy as np
import pytest
from made_flights import made_flight

from nanobench_tools.signals.radio_gaps import drawn, radio_gaps


def noisy(flight, keep=None):
    """IMU rows with noise of their own; ``keep`` (n,) bool: those that packets carry, the others on straight lines."""
    imu = flight["imu"]
    t = 0.01 * np.arange(len(imu))
    values = imu.values + np.random.default_rng(4).normal(0.0, 0.01, imu.values.shape)
    if keep is not None:
        values = np.stack([np.interp(t, t[keep], column[keep]) for column in values.T], axis=1)
    return flight.without_streams("motor").with_streams(imu=replace(imu, time_s=t, values=values)), t


@pytest.fixture(scope="module")
def flight():
    return made_flight()


def test_where_every_row_is_a_packet_there_is_no_gap(flight):
    made, _ = noisy(flight)
    assert not drawn(made).any()
    assert radio_gaps(made) == []


def test_a_gap_lasts_from_the_last_packet_before_it_to_the_first_after_it(flight):
    keep = np.ones(len(flight["imu"]), bool)
    keep[101:106] = keep[300] = False
    made, t = noisy(flight, keep)
    assert [(s.start_s, s.end_s) for s in radio_gaps(made)] == [(t[100], t[106]), (t[299], t[301])]


def test_a_log_of_half_the_rate_has_no_gaps_but_longer_ones(flight):
    keep = np.arange(len(flight["imu"])) % 2 == 0
    made, _ = noisy(flight, keep)
    assert radio_gaps(made) == []
    keep[201:210] = False
    made, t = noisy(flight, keep)
    assert [(s.start_s, s.end_s) for s in radio_gaps(made)] == [(t[200], t[210])]


def test_without_an_imu_nothing_is_known(flight):
    assert radio_gaps(flight.without_streams("imu")) == []
