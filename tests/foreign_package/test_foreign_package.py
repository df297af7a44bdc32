"""A package of somebody else, found by its entry points alone, goes through every verb like ours."""

import json
from pathlib import Path

import pytest
from foreign_install import nanobench, placed, python

from nanobench_tools.cli.main import main

pytestmark = pytest.mark.slow

KIND = "stuttering_gyro"
AT_S = 8.0

SPOIL = """
import sys
from pathlib import Path
import numpy as np
from nanobench_tools.practice import practice_flights
from nanobench_tools.practice.inject import INJECTIONS
from nanobench_tools.sources.nanobench_writer import write_nanobench
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.auditing.faults.kinds import cutting, cutting_logs, cutting_trim, group_of

assert {KIND!r} in cutting() & cutting_logs() & cutting_trim() and group_of({KIND!r}) == "value"
flight = practice_flights(1, seed=5, families=["figure_eight"], speeds=["medium"], duration_s=12.0)[0]
injection = INJECTIONS[{KIND!r}]
spoilt, truth = injection.function(flight, np.random.default_rng(1), injection.sizes[-1], at_s={AT_S})
(found,) = [f for f in audit(spoilt).faults if f.kind == {KIND!r}]
assert not [f for f in audit(flight).faults if f.kind == {KIND!r}]
assert abs(found.start_s - truth.start_s) < 0.1 and abs(found.end_s - truth.end_s) < 0.1
write_nanobench(spoilt, Path(sys.argv[1]) / "spoilt.csv")
"""

LEFT_OUT = """
import sys
import numpy as np
from identification.mismatch.diagnosis import recorded
from nanobench_tools.sources.discover import load_recordings

(flight,) = load_recordings([sys.argv[1]]).flights
seen = recorded([flight], True)
((name, fault),) = [(n, f) for n, f in seen.cut if f.kind == {KIND!r}]
judged = np.concatenate([track.time_s[track.counts] for track in seen.tracks])
assert len(judged) > 500
assert not ((judged > fault.start_s) & (judged < fault.end_s)).any()
assert (judged < fault.start_s).any() and (judged > fault.end_s).any()
assert {KIND!r} in [f.kind for _, f in seen.faults]
"""

DEALT = """
from dataclasses import replace
from identification.prove.make import make_case
from identification.prove.plan import _faults, plan_cases
from nanobench_tools.auditing.recording_audit import audit

names = [name for name, _ in _faults()]
assert names[-1] == {KIND!r}, names  # after ours, so that the deck of ours keeps its order
spec = next(s for s in plan_cases(600, 1) if s.faults and s.faults[0].kind == {KIND!r})
case = make_case(replace(spec, flights=spec.flights[:1], faults=(replace(spec.faults[0], flights=(0,)),)))
(truth,) = case.truth.faults
assert (truth.kind, truth.stream) == ({KIND!r}, "imu"), truth
found = [f for f in audit(case.flights[0]).faults if f.kind == {KIND!r}]
assert found and abs(found[0].start_s - truth.start_s) < 0.2, found
"""


def about(script: str) -> str:
    """A script with the names of this file in it."""
    return script.replace("{KIND!r}", repr(KIND)).replace("{AT_S}", str(AT_S))


@pytest.fixture(scope="module")
def spoilt(installed, tmp_path_factory):
    """Folder with one practice recording (SYNTHETIC) whose fault only the foreign package knows."""
    folder = tmp_path_factory.mktemp("spoilt")
    python(folder, installed, "-c", about(SPOIL), folder)
    return folder


@pytest.fixture(scope="module")
def audited(installed, spoilt, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    return out, nanobench(out, installed, "audit", "--data", spoilt, "--out", out, "--jobs", 1)


def flight_of(folder: Path) -> dict:
    (flight,) = json.loads((folder / "audit.json").read_text())["flights"]
    return flight


def test_its_fault_is_found_and_cut_by_audit(audited):
    out, said = audited
    flight = flight_of(out)
    (fault,) = [f for f in flight["faults"] if f["kind"] == KIND]
    assert fault["stream"] == "imu"
    assert fault["minimum_detectable"] == 50.0
    assert not any(start < AT_S + 0.5 < end for start, end in flight["clean"])
    assert any(start <= AT_S - 2.0 < end for start, end in flight["clean"])
    assert "the gyro's first axis swings between two values from row to row" in said


def test_its_fault_stands_in_the_report(installed, audited, spoilt):
    out, _ = audited
    nanobench(out, installed, "report", "--data", spoilt, "--out", out)
    page = (out / "report.html").read_text()
    assert "first axis swings between two values from row to row" in page


def test_its_rows_are_left_out_of_a_diagnosis(installed, spoilt):
    python(spoilt, installed, "-c", about(LEFT_OUT), spoilt)


@pytest.mark.slow
def test_it_is_dealt_to_blind_cases(installed, tmp_path):
    python(tmp_path, installed, "-c", about(DEALT))


def test_a_verdict_kept_without_it_is_not_given_with_it(installed, spoilt, tmp_path):
    """The store of results is asked for what was made with the same kinds of faults; without the package by this
    process."""
    found = []
    words = ["audit", "--data", str(spoilt), "--out", str(tmp_path / "kept"), "--jobs", "1"]
    for path in (None, installed, None):
        if path is None:
            assert main(words) == 0
        else:
            nanobench(tmp_path, path, *words)
        found.append(KIND in {f["kind"] for f in flight_of(tmp_path / "kept")["faults"]})
    assert found == [False, True, False]


def test_what_is_no_kind_of_fault_is_left_out_with_a_warning(spoilt, tmp_path):
    broken = placed(tmp_path)
    (broken / "nanobench_foreign" / "stuttering_gyro.py").write_text("FAULT = 3\n")
    said = nanobench(tmp_path, broken, "audit", "--data", spoilt, "--jobs", 1)
    assert f"faults plug-in '{KIND}' left out: it is no FaultKind" in said
