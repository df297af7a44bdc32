"""Every injected fault is found, on the stream and at the time where it was put, and described by what it is."""

import numpy as np
import pytest

from nanobench_tools.audit import audit, find_copies
from nanobench_tools.practice.inject import INJECTIONS

PLAIN = {  # size that is above the stated minimum for every flight
    "dead_stream": 5.0,
    "frozen_stream": 0.5,
    "gap": 0.5,
    "duplicate_time": 3,
    "backward_time": 0.05,
    "clock_offset": 0.05,
    "clock_drift": 0.005,
    "clock_wander": 0.03,
    "spike": 1.0,
    "saturated_sensor": 0.2,
    "mocap_occlusion": 0.5,
    "mocap_jump": 0.1,
    "estimator_reset": 0.5,
    "crash": 1.0,
}
CASES = [(kind, case) for kind, x in INJECTIONS.items() for case in x.cases if kind not in ("copy",)]
CASES = [(k, c if c or k != "gap" else {"stream": "attitude"}) for k, c in CASES]


def lively(flights):
    """A Lissajous figure: every axis but yaw moves."""
    return next(
        f for f in flights if f.metadata["family"] == "lissajous" and f.metadata["practice"]["controller"] == "pid"
    )


@pytest.mark.parametrize(
    ("kind", "case"), CASES, ids=lambda x: x if isinstance(x, str) else "-".join(map(str, x.values()))
)
def test_found(flights, kind, case):
    flight = lively(flights)
    rng = np.random.default_rng(7)
    function = INJECTIONS[kind].function
    bad, truth = function(flight, rng, PLAIN[kind], **case) if kind in PLAIN else function(flight, rng, **case)
    result = audit(bad)
    found = [
        f
        for f in result.faults
        if f.kind == kind
        and (not truth.stream or not f.stream or f.stream == truth.stream)
        and f.start_s <= truth.end_s + 0.1
        and f.end_s >= truth.start_s - 0.1
    ]
    assert found, [(f.kind, f.stream, f.start_s, f.end_s) for f in result.faults if f.kind != "interpolated"]
    best = min(found, key=lambda f: abs(f.start_s - truth.start_s))
    assert best.evidence
    if truth.columns and best.columns != ("t",):
        assert set(best.columns) & set(truth.columns)
    if kind in ("dead_stream", "gap", "frozen_stream", "mocap_occlusion"):
        assert abs(best.start_s - truth.start_s) < 0.1
        assert abs(best.end_s - truth.end_s) < 0.1
        assert best.size == pytest.approx(truth.size, abs=0.1)
    if kind in ("spike", "mocap_jump", "unit", "clock_offset", "clock_drift"):
        assert best.size == pytest.approx(truth.size, rel=0.25)
    if kind in ("clock_wander", "estimator_reset"):
        assert best.size == pytest.approx(truth.size, rel=0.5)
    if np.isfinite(best.minimum_detectable) and kind not in (
        "sign",
        "axis_swap",
        "unit",
        "quaternion_order",
        "crash",
        "never_flew",
    ):
        assert best.minimum_detectable <= max(abs(truth.size), 3.0)


@pytest.mark.parametrize("how", ["extrapolate", "hold"])
@pytest.mark.parametrize("at_s", [6.3, 11.111, 17.0])
def test_end_of_a_dead_log_to_a_tenth_of_a_second(flights, how, at_s):
    for flight in flights[::7]:
        bad, truth = INJECTIONS["dead_stream"].function(flight, np.random.default_rng(0), at_s=at_s, how=how)
        dead = {f.stream: f for f in audit(bad).faults if f.kind == "dead_stream"}
        for name in ("imu", "estimator", "estimator_acc", "attitude", "attitude_qw", "motor"):
            assert abs(dead[name].start_s - truth.start_s) < 0.1, (name, dead[name])


def test_commands_that_stand_still_by_right_are_innocent(flights):
    """Held setpoints, motors at rest, a Mellinger flight's silent pid: none is frozen or dead before the log ends."""
    for flight in flights[::4]:
        stopped = flight.span.end_s - flight.metadata["practice"]["tail_s"]
        for fault in audit(flight).faults:
            if fault.stream in ("setpoint", "motor", "pid") and fault.kind in ("dead_stream", "frozen_stream"):
                assert fault.start_s > stopped - 0.15


def test_one_wrong_stream_does_not_accuse_the_others(flights):
    flight = lively(flights)
    for kind, case in (
        ("sign", {"stream": "imu", "column": "gyro_x"}),
        ("unit", {"case": 6}),
        ("unit", {"case": 7}),
        ("axis_swap", {"stream": "estimator", "pair": ("x", "y")}),
        ("quaternion_order", {"stream": "mocap"}),
    ):
        bad, truth = INJECTIONS[kind].function(flight, np.random.default_rng(1), **case)
        accused = {(f.kind, f.stream) for f in audit(bad).faults if f.kind not in ("interpolated", "dead_stream")}
        assert accused == {(kind, truth.stream)}


def test_the_motion_capture_is_blamed_when_the_vehicle_agrees_with_itself(flights):
    from dataclasses import replace

    flight = lively(flights)
    mocap = flight["mocap"]
    values = mocap.values.copy()
    for column in ("px", "vx"):
        values[:, mocap.index(column)] *= -1.0
    accused = {
        (f.kind, f.stream, f.columns)
        for f in audit(flight.with_streams(mocap=replace(mocap, values=values))).faults
        if f.kind == "sign"
    }
    assert ("sign", "mocap", ("px",)) in accused
    assert not {stream for _, stream, _ in accused} & {"estimator", "setpoint"}


def test_copies(flights):
    twin, _ = INJECTIONS["copy"].function(flights[2], np.random.default_rng(0))
    assert find_copies([*flights[:5], twin]) == [[flights[2].name, twin.name]]
