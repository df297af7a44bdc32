"""The audit of the real recordings: ends of logs, copies, controllers, innocence of what is right, invariances."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from fifteen import EIGHT, FIFTEEN, STOPPED

from nanobench_tools import so3
from nanobench_tools.auditing.faults.copy import parts
from nanobench_tools.auditing.recording_audit import audit, find_copies
from nanobench_tools.signals.context import Context
from nanobench_tools.signals.controller import controller_of
from nanobench_tools.sources import load_recordings

pytestmark = pytest.mark.real


@pytest.fixture(scope="module")
def every(real_data):
    """All recordings by name."""
    loaded = load_recordings([real_data / "nanobench" / "datasets"])
    assert not loaded.failed
    return {flight.name: flight for flight in loaded.flights}


@pytest.fixture(scope="module")
def recordings(real_data):
    """Eight of them."""
    folder = real_data / "nanobench" / "datasets" / "dataset"
    loaded = load_recordings([folder / f"{name}.csv.xz" for name in EIGHT])
    assert not loaded.failed
    assert {flight.name for flight in loaded.flights} == set(EIGHT)
    return {flight.name: flight for flight in loaded.flights}


@pytest.fixture(scope="module")
def verdicts(recordings, audited):
    """Of 8 recordings."""
    return {name: audited(recordings[name]) for name in EIGHT}


@pytest.fixture(scope="module", params=["8", pytest.param("34", marks=pytest.mark.slow)])
def many(request, audited):
    """Of 8 recordings, or of all fifteen and every third of the others."""
    if request.param == "8":
        return request.getfixturevalue("verdicts")
    every = request.getfixturevalue("every")
    others = sorted(every.keys() - set(FIFTEEN))
    return {name: audited(every[name]) for name in (*FIFTEEN, *others[::3])}


@pytest.mark.parametrize("name", [name if name in EIGHT else pytest.param(name, marks=pytest.mark.slow)
                                  for name in STOPPED])
def test_ends_of_logs_that_stopped(request, audited, name):
    flights = request.getfixturevalue("recordings" if name in EIGHT else "every")
    dead = {f.stream: f for f in audited(flights[name]).faults if f.kind == "dead_stream"}
    for stream in ("imu", "motor", "estimator", "estimator_acc", "attitude", "attitude_qw", "setpoint", "pid"):
        assert abs(dead[stream].start_s - STOPPED[name]) < 0.1
    assert -1.1 < dead["battery"].start_s - STOPPED[name] < 0.1


@pytest.mark.slow
def test_no_other_log_stops_before_its_last_half_second(every, many):
    groups = find_copies(list(every.values()))
    stopped = {name for group in groups if STOPPED.keys() & set(group) for name in group}
    for name, verdict in many.items():
        dead = [f for f in verdict.faults if f.kind == "dead_stream" and f.stream != "battery"]
        long = [f for f in dead if f.size > 0.45]
        assert bool(long) == (name in STOPPED or name in stopped), (name, long)


@pytest.mark.slow
def test_copies_and_slices(every, real_data):
    groups = {frozenset(g) for g in find_copies(list(every.values()))}
    assert groups == {
        frozenset({"B9_trefoil_fast_rep3", "B9_trefoil_fast_rep15"}),
        frozenset({"B9_trefoil_medium_rep3", "B9_trefoil_medium_rep7"}),
        frozenset({"B9_trefoil_medium_rep5", "B9_trefoil_medium_rep16"}),
        frozenset({"B9_trefoil_slow_rep2", "B9_trefoil_slow_rep8"}),
    }
    slices = load_recordings([real_data / "nanobench" / "benchmarks" / "task3_stateEst"]).flights
    both = [*every.values(), *slices]
    sliced = {i for i, _ in parts(both)}
    assert sliced == set(range(len(every), len(both)))


def test_controllers(verdicts):
    assert Counter(v.controller for v in verdicts.values()) == {"pid": 3, "mellinger": 4, "none": 1}


@pytest.mark.slow
def test_controllers_of_all(every):
    found = Counter(controller_of(Context(flight)) for flight in every.values())
    assert found == {"pid": 48, "mellinger": 23, "none": 1}


def test_nobody_is_accused_who_is_right(many):
    innocent = {
        "unit",
        "sign",
        "axis_swap",
        "quaternion_order",
        "spike",
        "mocap_jump",
        "mocap_occlusion",
        "estimator_reset",
        "saturated_sensor",
        "frozen_stream",
        "crash",
        "duplicate_time",
        "backward_time",
        "clock_drift",
        "bad_cell",
        "missing_column",
        "extra_column",
    }
    accused = [(name, f) for name, v in many.items() for f in v.faults if f.kind in innocent]
    assert accused == []
    assert [name for name, v in many.items() if any(f.kind == "never_flew" for f in v.faults)] == [
        "B7_oval_slow_rep1"
    ]


def test_airborne_times(verdicts):
    """Lift-off and touch-down by the measured table (first and last crossing of 5 cm)."""
    for name, lift, last in (
        ("B2_circle_fast_rep1", 3.26, 23.3),
        ("B8_star_fast_rep3", 2.67, 38.8),
        ("B6_linear_ramp_rep3", 3.24, 28.9),
    ):
        (air,) = verdicts[name].airborne
        assert abs(air.start_s - lift) < 0.1
        assert abs(air.end_s - last) < 1.1


def test_clock_of_the_real_link(many):
    readings = [v.clock["imu"] for v in many.values()]
    offsets = [r.offset_s for r in readings if r.identifiable]
    assert len(offsets) >= {8: 6, 34: 28}[len(many)]
    assert abs(np.median(offsets)) < 0.005
    assert not many["B6_linear_ramp_rep3"].clock["imu"].identifiable
    assert not many["B7_oval_slow_rep1"].clock["imu"].identifiable
    moved = [any(f.kind == "clock_wander" and f.stream == "estimator" for f in v.faults) for v in many.values()]
    assert sum(moved) >= {8: 6, 34: 31}[len(many)]
    wander = [
        v.clock["estimator"].wander_sd_s for v in many.values() if np.isfinite(v.clock["estimator"].wander_sd_s)
    ]
    assert 0.025 < np.median(wander) < 0.04


def summary(verdict, shift_s=0.0):
    return [
        (f.kind, f.stream, f.columns, round(f.start_s - shift_s, 2), round(f.end_s - shift_s, 2))
        for f in verdict.faults
    ]


@pytest.mark.parametrize("name", ["B9_trefoil_fast_rep5", pytest.param("B5_helix_rep1", marks=pytest.mark.slow)])
def test_a_shift_of_all_stamps_changes_nothing_else(request, audited, name):
    flight = request.getfixturevalue("recordings" if name in EIGHT else "every")[name]
    before = audited(flight)
    time_s = flight["mocap"].time_s + 1000.0
    moved = replace(flight, streams={n: replace(s, time_s=time_s) for n, s in flight.streams.items()})
    verdict = audit(moved)
    assert sorted(summary(verdict, 1000.0)) == sorted(summary(before))
    assert verdict.clock["imu"].offset_s == pytest.approx(before.clock["imu"].offset_s, abs=1e-4)


@pytest.mark.parametrize(("name", "angle"), [
    ("B2_circle_fast_rep1", 0.7),
    pytest.param("B2_circle_fast_rep1", 2.5, marks=pytest.mark.slow),
    pytest.param("B9_trefoil_medium_rep3", 0.7, marks=pytest.mark.slow),
    pytest.param("B9_trefoil_medium_rep3", 2.5, marks=pytest.mark.slow)])
def test_turning_the_world_changes_nothing(recordings, verdicts, name, angle):
    flight = recordings[name]
    turn = so3.exp(np.array([0.0, 0.0, angle]))
    matrix = so3.matrix(turn)

    def turned(stream, vectors=(), quaternion=(), yaw=()):
        s = flight[stream]
        values = s.values.copy()
        for names in vectors:
            columns = [s.index(n) for n in names]
            values[:, columns] = values[:, columns] @ matrix.T
        if quaternion:
            columns = [s.index(n) for n in quaternion]
            values[:, columns] = so3.multiply(turn, values[:, columns])
        for n in yaw:
            values[:, s.index(n)] = values[:, s.index(n)] + angle
        return replace(s, values=values)

    q, xyz = ("qx", "qy", "qz", "qw"), ("x", "y", "z")
    world = flight.with_streams(
        mocap=turned("mocap", (("px", "py", "pz"), ("vx", "vy", "vz")), q, ("yaw",)),
        estimator=turned("estimator", (xyz, ("vx", "vy", "vz"))),
        estimator_acc=turned("estimator_acc", (("ax", "ay", "az"),)),
        attitude=turned("attitude", yaw=("yaw",)),
        attitude_qw=turned("attitude_qw", quaternion=q),
        setpoint=turned("setpoint", (xyz,), yaw=("yaw",)),
        pid=turned("pid", yaw=("yaw",)),
    )
    assert sorted(summary(audit(world))) == sorted(summary(verdicts[name]))


def parted(body: object, place: str = "") -> tuple[dict[str, object], dict[str, float]]:
    """All that a verdict says but its name, place by place: words and counts, and measured numbers."""
    if isinstance(body, float):
        return {}, {place: body}
    if not isinstance(body, dict | list):
        return {place: body}, {}
    exact: dict[str, object] = {place: len(body)}
    measured: dict[str, float] = {}
    for key, value in body.items() if isinstance(body, dict) else enumerate(body):
        if (place, key) != ("", "flight"):
            words, numbers = parted(value, f"{place}/{key}")
            exact, measured = exact | words, measured | numbers
    return exact, measured


def test_the_name_is_not_read(recordings, verdicts):
    flight = replace(recordings["B9_trefoil_fast_rep2"], name="practice", metadata={})
    said, named = (parted(verdict.to_json()) for verdict in (audit(flight), verdicts["B9_trefoil_fast_rep2"]))
    assert said[0] == named[0]
    # how many threads a library takes decides the last digits
    assert said[1] == pytest.approx(named[1], rel=1e-6, abs=1e-9, nan_ok=True)
