"""One mistake is told once, at the stream that has it."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from one_kind import faults_of

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import Fault


def with_mocap(flight, column, change):
    s = flight["mocap"]
    values = s.values.copy()
    values[:, s.index(column)] = change(values[:, s.index(column)])
    return flight.with_streams(mocap=replace(s, values=values))


@pytest.mark.parametrize("column", ["px", "py", "pz"])
def test_a_negated_axis_of_the_motion_capture_accuses_nobody_else(flights, column):
    for flight in (f for f in flights if f.metadata["family"] == "lissajous"):
        signs = faults_of(with_mocap(flight, column, np.negative), "sign", "axis_swap")
        assert [(f.kind, f.stream, f.columns) for f in signs] == [("sign", "mocap", (column,))]


def test_a_column_without_a_number_is_missing_and_not_occluded(flights):
    flight = with_mocap(flights[4], "px", lambda x: x * np.nan)
    end = flight.span.end_s
    told = Fault("bad_cell", "mocap", ("px",), -0.005, end + 0.005, 1.0, "cells", "text where a number belongs", 1.0)
    flight = replace(flight, provenance=replace(flight.provenance, findings=(told,)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        verdict = audit(flight)
    found = {(f.kind, f.start_s, f.end_s) for f in verdict.faults if f.stream == "mocap"}
    assert found == {("bad_cell", 0.0, end), ("missing_column", 0.0, end)}
    assert verdict.clean_for(["mocap"]) == ()
