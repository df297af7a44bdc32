"""The three flights of the package: small, SYNTHETIC, with the promised faults, and writable as files."""

import json

import pytest

import nanobench_tools as nb
from nanobench_tools.practice.sample_files import SAMPLE


@pytest.fixture(scope="module")
def audits():
    return nb.audit(nb.sample())


def test_three_small_synthetic_flights():
    flights = nb.sample()
    assert len(flights) == 3
    assert flights.failed == []
    assert all(flight.provenance.synthetic for flight in flights)
    assert sum(file.stat().st_size for file in SAMPLE.iterdir()) < 1_000_000


def test_the_audit_finds_the_faults_that_were_put_in(audits):
    assert audits["sample_circle"].severity == "fine"
    dead = audits["sample_trefoil"]
    assert dead.severity == "cut"
    assert "dead_stream" in set(dead.faults["kind"])
    assert "clock_wander" in set(audits["sample_multisine_sysid"].faults["kind"])
    assert "clock_wander" not in set(audits["sample_circle"].faults["kind"])


def test_the_verb_writes_the_same_files(tmp_path, nanobench):
    code, out, err = nanobench("sample", "--out", tmp_path / "s")
    assert (code, err) == (0, "")
    assert "3 SYNTHETIC recordings" in out
    assert {f.name: f.read_bytes() for f in (tmp_path / "s").iterdir()} == {f.name: f.read_bytes()
                                                                        for f in SAMPLE.iterdir()}


@pytest.mark.slow
def test_the_logged_estimate_is_scored_on_another_clock_without_a_method(nanobench, tmp_path):
    code, _, err = nanobench("estimate", SAMPLE, "--protocol", "clean", "--clock", "retimed", "--quiet",
                             "--json", tmp_path / "e.json")
    assert (code, err) == (0, "")
    rows = json.loads((tmp_path / "e.json").read_text())["rows"]
    assert ("onboard_ekf", "retimed") in {(row["method"], row["clock"]) for row in rows}
