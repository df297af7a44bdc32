"""What is drawn of one recording, against numbers known by construction."""

import json

import numpy as np
import pytest
from test_decimate import unpack

from nanobench_tools.report.audit_entry import fault_counts, share_clean, share_valid, total
from nanobench_tools.report.recording import payload


@pytest.fixture
def flight(make):
    return make.flight()


def series(part, key):
    return next(s for s in part["series"] if s["key"] == key)


def test_errors_are_the_offsets_the_flight_was_made_with(flight, make):
    errors = payload(flight, make.entry(flight))["errors"]
    position, attitude = series(errors, "estimator"), series(errors, "attitude_qw")
    before = unpack(position["t"]) < 14.9
    assert unpack(position["v"])[before] == pytest.approx(100.0, abs=0.06)
    assert unpack(attitude["v"]) == pytest.approx(10.0, abs=0.006)
    assert (position["unit"], attitude["unit"]) == ("mm", "deg")


def test_the_frame_is_what_is_clean_and_the_rest_is_said(flight, make):
    position = series(payload(flight, make.entry(flight))["errors"], "estimator")
    assert position["range"] == pytest.approx([100.0, 100.0], abs=0.1)
    assert position["cut"] == [[15.0, 20.0]]
    assert position["beyond"][1] == pytest.approx(1e3 * np.hypot(10.0, 0.1), rel=1e-3)


def test_paths_have_gaps_where_the_audit_cuts_and_setpoints_only_in_the_air(flight, make):
    paths = payload(flight, make.entry(flight))["paths"]
    t = np.arange(0, 20.01, 0.05)
    estimate, setpoint, truth = (unpack(series(paths, k)["x"]) for k in ("estimator", "setpoint", "mocap"))
    assert np.isfinite(truth).all()
    assert np.array_equal(np.isnan(estimate), t >= 15.0 - 1e-9)
    assert np.array_equal(np.isnan(setpoint), (t < 2.0 - 1e-9) | (t > 18.0 + 1e-9))
    assert truth == pytest.approx(np.cos(2 * np.pi * t / 10.0), abs=5e-4)


def test_zeros_that_are_logged_when_nothing_is_asked_are_no_place(flight, make):
    flight.streams["setpoint"].values[1000:1500, [flight["setpoint"].columns.index(a) for a in "xyz"]] = 0.0
    drawn = unpack(series(payload(flight, make.entry(flight))["paths"], "setpoint")["x"])
    zeros = np.searchsorted(np.arange(0, 20.01, 0.05), flight["setpoint"].time_s[[1001, 1498]])
    assert np.isnan(drawn[zeros[0]:zeros[1]]).all()
    assert np.isfinite(drawn[[zeros[0] - 3, zeros[1] + 3]]).all()


def test_a_recording_that_was_not_audited_is_drawn_whole(flight):
    drawn = payload(flight, None)
    assert np.isfinite(unpack(series(drawn["paths"], "estimator")["x"])).all()
    assert "not audited" in drawn["timeline"]["absent"]


@pytest.mark.parametrize(("missing", "part", "word"), [
    ("battery", "battery", "battery"), ("motor", "motors", "motor"), ("mocap", "errors", "motion capture")])
def test_what_is_missing_is_said_and_the_rest_is_drawn(make, missing, part, word):
    flight = make.flight().without_streams(missing)
    drawn = payload(flight, make.entry(flight))
    assert word in drawn[part]["absent"]
    assert sum("series" in drawn[k] for k in ("paths", "errors", "battery", "motors")) == 3


def test_a_recording_without_any_stream_still_has_a_page(make):
    flight = make.flight(streams=())
    drawn = payload(flight, make.entry(flight))
    assert all("absent" in drawn[k] for k in ("paths", "errors", "battery", "motors"))
    json.dumps(drawn, allow_nan=False)


def test_values_that_are_no_numbers_do_not_reach_the_page(make):
    flight = make.flight()
    broken = flight["estimator"].values.copy()
    broken[100:200] = np.nan
    broken[300] = np.inf
    quaternion = np.zeros_like(flight["attitude_qw"].values)
    from dataclasses import replace
    flight = flight.with_streams(estimator=replace(flight["estimator"], values=broken),
                                 attitude_qw=replace(flight["attitude_qw"], values=quaternion))
    json.dumps(payload(flight, make.entry(flight)), allow_nan=False)


def test_stamps_that_go_back_do_not_break_the_comparison(make):
    from dataclasses import replace
    flight = make.flight()
    t = flight["mocap"].time_s.copy()
    t[500:510] = t[495]
    drawn = payload(flight.with_streams(mocap=replace(flight["mocap"], time_s=t)), make.entry(flight))
    assert np.nanmax(unpack(series(drawn["errors"], "attitude_qw")["v"])) == pytest.approx(10.0, abs=0.01)


def test_shares_and_counts_of_an_audit(flight, make):
    entry = make.entry(flight)
    assert share_valid(entry, "estimator") == pytest.approx(0.75)
    assert share_valid(entry, "battery") == 1.0
    assert share_clean(entry) == pytest.approx(0.75)
    assert fault_counts(entry) == {"dead_stream": 1, "spike": 1}
    assert total([[0, 2], [1, 3]]) == 3.0
    assert total(None) is None


def test_faults_are_listed_with_dashes_for_sizes_that_make_no_sense(flight, make):
    listed = payload(flight, make.entry(flight))["faults"]["rows"]
    assert listed[0][0] == "spike"
    assert listed[0][3] == "–"
    assert listed[1] == ["dead_stream", "estimator", "15.00–20.00", "5.00 s", "a straight line to the end"]
