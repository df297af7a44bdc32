"""A jump of the motion capture takes away the whole displaced stretch, and what is left stands in one frame."""

from dataclasses import replace

import numpy as np
import pytest
from one_kind import faults_of

from nanobench_tools import so3
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.signals.airborne import airborne_spans
from nanobench_tools.signals.context import Context
from nanobench_tools.signals.step_removal import levelled

WAY = np.array([0.2, -0.2, 0.1])  # 0.3 m
POSITION, ROTATION = ["px", "py", "pz"], ["qx", "qy", "qz", "qw"]


def moved(flight, start_s, end_s, offset=WAY, turn=None):
    s = flight["mocap"]
    values = s.values.copy()
    rows = np.flatnonzero((s.time_s >= start_s) & (s.time_s < end_s))
    values[np.ix_(rows, [s.index(q) for q in POSITION])] += offset
    if turn is not None:
        columns = [s.index(q) for q in ROTATION]
        values[np.ix_(rows, columns)] = so3.multiply(values[np.ix_(rows, columns)], so3.exp(np.array(turn)))
    return flight.with_streams(mocap=replace(s, values=values))


def jumps(flight):
    verdict = audit(flight)
    return verdict, [f for f in verdict.faults if f.kind == "mocap_jump"]


@pytest.mark.parametrize("length_s", [0.2, 3.0])
def test_a_jump_and_its_return_are_one_fault(flights, length_s):
    for flight in flights[::9]:
        found = faults_of(moved(flight, 8.0, 8.0 + length_s), "mocap_jump")
        assert len(found) == 1
        assert found[0].start_s == pytest.approx(8.0, abs=0.025)
        assert found[0].end_s == pytest.approx(8.0 + length_s, abs=0.025)
        assert found[0].size == pytest.approx(0.3, abs=0.02)


def test_the_whole_stretch_is_cut(flights):
    verdict, _ = jumps(moved(flights[4], 8.0, 11.0))
    assert not any(s.start_s < 9.5 < s.end_s for s in verdict.clean)


@pytest.mark.parametrize("share", [0.3, 0.7])
@pytest.mark.slow
def test_a_jump_without_return_leaves_the_longer_side(flights, share):
    flight = flights[4]
    end = flight.span.end_s
    verdict, (fault,) = jumps(moved(flight, share * end, np.inf))
    if share < 0.5:
        assert fault.start_s == 0.0
        assert fault.end_s == pytest.approx(share * end, abs=0.025)
    else:
        assert fault.start_s == pytest.approx(share * end, abs=0.025)
        assert fault.end_s == pytest.approx(end)
    assert "not return" in fault.evidence
    assert len(verdict.clean_for(["mocap"], ["mocap_jump"])) == 1


def test_a_turned_stretch_is_cut_as_a_whole(flights):
    found = faults_of(moved(flights[4], 8.0, 8.5, offset=0.0, turn=(0.0, 0.0, 0.8)), "mocap_jump")
    assert [(round(f.start_s, 1), round(f.end_s, 1), f.unit) for f in found] == [(8.0, 8.5, "rad")]


def test_two_stretches_in_other_frames_are_two_faults(flights):
    flight = moved(moved(flights[4], 6.0, 7.0), 9.0, 9.4, offset=-2.0 * WAY)
    found = faults_of(flight, "mocap_jump")
    assert [(round(f.start_s, 1), round(f.end_s, 1)) for f in found] == [(6.0, 7.0), (9.0, 9.4)]


@pytest.mark.parametrize("down_m", [0.15, -0.15])
def test_a_jump_does_not_move_the_take_off(flights, down_m):
    """Heights of two frames: the ground of one is in the air of the other."""
    flight = flights[4]
    jumped = moved(flight, 0.6 * flight.span.end_s, np.inf, offset=(0.0, 0.0, -down_m))
    before, after = (Context(f).once(airborne_spans) for f in (flight, jumped))
    assert [s.start_s for s in after] == [s.start_s for s in before]
    assert after[-1].end_s == pytest.approx(before[-1].end_s, abs=0.1)


def test_heights_of_one_frame(flights):
    """A leap is taken out from there on, a spike is not one, and a flight without either is left alone."""
    stream = flights[4]["mocap"]
    time_s, z = stream.time_s, stream["pz"]
    assert np.array_equal(levelled(time_s, z), z)
    leapt, spiked = z.copy(), z.copy()
    leapt[900:] -= 0.2
    spiked[900:902] -= 0.2
    assert np.abs(levelled(time_s, leapt) - z).max() < 0.01
    assert np.array_equal(levelled(time_s, spiked), spiked)
