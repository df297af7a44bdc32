"""What was flown, from content alone: parts of the flight, family, speed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_flights import LAND_S, LIFT_S, PATH_S, cut, made_flight

from nanobench_tools.flight import Flight, Provenance, Span, make_stream
from nanobench_tools.protocols import phases
from nanobench_tools.protocols.describe import family_from_path, family_of, speed_from_path, speed_of

SHAPES = {
    "circle": lambda a: (np.cos(a), np.sin(a)),
    "oval": lambda a: (np.cos(a), 0.4 * np.sin(a)),
    "figure_eight": lambda a: (np.sin(a), 0.5 * np.sin(2 * a)),
    "trefoil": lambda a: ((np.sin(a) + 2 * np.sin(2 * a)) / 3, (np.cos(a) - 2 * np.cos(2 * a)) / 3),
    "lissajous": lambda a: (np.sin(3 * a + 0.5), np.sin(2 * a)),
    "linear_ramp": lambda a: (np.abs((a / 6.0) % 2.0 - 1.0), 0.0 * a),
}


def flown(shape, speed_m_s=0.5, duration_s=30.0, turn=0.0, climb_m=0.0, seed=0):
    """A flight along a shape at constant speed, turned about z, with tracking noise; hover before and after."""
    dense = np.linspace(0, 40 * np.pi, 200_000)
    curve = np.stack(shape(dense), axis=1)
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    t = np.arange(0, duration_s + 6, 0.01)
    travelled = speed_m_s * np.clip(t - 3, 0, duration_s)
    xy = np.stack([np.interp(travelled, length, column) for column in curve.T], axis=1)
    c, s = np.cos(turn), np.sin(turn)
    position = np.column_stack([xy @ np.array([[c, s], [-s, c]]), 1 + climb_m * travelled / travelled[-1]])
    position += 2e-4 * np.random.default_rng(seed).normal(size=position.shape)
    mocap = make_stream("mocap", t, position, ("px", "py", "pz"))
    return Flight("f", {"mocap": mocap}, {}, Provenance("f", "", "made"))


@pytest.mark.parametrize("family", SHAPES)
@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_families_are_told_by_their_path(family, turn):
    assert family_from_path(flown(SHAPES[family], 0.6 if family != "linear_ramp" else 0.3, turn=turn)) == family


def test_a_climbing_circle_is_a_helix():
    assert family_from_path(flown(SHAPES["circle"], climb_m=1.0)) == "helix"


def test_a_star_is_told_by_its_path():
    corners = np.exp(2j * np.pi * 2 * np.arange(6) / 5)

    def star(a):
        p = np.interp(a / (2 * np.pi) % 1.0 * 5, np.arange(6), corners.real)
        return p, np.interp(a / (2 * np.pi) % 1.0 * 5, np.arange(6), corners.imag)

    assert family_from_path(flown(star, 0.7)) == "star"


def test_a_random_walk_is_unknown():
    steps = np.random.default_rng(3).normal(size=(4000, 3)).cumsum(axis=0) * 0.02
    walk = Flight("f", {"mocap": make_stream("mocap", np.arange(4000) * 0.01, steps, ("px", "py", "pz"))}, {},
                  Provenance("f", "", "made"))
    assert family_from_path(walk) == "unknown"


@pytest.mark.parametrize(("speed", "duration", "expected"), [
    (0.5, 30.0, "slow"), (0.75, 30.0, "medium"), (1.0, 15.0, "fast")])
def test_speeds(speed, duration, expected):
    assert speed_from_path(flown(SHAPES["oval"], speed, duration)) == expected


def test_medium_trefoils_fly_as_slow_as_slow_ones_but_longer():
    assert speed_from_path(flown(SHAPES["trefoil"], 0.5, 30.0)) == "medium"
    assert speed_from_path(flown(SHAPES["trefoil"], 0.5, 15.0)) == "slow"


def test_the_sheet_goes_first_and_the_name_never_counts():
    flight = flown(SHAPES["circle"])
    named = replace(flight, name="B9_trefoil_fast_rep1")
    assert (family_of(named), speed_of(named)) == ("circle", "slow")
    said = replace(flight, metadata={"family": "trefoil", "speed": "fast"})
    assert (family_of(said), speed_of(said)) == ("trefoil", "fast")
    assert speed_of(replace(flight, metadata={"family": "linear_ramp", "speed": None})) is None


@settings(max_examples=20, deadline=None)
@given(st.floats(0, 6.3), st.sampled_from(["circle", "trefoil", "figure_eight"]))
def test_turning_the_world_does_not_change_the_family(turn, family):
    assert family_from_path(flown(SHAPES[family], 0.8, 20.0, turn)) == family


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


@pytest.mark.real
def test_real_paths_agree_with_their_sheets(real):
    flights, _ = real
    for flight in flights:
        said = flight.metadata.get("family")
        found = family_from_path(flight)
        if said is None:
            assert (found, speed_from_path(flight)) == ("helix", "fast")  # a piece whose whole is not in the data
        elif flight.span.end_s > 5.0:
            assert found == said, flight.name
            if flight.metadata.get("speed"):
                assert speed_from_path(flight) == flight.metadata["speed"], flight.name
