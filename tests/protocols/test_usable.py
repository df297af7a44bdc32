"""Faulty rows and missing columns: scored without them, or left out with a reason, never silently."""

from dataclasses import replace

import numpy as np
import pytest
from made_flights import cut, dead, made_flight, verdict

from estimators.onboard_ekf import OnboardEkf
from identification.naive import Naive
from nanobench_tools import InputError
from nanobench_tools.auditing.usable import left_out, missing, tidy
from nanobench_tools.auditing.verb_needs import CONTROL, ESTIMATE
from nanobench_tools.protocols import task1, task2, task3
from nanobench_tools.results.fitted_values import LeftOut


def spoiled(flight, stream, rows, column=0, value=np.nan):
    values = flight[stream].values.copy()
    values[rows, column] = value
    return flight.with_streams(**{stream: replace(flight[stream], values=values)})


def score_all(flight):
    audits = {flight.name: verdict(flight)}
    estimate = task3.score(task3.select([flight], audits, "clean")[0], OnboardEkf(), "clean").metrics
    control = task2.score(task2.select([flight], audits, "clean")[0]).metrics
    other = made_flight("first", epoch_s=1e8, seed=9)
    case = task1.split([other, flight], {**audits, "first": verdict(other)}).test[0]
    predicted = task1.score(case, Naive(), "onboard")
    return estimate["ate_unaligned_rmse_m"], control["rmse_m"], np.sum(predicted.sums["position_mae_m"])


@pytest.mark.parametrize("stream", ["mocap", "estimator", "attitude_qw", "setpoint", "motor", "imu", "battery"])
def test_rows_without_numbers_hardly_change_a_score(stream):
    flight = made_flight()
    clean = score_all(flight)
    holed = score_all(spoiled(flight, stream, [900, 1100, 1101, 1500]))
    assert holed == pytest.approx(clean, rel=0.15)
    assert np.isfinite(holed).all()


def test_stamps_that_do_not_rise_are_left_out():
    flight = made_flight()
    mocap = flight["mocap"]
    time_s = mocap.time_s.copy()
    time_s[[800, 801]] = time_s[799]
    time_s[1200] = time_s[1100]
    bad = flight.with_streams(mocap=replace(mocap, time_s=time_s))
    assert len(tidy(bad, ESTIMATE)["mocap"]) == len(mocap) - 3
    assert tidy(flight, ESTIMATE) is flight
    assert score_all(bad)[0] == pytest.approx(score_all(flight)[0], rel=0.05)


def test_what_is_missing_is_said():
    flight = made_flight()
    assert missing(flight, ESTIMATE) is None
    assert missing(flight.without_streams("setpoint"), CONTROL) == "no setpoint stream"
    bare = flight.without_streams("attitude", "attitude_qw")
    assert missing(bare, ESTIMATE) == "no attitude_qw or attitude stream"
    mocap = flight["mocap"]
    slim = replace(mocap, values=mocap.values[:, :10], columns=mocap.columns[:10], quantities=mocap.quantities[:10],
                   unit=mocap.unit[:10])
    assert missing(flight.with_streams(mocap=slim), ESTIMATE) == "no vx, vy, vz in the mocap stream"


def test_left_out_recordings_have_a_reason():
    whole, other = made_flight("whole"), made_flight("other", seed=1, epoch_s=2e9)
    empty = spoiled(made_flight("empty", seed=2, epoch_s=3e9), "estimator", slice(None))
    flights = [whole, cut(whole, 3.0, 9.0), other, empty, made_flight("unknown", seed=3, epoch_s=4e9)]
    audits = {f.name: verdict(f) for f in flights[:-1]}
    found = {entry.flight: entry.reason for entry in left_out(flights, ["whole"], audits, ESTIMATE)}
    assert found["piece"] == "slice of whole"
    assert found["unknown"] == "the audit failed"
    assert found["empty"] == "no readable rows in the estimator stream"
    assert "no rows to score" in found["other"]
    with pytest.raises(InputError, match="no flight"):
        task3.select([empty], audits, "clean", ESTIMATE)


@pytest.mark.parametrize("kind", ["unit", "quaternion_order", "sign"])
def test_the_fault_that_cut_a_flight_is_said(kind):
    flight = made_flight()
    audits = {flight.name: verdict(flight, replace(dead("mocap", 0.0), kind=kind))}
    for protocol in task3.PROTOCOLS[1:]:
        with pytest.raises(InputError, match=rf"made\.csv: no .* is left .*: 1 cut by {kind} of mocap; nano"):
            task3.select([flight], audits, protocol)
    unseen = {"made": replace(audits["made"], airborne=())}  # nor can a bad truth tell that it flew
    for known in (audits, unseen):
        assert left_out([flight], [], known, ESTIMATE) == [LeftOut("made", f"cut by {kind} of mocap")]


def test_reasons_that_the_verb_knows_go_first():
    flight = made_flight()
    found = left_out([flight], [], {flight.name: verdict(flight)}, ESTIMATE, {"made": "every method failed on it"})
    assert found == [LeftOut("made", "every method failed on it")]
