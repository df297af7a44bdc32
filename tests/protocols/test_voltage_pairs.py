"""Flights in pairs of equal voltage: who is paired with whom, and the ratio of their errors."""

import numpy as np
import pytest
from made_flights import LAND_S, PATH_S, made_flight

from nanobench_tools.flight import Span, make_stream
from nanobench_tools.protocols.task2 import Case, Tracked
from nanobench_tools.protocols.voltage_pairs import METRICS, mean_voltage, voltage_pairs


def scored(name, controller, volt, rmse, speed="slow", protocol="clean"):
    flight = made_flight(name, speed=speed)
    t = np.array([0.0, 10.0, 12.0, 25.0])
    battery = make_stream("battery", t, [[4.2], [volt - 0.01], [volt + 0.01], [4.2]], ("vbat",))
    spans = (Span(PATH_S, LAND_S),) if protocol == "clean" else ()
    return (Case(flight.with_streams(battery=battery), controller, protocol, spans, "circle", speed),
            Tracked(100, dict.fromkeys(METRICS, rmse) | {"heading_deg": None}))


def test_the_voltage_is_that_of_the_scored_spans():
    assert mean_voltage(scored("a", "pid", 3.7, 0.1)[0]) == pytest.approx(3.7)


def test_flights_of_equal_voltage_are_paired_once():
    flights = [scored("a", "pid", 3.70, 0.2), scored("b", "pid", 3.90, 0.4), scored("c", "pid", 3.30, 9.0),
               scored("d", "mellinger", 3.74, 0.1), scored("e", "mellinger", 3.86, 0.2),
               scored("f", "mellinger", 3.745, 5.0), scored("g", "mellinger", 3.70, 1.0, speed="fast")]
    (found,) = voltage_pairs(flights)
    assert (found.controller, found.over, found.n, found.speed) == ("mellinger", "pid", 2, "slow")
    assert [pair[:2] for pair in found.pairs] == [("d", "a"), ("e", "b")]
    assert found.ratios["rmse_m"].ratio == pytest.approx(0.5)
    assert found.ratios["heading_deg"].ratio is None
    assert all(abs(a - b) <= 0.05 for *_, a, b in found.pairs)


def test_as_many_pairs_as_there_can_be():
    """The nearest partner of b is d, with which a would be left alone."""
    (found,) = voltage_pairs([scored("a", "pid", 3.70, 0.2), scored("b", "pid", 3.73, 0.2),
                              scored("d", "mellinger", 3.735, 0.1), scored("e", "mellinger", 3.77, 0.1)])
    assert [pair[:2] for pair in found.pairs] == [("d", "a"), ("e", "b")]


def test_without_pairs_there_is_no_row():
    assert voltage_pairs([scored("a", "pid", 3.7, 0.2), scored("b", "mellinger", 3.8, 0.2)]) == []
    assert voltage_pairs([scored("a", "pid", 3.7, 0.2, protocol="as-published"),
                          scored("b", "mellinger", 3.7, 0.2, protocol="as-published")]) == []
    assert voltage_pairs([scored("a", "pid", 3.7, 0.2), scored("b", "pid", 3.7, 0.2)]) == []
