"""Recordings broken at random: every audit ends in a verdict that is JSON, without a warning, and says what it saw."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from one_kind import faults_of

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Span


def broken(flight, rng):
    """One to three random injuries; streams may end up empty, gigantic, shuffled, unnamed or gone."""
    for _ in range(rng.integers(1, 4)):
        name = list(flight.streams)[rng.integers(len(flight.streams))]
        s = flight[name]
        v, t, n = s.values.copy(), s.time_s.copy(), len(s)
        if n < 2:
            continue
        a = int(rng.integers(0, n))
        b = min(n, a + int(rng.integers(1, n)))
        k = int(rng.integers(v.shape[1]))
        injury = int(rng.integers(0, 14))
        if injury == 0:
            v[a:b] = np.nan
        elif injury == 1:
            v[a:b, k] = np.inf
        elif injury == 2:
            v[a, k] = 1e300
        elif injury == 3:
            v *= 1e12
        elif injury == 4:
            t[a:b] = t[a:b][::-1]
        elif injury == 5:
            t[a:b] = t[a]
        elif injury == 6:
            v[:] = 0.0
        elif injury == 7:
            flight = flight.without_streams(name)
            continue
        elif injury == 8:
            flight = flight.during(Span(0.0, float(rng.uniform(0.0, 6.0))))
            continue
        elif injury == 9:
            t = t * 1000.0
        elif injury == 10:
            t = t[rng.permutation(n)]
        elif injury == 11:
            s = replace(s, values=v[:, :1], columns=s.columns[:1], quantities=s.quantities[:1], unit=s.unit[:1])
            v = s.values
        elif injury == 12:
            t[a:b] = np.nan
        else:
            v = v + rng.normal(size=v.shape) * 10 ** rng.uniform(-6, 6)
        flight = flight.with_streams(**{name: replace(s, values=v, time_s=t)})
    return flight


@pytest.mark.parametrize("block", [0, *(pytest.param(block, marks=pytest.mark.slow) for block in range(1, 7))])
def test_any_flight_gets_a_verdict(flights, block):
    for seed in range(block * 5, block * 5 + 5):
        rng = np.random.default_rng([seed, 4])
        flight = broken(flights[seed % len(flights)], rng)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            verdict = audit(flight)
        json.dumps(verdict.to_json(), allow_nan=False)
        assert all(f.start_s <= f.end_s and f.evidence for f in verdict.faults)


COLUMNS = [("imu", "acc_x"), ("battery", "vbat"), ("mocap", "py"), ("motor", "m2")]
WRONG = [np.nan, np.inf, -1e300]


@pytest.mark.parametrize(("stream", "column", "value"), [
    pytest.param(*column, value, marks=() if i % len(WRONG) == k else pytest.mark.slow)  # one value a column is quick
    for i, column in enumerate(COLUMNS) for k, value in enumerate(WRONG)])
def test_no_wrong_number_is_passed_over(flights, stream, column, value):
    s = flights[0][stream]
    values = s.values.copy()
    values[700, s.index(column)] = value
    verdict = audit(flights[0].with_streams(**{stream: replace(s, values=values)}))
    (fault,) = [f for f in verdict.faults if f.kind == "bad_cell"]
    assert (fault.stream, fault.columns) == (stream, (s.columns[s.index(column)],))
    assert fault.start_s <= s.time_s[700] <= fault.end_s
    assert not any(span.start_s < s.time_s[700] < span.end_s for span in verdict.clean_for([stream]))


def test_stamps_in_milliseconds_are_told(flights):
    flight = flights[0].during(Span(4.0, 8.0))  # a thousand times as long for the audit
    slow = {name: replace(s, time_s=1000.0 * s.time_s) for name, s in flight.streams.items()}
    assert [(f.columns, f.size) for f in faults_of(replace(flight, streams=slow), "unit")] == [(("t",), 1000.0)]


@pytest.mark.parametrize(("rows", "kind"), [(slice(400, 700), "mocap_occlusion"), (slice(None), "missing_column")])
def test_quaternions_of_four_zeros_are_no_attitude(crowd, rows, kind):
    """What a tracker, or a log of positions alone, writes where it has none."""
    flight = crowd.flight("short circle")
    mocap = flight["mocap"]
    values = mocap.values.copy()
    values[rows, [[mocap.index(q)] for q in ("qx", "qy", "qz", "qw")]] = 0.0
    found = audit(flight.with_streams(mocap=replace(mocap, values=values)))
    assert kind in {f.kind for f in found.faults if f.stream == "mocap"}
