"""The shape of a verdict: JSON there and back, clean spans, the registered kinds."""

import json
from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.auditing.faults.kinds import cutting, kinds
from nanobench_tools.auditing.recording_audit import Audit, ClockReading, RateReading, audit, find_copies
from nanobench_tools.flight import Fault, Flight, Provenance, Span, make_stream
from nanobench_tools.lookup import registry

KINDS = {
    "dead_stream",
    "frozen_stream",
    "gap",
    "gyro_bias",
    "duplicate_time",
    "coarse_time",
    "no_common_time",
    "frame",
    "body_frame",
    "backward_time",
    "clock_offset",
    "clock_drift",
    "clock_wander",
    "unit",
    "sign",
    "axis_swap",
    "spike",
    "rounded_time",
    "saturated_sensor",
    "mocap_occlusion",
    "mocap_jump",
    "quaternion_order",
    "estimator_reset",
    "never_flew",
    "wrong_speed",
    "crash",
    "constant_offset",
    "copy",
    "missing_column",
    "extra_column",
    "truncated",
    "checksum",
    "bad_cell",
    "half_precision",
    "interpolated",
}


def verdict(*faults: Fault) -> Audit:
    reading = ClockReading(0.01, (0.005, 0.015), True, "because", 0.002, ((1.0, 0.01, 0.001),))
    return Audit(
        "f",
        "f.csv",
        "00",
        "pid",
        (Span(2.0, 8.0),),
        (),
        faults,
        {"imu": reading, "motor": ClockReading.unknown("unseen")},
        {"imu": RateReading(900, 90.0)},
        Span(0.0, 10.0),
    )


def fault(kind: str, stream: str, start: float, end: float) -> Fault:
    return Fault(kind, stream, ("c",), start, end, end - start, "s", "seen", float("nan"))


def test_every_kind_has_one_file_and_says_how_it_is_found():
    modules = registry.load_all("faults")
    assert set(modules) == KINDS
    for kind, module in modules.items():
        assert kind == module.KIND
        assert module.__doc__.startswith(kind)
        assert "Found" in module.__doc__ or kind in ("copy",), kind
        assert "Smallest" in module.__doc__, kind
        assert kinds()[kind] is module.FAULT
    assert cutting() < KINDS
    assert not cutting() & {"clock_offset", "clock_drift", "clock_wander", "interpolated", "copy"}


def test_json_there_and_back():
    before = verdict(fault("gap", "imu", 1.0, 2.0))
    text = json.dumps(before.to_json(), allow_nan=False)
    after = Audit.from_json(json.loads(text))
    assert after.to_json() == before.to_json()
    assert after.clock["imu"] == before.clock["imu"]
    assert np.isnan(after.clock["motor"].offset_s)


def test_one_course_of_several_streams_is_written_once():
    course, other = ((0.0, 0.01, 0.001), (5.0, -0.02, 0.001)), ((0.0, 0.03, 0.001),)
    before = verdict()
    clock = {"imu": course, "estimator": course, "attitude": other, "pid": (), "battery": ()}
    before = replace(before, clock={name: replace(before.clock["imu"], warp=warp) for name, warp in clock.items()})
    body = json.loads(json.dumps(before.to_json(), allow_nan=False))
    assert body["clock"]["imu"]["warp"] == [list(point) for point in course]
    assert (body["clock"]["estimator"]["warp"], body["clock"]["estimator"]["warp_of"]) == ([], "imu")
    assert "warp_of" not in body["clock"]["attitude"] | body["clock"]["battery"]
    assert {name: reading.warp for name, reading in Audit.from_json(body).clock.items()} == clock


def test_clean_spans_count_only_the_streams_asked_for():
    v = verdict(
        fault("gap", "imu", 1.0, 2.0),
        fault("spike", "mocap", 4.0, 4.5),
        fault("clock_offset", "imu", 0.0, 10.0),
        fault("crash", "", 9.0, 10.0),
    )
    assert v.clean_for(["imu"]) == (Span(0.0, 1.0), Span(2.0, 9.0))
    assert v.clean_for(["mocap", "imu"]) == (Span(0.0, 1.0), Span(2.0, 4.0), Span(4.5, 9.0))
    assert v.clean_for(["battery"]) == (Span(0.0, 9.0),)
    assert v.clean_for(["imu"], kinds=["crash"]) == (Span(0.0, 9.0),)


@pytest.mark.parametrize("n", [0, 1, 2, 3, 25])
def test_tiny_recordings_are_audited_without_a_word(n):
    t = np.arange(n) / 100.0
    streams = {
        "mocap": make_stream("mocap", t, np.zeros((n, 7)), ("px", "py", "pz", "qx", "qy", "qz", "qw")),
        "imu": make_stream(
            "imu", t, np.full((n, 6), np.nan), ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")
        ),
        "battery": make_stream("battery", t, np.zeros((n, 1)), ("vbat",)),
    }
    result = audit(Flight("tiny", streams, {}, Provenance("tiny.csv", "", "test")))
    assert result.airborne == ()
    json.dumps(result.to_json(), allow_nan=False)


def test_a_flight_without_motion_capture_is_audited(flights):
    result = audit(flights[0].without_streams("mocap"))
    assert result.controller == "pid"
    assert result.airborne
    assert not result.clock["imu"].identifiable
    assert "no motion capture" in result.clock["imu"].reason
    assert {f.kind for f in result.faults} <= {"dead_stream", "interpolated"}


def test_copies_are_found_by_content_not_by_name(flights):
    a, b, c = flights[0], flights[1], flights[0]
    twin = Flight("other name", dict(reversed(list(c.streams.items()))), {}, Provenance("x", "y", "z"), epoch_s=5.0)
    changed = c.with_streams(imu=make_stream("imu", c["imu"].time_s, c["imu"].values + 1e-6, c["imu"].quantities))
    assert find_copies([a, b, twin, changed]) == [[a.name, "other name"]]


def test_parts_and_marked_copies(flights, audits):
    from nanobench_tools.auditing.faults.copy import parts
    from nanobench_tools.auditing.recording_audit import with_copies

    whole = flights[0]
    part = whole.during(Span(5.0, 12.0))
    assert parts([flights[1], part, whole]) == [(1, 2)]
    marked = with_copies([audits[0], audits[1], audits[0]], [flights[0], flights[1], flights[0]])
    assert [[f.kind for f in a.faults].count("copy") for a in marked] == [0, 0, 1]
