"""Columns nobody knows cut nothing; a voltage that never changes is stuck, not a log that ended."""

from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.auditing.faults.kinds import cutting
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Span, Stream


def with_voltage(flight, values):
    return flight.with_streams(battery=replace(flight["battery"], values=np.asarray(values, dtype=float)[:, None]))


@pytest.mark.parametrize("shape", ["counter", "constant", "steps", "empty"])
@pytest.mark.slow
def test_an_extra_column_never_cuts(flights, audits, shape):
    flight, before = flights[4], audits[4]
    t = flight["imu"].time_s
    n = np.arange(len(t), dtype=float)
    values = {"counter": n, "constant": 0.0 * n, "steps": n // 500, "empty": n * np.nan}[shape]
    bad = flight.with_streams(extra=Stream(t, values[:, None], ("foo",), ("foo",), ("1",)))
    verdict = audit(bad)
    assert verdict.clean == before.clean
    assert not [f for f in verdict.faults if f.stream == "extra" and f.kind in cutting()]
    assert verdict.clean_for(["extra"]) == before.clean_for([])


def test_a_voltage_that_never_changes_is_stuck(flights, audits):
    flight, before = flights[4], audits[4]
    verdict = audit(with_voltage(flight, np.full(len(flight["battery"]), 3.7)))
    (fault,) = [f for f in verdict.faults if f.stream == "battery" and f.kind in cutting()]
    assert (fault.kind, fault.start_s, fault.end_s) == ("frozen_stream", verdict.span.start_s, verdict.span.end_s)
    assert "motors run" in fault.evidence
    assert verdict.clean == before.clean
    assert verdict.clean_for(["imu", "mocap"]) == before.clean_for(["imu", "mocap"])
    assert verdict.clean_for(["battery"]) == ()


def test_a_voltage_that_rests_with_the_motors_is_no_fault(flights):
    flight = flights[4]
    still = {n: replace(flight[n], values=0.0 * flight[n].values) for n in ("motor", "motor_request") if n in flight}
    verdict = audit(with_voltage(flight.with_streams(**still), np.full(len(flight["battery"]), 3.7)))
    assert not [f for f in verdict.faults if f.stream == "battery" and f.kind in ("frozen_stream", "dead_stream")]


def test_on_a_thrust_stand_a_voltage_may_stand_still(flights):
    flight = flights[4]
    bench = flight.without_streams(*(n for n in flight.streams if n not in ("motor", "battery")))
    values = flight["battery"].values[:, 0].copy()
    values[len(values) // 2 :] = values[len(values) // 2]
    verdict = audit(with_voltage(bench, values))
    assert not [f for f in verdict.faults if f.stream == "battery" and f.kind in cutting()]
    assert Span(verdict.span.start_s, verdict.span.end_s) in verdict.clean_for(["battery"])
