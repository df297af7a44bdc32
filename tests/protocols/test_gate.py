"""The gate: what passes, what fails and by how much; who may judge; a practice flight whose truth is known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from made_flights import LAND_S, LIFT_S, made_flight, verdict

from controllers.plants.gate_flights import fly_cases
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.cli.main import main
from nanobench_tools.errors import UsageError
from nanobench_tools.firmware.thrust_curve import COEFFICIENTS
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.simulator import dumps
from nanobench_tools.practice.vehicle_parameters import VEHICLE
from nanobench_tools.protocols import gate
from nanobench_tools.protocols.simulated import ErrorBar, Paths, Runs, recovery, score, specs_of, tabulate
from nanobench_tools.results.result import from_json, to_json
from nanobench_tools.sources.nanobench_writer import write_nanobench


@pytest.fixture(scope="module")
def case():
    flight = made_flight()
    (one,), _ = gate.select([flight], {flight.name: verdict(flight)})
    return one


def truth(case, later_s=0.0):
    return case.flight["mocap"].interpolate(("px", "py", "pz"), case.time_s - later_s)


def motor(case):
    return case.flight["motor"].interpolate(gate.MOTORS, case.time_s)


def test_the_flight_itself_passes(case):
    row = gate.score(case, truth(case), motor(case))
    assert row.passed
    assert row.reason == ""
    assert (row.ratio, row.lag_diff_s, row.path_gap_m) == pytest.approx((1.0, 0.0, 0.0), abs=1e-9)
    assert row.pwm_rms["3-20 Hz"][0] == row.pwm_rms["3-20 Hz"][1]
    assert row.lag_real_s == pytest.approx(0.5, abs=0.02)
    assert len(repr(row)) < 400
    assert to_json(row)["pass"] is True
    assert from_json(gate.GateRow, to_json(row)) == row


def test_a_later_flight_fails_and_the_report_says_by_how_much(case):
    row = gate.score(case, truth(case, 0.1), motor(case))
    assert not row.passed
    assert row.lag_diff_s == pytest.approx(0.1, abs=0.005)
    assert "lag " in row.reason
    assert "+100 ms, allowed 30" in row.reason
    assert "RMSE" in row.reason
    aside = gate.score(case, truth(case) + np.array([0.0, 0.0, 0.08]), motor(case))
    assert aside.path_gap_m == pytest.approx(0.08)
    assert "paths 8.0 cm apart, allowed 5" in aside.reason
    assert "motors at" not in row.reason
    harder = gate.score(case, truth(case, 0.1), 1.05 * motor(case))
    assert "at the same height: the plant lifts less" in harder.reason
    fallen = gate.score(case, truth(case) - np.array([0.0, 0.0, 1.0]), 0.5 * motor(case))
    assert fallen.pwm_mean is None  # a vehicle on the ground says nothing of its lift
    assert "motors at" not in fallen.reason
    found = gate.summary([gate.score(case, truth(case), motor(case)), row])
    assert found["pid"].n == 2
    assert found["pid"].lag_share == 0.5
    assert found["all"].ratio_off_median > 0.0


@pytest.mark.parametrize(("synthetic", "word"), [(False, " real: "), (True, " SYNTHETIC: ")])
def test_what_is_said_of_a_recording_is_real_only_if_it_is(case, synthetic, word):
    flight = replace(case.flight, provenance=replace(case.flight.provenance, synthetic=synthetic))
    mine = replace(case, flight=flight)
    row = gate.score(mine, truth(case, 0.1), motor(case))
    assert row.synthetic is synthetic
    assert row.reason.count(word) == 2
    path = np.column_stack([case.time_s, truth(case, 0.1)]).tolist()
    (shown,) = gate.pictured([row], [mine], {flight.name: path})
    assert shown.synthetic is synthetic


def test_what_the_planner_asks_has_a_velocity_and_what_is_streamed_has_none(case):
    place, yaw, velocity = gate.setpoints(case)
    t = case.time_s
    assert velocity[(t > LIFT_S + 0.3) & (t < LIFT_S + 1.5), 2] == pytest.approx(0.5, abs=0.01)
    streamed = (t > 5.5) & (t < LAND_S - 0.5)
    assert not velocity[streamed].any()
    assert place.shape == (case.ticks, 3)
    assert not yaw.any()


def test_recordings_the_plant_was_made_from_do_not_judge_it():
    flights = [made_flight(f"f{i}", epoch_s=1e9 + 1000.0 * i, seed=i) for i in range(3)]
    audits = {f.name: verdict(f) for f in flights}
    audits["f2"] = verdict(flights[2], controller="unknown")
    cases, reasons = gate.select(flights, audits, [(1e9 - 5.0, 1e9 + 1.0)])
    assert [c.flight.name for c in cases] == ["f1"]
    assert reasons["f0"] == "the plant was identified from it"
    assert "not a controller of the firmware" in reasons["f2"]


def test_the_radio_is_silent_on_the_stamps_of_the_receiver():
    """Of a flight that was moved to another clock, gaps are read from the recording."""
    flight = made_flight()
    t = 0.01 * np.arange(len(flight["imu"]))

    def on(stamps):
        rng, made = np.random.default_rng(1), {}
        for name in ("imu", "motor"):
            values = flight[name].values + rng.normal(0.0, 0.01, flight[name].values.shape)
            values[701:706] = values[700] + np.outer(np.arange(1, 6) / 6.0, values[706] - values[700])
            made[name] = replace(flight[name], values=values, time_s=stamps)
        return flight.with_streams(**made)

    recorded, moved = on(t), on(t - 0.2)
    audits = {flight.name: verdict(flight)}
    for flights, given in (([recorded], []), ([moved], [recorded])):
        (case,), _ = gate.select(flights, audits, (), given)
        assert [(s.start_s, s.end_s) for s in case.silent] == [(t[700], t[706])]


def test_what_nanobench_fly_recorded_judges_if_it_was_told_positions():
    flights = [made_flight(f"f{i}", epoch_s=1e9 + 1000.0 * i, seed=i) for i in range(2)]
    flights[1] = replace(flights[1], metadata={**flights[1].metadata, "setpoints": "velocity"})
    audits = {f.name: verdict(f, controller="onboard_pid") for f in flights}
    cases, reasons = gate.select(flights, audits)
    assert [(c.flight.name, c.controller) for c in cases] == [("f0", "pid")]
    assert "setpoints of velocity" in reasons["f1"]


def simulator():
    v = Vehicle()
    drag = [v.mass_kg * VEHICLE[f"drag_{way}_1_s"].value for way in ("lateral", "lateral", "vertical")]
    tau = VEHICLE["motor_tau_s"].value
    return dumps(Model(v, {
        "thrust_voltage": {"c": COEFFICIENTS}, "thrust_scale": {"s": VEHICLE["thrust_scale"].value},
        "motor_lag": {"tau_up_s": tau, "tau_down_s": tau}, "yaw_torque": {"k_m": VEHICLE["yaw_arm_m"].value},
        "drag_linear": {"d": drag}, "drag_torque": {"c": VEHICLE["drag_torque_N_s"].value}}))


@pytest.mark.parametrize("name", ["short circle", pytest.param("short helix", marks=pytest.mark.slow)])
@pytest.mark.slow
def test_a_practice_flight_whose_vehicle_is_known_passes(crowd, name):
    flight = crowd.flight(name)
    cases, _ = gate.select([flight], {flight.name: audit(flight)})
    found = fly_cases(cases, simulator())
    (row,) = found.rows
    assert row.reason == ""
    assert row.ratio == pytest.approx(1.0, abs=0.05)
    assert abs(row.z_bias_sim_m - row.z_bias_real_m) < 0.03
    assert len(found.paths[flight.name][0]) == 8


def test_paths_begin_at_rest_and_are_scored_after_they_settled():
    paths = Paths(tuple(specs_of(["figure_eight", "linear_ramp"], [1.0, 0.5], 6.0)))
    assert [s.family for s in paths.specs] == ["figure_eight", "figure_eight", "linear_ramp"]
    assert not paths.all[1][:390].any()
    assert np.array_equal(paths.all[0][0], paths.all[0][399])
    rows = paths.scored(0)
    assert (rows.start, rows.stop) == (700, 1000)
    with pytest.raises(UsageError, match=r"unknown trajectory 'square'.*known: circle"):
        specs_of(["square"], [])


def test_a_flight_on_its_path_scores_zero_and_a_late_one_its_lag():
    paths = Paths(tuple(specs_of(["circle"], [1.0], 8.0)))
    goal, speed = (np.concatenate([x, np.roll(x, 20, axis=0)], axis=1) for x in paths.all[:2])

    class Flown:
        position_m, velocity_m_s = goal, speed
        quaternion = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (len(goal), 2, 4))
        motor = np.full((len(goal), 2, 4), 0.8)
        call_s = np.array([1e-4] * 99 + [1.0])

    on, late = score(Flown, paths, 2, 0.002)[0]
    assert on["rmse_m"] == pytest.approx(0.0, abs=1e-12)
    assert late["lag_s"] == pytest.approx(0.2, abs=1e-3)
    assert late["rmse_m"] == pytest.approx(2 * np.sin(0.1), rel=1e-3)
    assert late["contour_rmse_m"] < 1e-3
    assert on["deadline_missed_percent"] == pytest.approx(1.0)
    (row,) = tabulate([Runs("c", "preview", [[on, late]])], paths.specs, ErrorBar(0.04, 0.1, 0.02, 5, "a gate"))
    assert row.metrics["worst_decile_m"] == late["rmse_m"]
    assert row.error_bar.rmse_share == 0.04
    assert "gust" not in to_json(row)
    assert len(repr(row)) < 400


def test_recovery_is_when_it_stays_back():
    t = 0.01 * np.arange(400)
    calm = np.zeros((400, 2, 3))
    bent = calm.copy()
    bent[100:250, 0, 1] = 0.3
    bent[100:, 1, 1] = 0.2
    first, second = recovery(bent, calm, t, 1.0)
    assert (first.most_m, first.back_s) == (0.3, pytest.approx(1.49))
    assert np.isnan(second.back_s)


@pytest.mark.slow
def test_control_flies_the_gate_and_simulated_rows(crowd, tmp_path, capsys):
    flight = crowd.flight("short circle")
    write_nanobench(flight, tmp_path / "in" / f"{flight.name}.csv")
    (tmp_path / "sim.toml").write_text(simulator())
    out = tmp_path / "out"
    code = main(["control", "--data", str(tmp_path / "in"), "--plant", "gate", "--plant", "simulated", "--controller",
                 "lead_pid", "--trajectory", "circle", "--speed", "0.5", "--seconds", "7", "--plants", "2",
                 "--simulator", str(tmp_path / "sim.toml"), "--out", str(out), "--jobs", "1"])
    text = capsys.readouterr()
    assert code == 0, text.err
    result = json.loads((out / "control.json").read_text())
    (judged,) = result["gate"]
    assert judged["pass"], judged["reason"]
    assert (out / "trajectories" / "gate" / f"{flight.name}.tum").exists()
    (row,) = result["rows"]
    assert (row["plant"], row["controller"], row["information"], row["n"]) == ("simulated", "lead_pid", "lead", 2)
    assert row["error_bar"]["n"] == 1
    assert 0.0 < row["metrics"]["rmse_m"] < 0.3
    assert set(row["gust"]) == {"most_m", "back_s"}
    assert "SYNTHETIC data: SIMULATED" in text.out


@pytest.mark.slow
def test_a_plant_identified_from_recordings_flies(crowd, tmp_path, capsys):
    flight = crowd.flight("slow figure_eight")
    write_nanobench(flight, tmp_path / "in" / f"{flight.name}.csv")
    code = main(["control", "--train", str(tmp_path / "in"), "--plant", "simulated", "--controller", "lead_pid",
                 "--trajectory", "circle", "--speed", "0.5", "--seconds", "7", "--plants", "2", "--out",
                 str(tmp_path / "out"), "--jobs", "1"])
    assert code == 0, capsys.readouterr().err
    result = json.loads((tmp_path / "out" / "control.json").read_text())
    assert "identified from 1 recordings" in result["simulated_plant"]
    (row,) = result["rows"]
    assert row["error_bar"] is None  # no flight has judged this plant
    assert row["metrics"]["lost_percent"] == 0.0


@pytest.mark.parametrize(("arguments", "words"), [
    (["--plant", "simulated", "--controller", "no_such"], "unknown controller 'no_such'"),
    (["--plant", "simulated", "--trajectory", "square"], "unknown trajectory 'square'"),
    (["--plant", "simulated", "--seconds", "6"], "a path of 6 s is too short"),
    (["--plant", "simulated", "--wind", "nan"], "nan is not a finite number"),
    (["--plant", "simulated", "--radio-silent", "nan"], "nan is not a finite number"),
    (["--simulator", "a.toml", "--train", "b"], "both choose the plant"),
    (["--plant", "gate", "--simulator", "absent.toml"], "cannot be read")])
def test_wrong_plants_are_one_line(arguments, words, capsys):
    assert main(["control", *arguments]) == 2
    err = capsys.readouterr().err
    assert words in err
    assert err.count("\n") == 1
