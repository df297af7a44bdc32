"""What was flown, from content alone: parts of the flight, family, speed."""

from dataclasses import replace

import pytest
from made_flights import LAND_S, LIFT_S, PATH_S, cut, made_flight

from nanobench_tools.flight import Span
from nanobench_tools.protocols import phases
from nanobench_tools.sources.labels import family_of, speed_of


def test_labels_come_from_the_reader_and_never_from_the_name():
    named = replace(made_flight(), name="B9_trefoil_fast_rep1", metadata={})
    assert (family_of(named), speed_of(named)) == ("unknown", None)
    said = replace(named, metadata={"family": "circle", "speed": "slow"})
    assert (family_of(said), speed_of(said)) == ("circle", "slow")


def test_streamed_phase_of_a_known_flight():
    phase = phases.streamed_phase(made_flight())
    assert phase.start_s == pytest.approx(PATH_S + 0.05, abs=0.02)  # after the jump to the start of the circle
    assert phase.end_s == pytest.approx(LAND_S - phases.LANDING_JUMP_S, abs=0.02)


def test_streamed_phase_ends_where_the_log_stops():
    phase = phases.streamed_phase(made_flight(), [Span(0.0, 12.0)])
    assert phase.end_s == pytest.approx(12.0, abs=0.011)


def test_no_path_streamed():
    flight = made_flight()
    setpoint = flight["setpoint"]
    still = replace(setpoint, values=setpoint.values * [0, 0, 1, 1])
    assert phases.streamed_phase(flight.with_streams(setpoint=still)) is None
    assert phases.streamed_phase(flight, [Span(0.0, 0.0)]) is None


def test_a_piece_cut_to_the_flight_starts_with_motors_on():
    whole = made_flight()
    piece = cut(whole, LIFT_S + 0.5, 15.0)
    assert not phases.is_cut(whole)
    assert phases.is_cut(piece)
    spans = phases.flown_spans(piece, ())
    assert (spans[0].start_s, spans[0].end_s) == pytest.approx((0.0, piece.span.end_s))
    assert phases.flown_spans(whole, (Span(3.0, 4.0),)) == (Span(3.0, 4.0),)
