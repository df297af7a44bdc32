"""Who may set the clock that something is judged by, and what such a clock leaves and takes out."""

import numpy as np
import pytest

from nanobench_tools.auditing.selection import distinct
from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.practice import nulls
from nanobench_tools.signals.context import Context
from nanobench_tools.sources import load_recordings
from nanobench_tools.time_offsets.moving.apply import find_time_offset
from nanobench_tools.time_offsets.moving.infer import infer
from nanobench_tools.time_offsets.moving.time_offset import retime
from nanobench_tools.time_offsets.moving.votes import CLOCKS, ESTIMATES, evidence_of, voters, votes


@pytest.mark.parametrize("judged", [(), ("position",), ("position", "velocity"), ("attitude",), ESTIMATES])
def test_nothing_that_is_judged_has_a_vote(judged):
    for clock in CLOCKS[:-1]:
        assert not set(voters(clock, judged)) & set(judged)
    assert not {"position", "velocity"} & set(voters("retimed"))


def test_names_that_are_none_are_refused_instead_of_judged_by_their_own_vote():
    assert voters("retimed", "attitude") == voters("retimed", ("attitude",))
    for clock, judged in (("bogus", ()), (None, ()), ("retimed", ("bogus",)), ("retimed", "att")):
        with pytest.raises(UsageError, match="there are"):
            voters(clock, judged)


def test_no_warp_is_looked_for_as_recorded():
    with pytest.raises(UsageError, match="takes nothing out"):
        find_time_offset(None, "as-recorded")


def test_judged_has_to_be_said():
    with pytest.raises(UsageError, match=r"judged is None: name what .* or \(\) for nothing"):
        voters("retimed", None)


def test_what_a_row_was_given_names_only_who_was_heard():
    """A joint clock without gyro takes nothing out, and one that does not move heard no position."""
    assert votes("joint", ()) == "; timestamps as recorded, as no stream identified their time error"
    assert "position" not in votes("joint", ("gyro",), moving=False)
    assert "constant offset, found off-line from gyro" in votes("retimed", ("gyro",), moving=False)


def test_joint_hears_all_and_judges_no_estimate():
    assert set(ESTIMATES) < set(voters("joint"))
    with pytest.raises(UsageError, match="joint cannot judge the logged position"):
        voters("joint", ("position",))


def test_a_row_says_who_voted():
    assert votes("as-recorded", ()) == ""
    assert "gyro, acceleration, attitude" in votes("retimed", voters("retimed"))
    assert "position helped" in votes("joint", voters("joint"))


@pytest.fixture(scope="module")
def flight(crowd):
    return nulls.living(crowd.log("fast figure_eight", wander_sd_s=0.02)[0])


@pytest.mark.slow
def test_a_retimed_flight_carries_its_voters(flight):
    assert evidence_of([flight]) == []
    for clock in ("offset", "retimed", "joint"):
        time_offset = find_time_offset(flight, clock)
        assert time_offset.moving or clock == "offset"
        assert evidence_of([retime(flight, time_offset)]) == list(voters(clock))


def test_stamps_are_moved_once(flight):
    moved = flight.retimed()
    for again in (moved, flight.retimed("offset")):
        with pytest.raises(InputError, match=r"timestamps were moved before, by gyro.*use the recording as it was"):
            again.retimed()


@pytest.mark.parametrize("wander_s", [0.0, 0.005])
@pytest.mark.slow
def test_a_small_wander_is_believed_and_none_is_not(crowd, wander_s):
    """5 ms were not, where only a link that moves as often as it can was weighed against a constant clock."""
    flown = nulls.living(crowd.log("medium trefoil", wander_sd_s=wander_s)[0])
    for judged in (("attitude",), ("position", "velocity")):
        assert find_time_offset(flown, "retimed", judged).moving == (wander_s > 0.0)


@pytest.mark.parametrize("velocity", [False, True])
@pytest.mark.slow
def test_an_error_of_the_estimate_changes_nothing_of_the_clock_that_judges_it(flight, velocity):
    after, error = nulls.with_track_error(flight, 1.0, 0.03, 3, velocity)
    assert np.std(error) > 0.005
    before, time_offset = (find_time_offset(f, "retimed", ("position", "velocity")) for f in (flight, after))
    np.testing.assert_array_equal(time_offset.offset_s, before.offset_s)
    assert nulls.kept([nulls.track_errors(Context(flight), Context(after), error, before, time_offset)]) > 0.9


@pytest.mark.slow
def test_the_joint_clock_takes_such_an_error_for_time(flight):
    after, error = nulls.with_track_error(flight, 1.0, 0.03, 3)
    errors = nulls.track_errors(Context(flight), Context(after), error, infer(Context(flight)), infer(Context(after)))
    assert nulls.kept([errors]) < 0.5


def test_a_wander_put_into_the_stamps_is_taken_out(flight):
    after, clock = nulls.with_wander(flight, 0.02, 7)
    before, time_offset = (find_time_offset(f, "retimed", ("position", "velocity")) for f in (flight, after))
    assert time_offset.moving
    assert nulls.removed([nulls.wander_errors(Context(flight), clock, before, time_offset)]) > 0.7


def test_shares_of_hand_worked_errors():
    injected = np.array([1.0, -1.0, 2.0, -2.0])
    untouched, half = nulls.Errors.of(injected, injected), nulls.Errors.of(injected, 0.5 * injected + 3.0)
    assert (nulls.kept([untouched]), nulls.removed([untouched])) == (pytest.approx(1.0), pytest.approx(0.0))
    assert (nulls.kept([half]), nulls.removed([half])) == (pytest.approx(0.25), pytest.approx(0.75))


@pytest.mark.slow
@pytest.mark.real
def test_real_flights_keep_errors_of_the_estimate_and_lose_those_of_the_stamps(real_data):
    """Every twentieth flight; benchmarks/studies/clock_proof.py has them all."""
    files = sorted((real_data / "nanobench").rglob("*circle_fast_rep2*.csv*")) + sorted(
        (real_data / "nanobench").rglob("*star_medium_rep2*.csv*")) + sorted(
        (real_data / "nanobench").rglob("*trefoil_medium_rep14*.csv*"))
    flights = [nulls.living(f) for f in distinct(load_recordings(files).flights)[0]]
    assert len(flights) >= 3
    survived, gone = [], []
    for i, flown in enumerate(flights):
        before = find_time_offset(flown, "retimed", ("position", "velocity"))
        after, error = nulls.with_track_error(flown, nulls.RANDOM, 0.03, i, True)
        survived.append(nulls.track_errors(Context(flown), Context(after), error, before,
                                           find_time_offset(after, "retimed", ("position", "velocity"))))
        late, clock = nulls.with_wander(flown, 0.02, i)
        gone.append(nulls.wander_errors(Context(flown), clock, before,
                                        find_time_offset(late, "retimed", ("position", "velocity"))))
    assert nulls.kept(survived) > 0.9
    assert nulls.removed(gone) > 0.7


def test_without_a_gyro_nothing_is_retimed(crowd):
    """Accelerations show time so weakly that a clock from them can be worse than none."""
    flown = crowd.log("fast figure_eight", wander_sd_s=0.02)[0]
    imu = flown["imu"]
    blind = flown.with_streams(imu=imu.rows(imu.time_s < 0.5))
    time_offset = find_time_offset(blind, "retimed", ("position", "velocity"))
    assert time_offset is None or not time_offset.moving
