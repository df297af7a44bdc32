"""Sessions are found from dates, and from nothing else."""

from types import SimpleNamespace

import numpy as np
import pytest

from nanobench_tools.metrics.statistics import UNKNOWN
from nanobench_tools.protocols.sessions import SESSION_GAP_S, Sessions, labels_of

HOUR, DAY, DATE = 3600.0, 86400.0, 1.7e9


def began(*stamps):
    return [SimpleNamespace(epoch_s=s) for s in stamps]


def test_a_session_ends_where_nothing_was_recorded_for_long():
    flights = began(DATE, DATE + HOUR, DATE + 2 * HOUR, DATE + DAY, DATE + DAY + 600.0)
    assert Sessions.of(flights).labels(flights).tolist() == [0, 0, 0, 1, 1]
    assert labels_of(flights[::-1]).tolist() == [1, 1, 0, 0, 0]


def test_a_chain_of_flights_is_one_session_however_long():
    assert set(labels_of(began(*(DATE + np.arange(20) * 0.9 * SESSION_GAP_S)))) == {0}


def test_a_flight_keeps_its_session_when_others_are_taken_away():
    flights = began(DATE, DATE + 2.5 * HOUR, DATE + 5 * HOUR)
    whole = Sessions.of(flights)
    assert set(whole.labels(flights[::2])) == {0}
    assert labels_of(flights[::2]).tolist() == [0, 1]


@pytest.mark.parametrize("stamp", [0.0, 12.34, 1e6, float("nan"), float("inf"), -DATE])
def test_a_clock_that_began_with_the_vehicle_is_no_date(stamp):
    assert labels_of(began(stamp, stamp, DATE)).tolist() == [UNKNOWN, UNKNOWN, 0]
    assert labels_of(began(stamp)).tolist() == [UNKNOWN]


def test_stamps_that_are_all_the_same_are_one_session():
    assert labels_of(began(DATE, DATE, DATE)).tolist() == [0, 0, 0]


def test_what_has_no_stamp_has_no_session():
    assert labels_of([SimpleNamespace(name="stand")]).tolist() == [UNKNOWN]
    assert Sessions().labels(began(DATE)).tolist() == [UNKNOWN]
    assert labels_of([]).tolist() == []
