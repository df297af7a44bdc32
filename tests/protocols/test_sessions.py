"""Sessions are found from dates, and from nothing else."""

from types import SimpleNamespace

import numpy as np
import pytest

from nanobench_tools.metrics.statistics import UNKNOWN
from nanobench_tools.protocols.score_tables import summaries
from nanobench_tools.protocols.sessions import (
    SESSION_GAP_S,
    Drawn,
    Sessions,
    interval_note,
    labels_of,
    parameters_note,
)
from nanobench_tools.results.result import to_json

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


def row_of(values, labels):
    found = summaries([{"ate_rmse_m": v} for v in values], 0, labels)
    return {"n": len(values), "metrics": found, **to_json(Drawn.of(np.asarray(labels), found))}


def test_a_table_says_how_far_to_trust_its_intervals():
    """1, 3 and 5, 7 in two sessions: intra-class correlation 14 / 18, design effect 1.78, 1.3 times as wide."""
    two = row_of([1.0, 3.0, 5.0, 7.0], [0, 0, 1, 1])
    assert interval_note([two, row_of([1.0, 2.0], [0, 1])]) == (
        "95 % intervals: bootstrap of 2 sessions, then of flights within them; too narrow to trust (fewer than 5). "
        "Over flights alone they would have to be 1.3 times as wide, since flights of a session are alike (intra-class "
        "correlation 0.78; square root of the design effect).")
    assert "times as wide" not in interval_note([two], ["other_m"])
    many = interval_note([row_of(np.arange(20.0) % 3, np.arange(20) // 2)])
    assert many.startswith("95 % intervals: bootstrap of 10 sessions, then of flights within them.")
    assert interval_note([row_of([1.0, 2.0], [3, 3])]).startswith("No 95 % interval: one session")
    assert interval_note([row_of([1.0], [3])]) == "No 95 % interval: one flight."
    assert interval_note([row_of([1.0, 2.0], [-1, -1])]).startswith("95 % intervals: sessions unknown")
    assert interval_note([{"n": 3}]) == ""


def test_parameters_say_what_was_drawn():
    assert parameters_note(np.array([0, 0, 0, 1])) == (
        "Intervals of parameters draw 2 sessions, then flights within them (4 training flights, 3 of one session); 2 "
        "sessions: too narrow to trust.")
    assert parameters_note(np.arange(6)).endswith("(6 training flights, 1 of one session).")
    assert parameters_note(np.array([0, 0])).startswith("No interval of parameters: 2 training flights of one session")
    assert "sessions are unknown" in parameters_note(np.array([0, -1]))
    assert parameters_note(np.array([0])) == ""


@pytest.mark.slow
def test_the_sessions_of_the_real_recordings(real):
    """Four by their dates; what a vehicle's own clock stamps has none."""
    flights, _ = real
    labels = labels_of(flights)
    assert np.bincount(labels).tolist() == [18, 4, 39, 41]
    stamps = np.sort([f.epoch_s for f in flights])
    gaps = np.sort(np.diff(stamps))
    assert gaps[-4] < SESSION_GAP_S / 2.4 < gaps[-3] > 1.6 * SESSION_GAP_S  # any limit between finds the same
