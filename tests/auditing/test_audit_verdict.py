"""Faults merged into events, and the one sentence on a recording: hand-made audits, and real recordings."""

import json
import math

import pytest

from nanobench_tools.auditing.audit_verdict import entry_of, verdict_of
from nanobench_tools.auditing.fault_events import events_of, size_in_words
from nanobench_tools.auditing.faults.kinds import kinds
from nanobench_tools.auditing.recording_audit import Audit, audit
from nanobench_tools.cli.main import main
from nanobench_tools.flight import Fault, Span, merge_spans, subtract_spans
from nanobench_tools.practice.flights import practice_flight
from nanobench_tools.signals.rates import RateReading


def fault(kind, stream="imu", start=1.0, end=2.0, size=1.0, unit="s", columns=("a",)):
    return Fault(kind, stream, columns, start, end, size, unit, "seen")


def audited(*faults, span=(0.0, 42.0), airborne=((3.0, 33.0),)):
    known = kinds()
    cuts = merge_spans(f.span for f in faults if known[f.kind].cuts)
    span = Span(*span)
    return Audit("f", "f.csv", "0" * 64, "pid", tuple(Span(*s) for s in airborne), subtract_spans([span], cuts), faults,
                 {}, {name: RateReading(100, 10.0) for name in ("imu", "mocap", "motor")}, span)


def test_one_event_for_one_end_of_the_log():
    faults = [fault("dead_stream", name, 40.0 + 0.01 * i, 42.0, 2.0) for i, name in enumerate("abcdefghi")]
    (event,) = events_of(faults, [Span(3.0, 33.0)])
    assert event.faults == 9
    assert len(event.streams) == 9
    assert event.sentence == "the log of 9 streams ended 2 s before the recording, on the ground"
    assert event.seconds_cut == 0.0


def test_repetitions_are_counted_and_overlapping_streams_counted_once():
    faults = [fault("gap", s, 5.0, 5.2, 0.2) for s in ("imu", "motor")] + [fault("gap", "imu", 9.0, 9.3, 0.3)]
    (event,) = events_of(faults)
    assert event.sentence == "imu and motor silent twice (0.5 s)"
    assert event.spans == (Span(5.0, 5.2), Span(9.0, 9.3))


def test_wrong_values_of_two_streams_are_two_events():
    assert len(events_of([fault("unit", "imu"), fault("unit", "attitude")])) == 2


@pytest.mark.parametrize("kind", sorted(kinds()))
def test_every_kind_tells_a_whole_sentence(kind):
    """With a size and without one, of the whole file and of a stream; nothing stays in braces."""
    for size, stream, columns in ((0.02, "imu", ("gyro_x",)), (math.nan, "", ()), (-3.0, "mocap", tuple("abcdef"))):
        for event in events_of([fault(kind, stream, size=size, columns=columns)]):
            assert "{" not in event.sentence
            assert "nan" not in event.sentence
            assert "  " not in event.sentence
            assert not event.sentence.endswith(".")
            assert len(event.sentence.split()) < 25


@pytest.mark.parametrize(("faults", "severity", "usable_s"), [
    ((), "fine", 30.0),
    ((fault("interpolated", start=0, end=42),), "fine", 30.0),
    ((fault("dead_stream", start=40, end=42),), "fine", 30.0),  # on the ground
    ((fault("clock_wander", start=0, end=42, size=0.03),), "minor", 30.0),
    ((fault("gap", start=5, end=6),), "minor", 29.0),
    ((fault("dead_stream", start=20, end=42),), "cut", 17.0),
    ((fault("unit", "imu", start=0, end=42),), "cut", 30.0),  # the other streams are as good as they were
    ((fault("quaternion_order", "mocap", start=0, end=42),), "unusable", 0.0),
    ((fault("crash", "", start=3.5, end=42),), "unusable", 0.5),
])
def test_severity(faults, severity, usable_s):
    found = verdict_of(audited(*faults))
    assert (found.severity, pytest.approx(found.usable_s)) == (severity, usable_s)


def test_a_recording_that_never_flew_is_not_usable_and_says_why():
    found = verdict_of(audited(fault("never_flew", "", 0, 42, 0.01, "m"), airborne=()))
    assert found.severity == "unusable"
    assert found.sentence == "not usable: the vehicle never left the ground"
    assert found.usable == ()


def test_a_stand_has_no_flight_and_is_usable():
    assert verdict_of(audited(airborne=())).sentence == "all 42.0 s of recording usable"


def test_the_sentence_leads_with_what_takes_most_and_advice_with_what_helps():
    found = verdict_of(audited(fault("dead_stream", start=20, end=42), fault("clock_wander", size=0.03)))
    assert found.sentence.startswith("17.0 of 30.0 s of flight usable: the log of imu ended")
    assert found.advice == "try --clock retimed"


def test_sizes():
    assert [size_in_words(*x) for x in ((0.0123, "s"), (2.5, "s"), (0.2, "m"), (math.nan, "s"), (3.0, "1"))] == [
        "12.3 ms", "2.5 s", "200 mm", "an unknown amount", "3"]


@pytest.mark.slow
def test_what_a_recording_suffices_for():
    flight = practice_flight(3)
    entry = entry_of(flight, audit(flight))
    assert entry["can"] == {"estimate": "", "sysid": "", "control": "", "thrust": "", "diagnose": "",
                            "motors": "no rpm stream"}
    less = flight.without_streams("imu", "battery")
    can = entry_of(less, audit(less))["can"]
    assert can["control"] == ""
    assert can["sysid"] == "no imu stream"
    assert can["thrust"] == "no imu stream"


@pytest.mark.real
def test_the_command_says_it_in_a_screen(real_data, tmp_path, capsys):
    path = sorted(real_data.rglob("B9_trefoil_medium_rep3.csv.xz"))[0]
    assert main(["audit", "--data", str(path), "--json", str(tmp_path / "a.json")]) == 0
    out = capsys.readouterr().out
    assert len(out.splitlines()) <= 24
    assert "s of flight usable" in out
    assert "Next, where was it" in out
    (entry,) = json.loads((tmp_path / "a.json").read_text())["flights"]
    assert entry["severity"] == "minor"
    assert entry["usable"]
    assert set(entry["verdict"].split()) <= set(out.split())
    assert sum(e["faults"] for e in entry["events"]) == sum(f["kind"] != "interpolated" for f in entry["faults"])
