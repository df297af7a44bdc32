"""The Kalman filter against every number that the firmware's own computed, within the tolerances given with them."""

import functools

import numpy as np
import pytest
from firmware_tables import columns, read

from estimators.firmware_ekf import FirmwareEkf
from nanobench_tools.firmware import kalman, stabilizer
from nanobench_tools.firmware.kalman_task import MEASUREMENT, RUN, TASK, run_task
from nanobench_tools.sources import load_recordings

pytestmark = pytest.mark.real
STATES = ("X", "Y", "Z", "PX", "PY", "PZ", "D0", "D1", "D2")
UPPER = np.triu_indices(9)
KINDS = {"init": kalman.INIT, "reset": kalman.INIT, "predict": kalman.PREDICT, "noise": kalman.NOISE,
         "position": kalman.POSITION, "pose": kalman.POSE, "finalize": kalman.FINALIZE}
INITIAL = {"ground_then_lift": {"initial_yaw_rad": 0.5}, "synthetic_flight_irregular": {"initial_m": [0.0, 0.0, 1.0]},
           "edge_cases_no_reversion_alt_noise": {"reversion": 0.0, "acc_xy_m_s2": 1.5, "velocity_m_s": 0.02,
                                                 "position_m": 0.001, "attitude_rad": 0.003, "gyro_yaw_rad_s": 0.3,
                                                 "initial_yaw_rad": -1.0, "initial_m": [0.4, 0.0, 0.0]}}
table = functools.lru_cache(maxsize=4)(read)


def parameters(sequence):
    found = kalman.defaults()
    for name, value in INITIAL.get(sequence, {}).items():
        found[name] = value
    return found


def numbered(letter, told):
    """State, quaternion, rotation and covariance of the unit table, before (``b``) or after (``a``)."""
    core = np.zeros(len(told["case"]), kalman.CORE)
    core["state"] = columns(told, *(f"{letter}_S_{name}" for name in STATES))
    core["quaternion"] = columns(told, *(f"{letter}_q{c}" for c in "wxyz"))
    for i in range(3):
        core["rotation"][:, i] = columns(told, *(f"{letter}_R{i}{j}" for j in range(3)))
    upper = columns(told, *(f"{letter}_P{i}{j}" for i, j in zip(*UPPER, strict=True)))
    core["covariance"][:, *UPPER] = upper
    core["covariance"][:, *UPPER[::-1]] = upper
    return core


def relative(found, told):
    return float(np.max(np.abs(found.astype(float) - told) / np.maximum(1.0, np.abs(told)), initial=0.0))


def test_single_operations(real_data):
    told = table(real_data, "kalman_unit.csv.xz")
    before, after = numbered("b", told), numbered("a", told)
    before["initial"] = columns(told, *(f"b_initq{c}" for c in "wxyz"))
    given = columns(told, *(f"in{k}" for k in range(9)))
    seen = dict.fromkeys(np.unique(told["op"]), 0)
    for i, name in enumerate(told["op"]):
        core = before[i:i + 1]
        core["updated"] = name != "finalize" or told["finalize_returned"][i]
        steps = np.zeros(2 if name == "pose_finalize" else 1, kalman.OPERATION)
        steps["kind"][0], steps["kind"][1:] = KINDS[name.split("_")[0]], kalman.FINALIZE
        steps["flying"], steps["t_ms"], steps["value"] = told["flying"][i], told["dt_ms"][i], given[i]
        kalman.run_operations(steps, kalman.defaults(), core, np.zeros(len(steps), kalman.CORE))
        for field in ("state", "quaternion", "rotation"):
            assert relative(core[field], after[field][i:i + 1]) < 2e-6, (i, name, field)
        wanted = after["covariance"][i][UPPER]
        off = np.abs(core["covariance"][0][UPPER].astype(float) - wanted)
        assert off.max() / np.abs(wanted).max() < 2e-6, (i, name)
        seen[name] += 1
    assert seen == {"finalize": 80, "noise": 80, "pose": 80, "pose_finalize": 80, "position": 80, "predict": 160}


def runs_of(told):
    """(m,) RUN of an IMU table; a table of 10 ms rows holds each of them for ten runs."""
    held = "t_ms_first" in told
    repeat = 10 if held else 1
    runs = np.zeros(len(told["flying"]) * repeat, RUN)
    ticks = told["t_ms_first"] if held else told["t_ms"]
    runs["t_ms"] = np.repeat(ticks, repeat) + np.tile(np.arange(repeat), len(ticks))
    runs["flying"] = np.repeat(told["flying"], repeat)
    runs["acc_g"] = np.repeat(columns(told, *(f"acc_{a}_g" for a in "xyz")), repeat, axis=0)
    runs["gyro_deg_s"] = np.repeat(columns(told, *(f"gyro_{a}_dps" for a in "xyz")), repeat, axis=0)
    return runs


def measurements_of(told):
    """(j,) MEASUREMENT: the pose and position rows of a sequence."""
    rows = np.flatnonzero(np.isin(told["op"], ("pose", "position")))
    found = np.zeros(len(rows), MEASUREMENT)
    found["t_ms"], found["attitude"] = told["t_ms"][rows], told["op"][rows] == "pose"
    given = columns(told, *(f"in{k}" for k in range(9)))[rows]
    found["position_m"], found["quaternion"] = given[:, :3], given[:, 3:7]
    found["position_sd_m"], found["attitude_sd_rad"] = given[:, 7], given[:, 8]
    return found


def compared(core, told, rows, tolerance, of_covariance):
    state = columns(told, *(f"S_{name}" for name in STATES))[rows]
    assert relative(core["state"][:, :6], state[:, :6]) < tolerance
    small = np.abs(state[:, 6:]) < 5.0
    assert np.abs(core["state"][:, 6:].astype(float) - state[:, 6:])[small].max() < tolerance
    assert relative(core["quaternion"], columns(told, *(f"q{c}" for c in "wxyz"))[rows]) < tolerance
    diagonal = columns(told, *(f"P_{name}" for name in STATES))[rows]
    found = np.diagonal(core["covariance"], axis1=1, axis2=2)
    assert np.max(np.abs(found.astype(float) - diagonal) / diagonal) < of_covariance


@pytest.mark.parametrize(("sequence", "imu", "finalized", "tolerance", "of_covariance"), [
    ("ground_then_lift", "ground_then_lift", 470, 1e-5, 1e-4),
    ("synthetic_flight_irregular", "synthetic_flight_irregular", 718, 1e-5, 1e-4),
    ("real_B3_figure8_fast_rep1_no_delay", "real_B3_figure8_fast_rep1_no_delay", 2670, 1e-5, 1e-4),
    ("real_B3_figure8_fast_rep1_delay30ms", "real_B3_figure8_fast_rep1_no_delay", 2670, 1e-5, 1e-4),
    ("real_B9_trefoil_medium_rep14_no_delay", "real_B9_trefoil_medium_rep14_no_delay", 1200, 1e-5, 1e-4),
    ("edge_cases", "edge_cases", 265, 1e-3, 1e-3),
    ("edge_cases_no_reversion_alt_noise", "edge_cases", 265, 1e-3, 1e-3)])
def test_the_task_gives_every_finalized_state_back(real_data, sequence, imu, finalized, tolerance, of_covariance):
    """Only IMU samples and poses go in: when to predict, add noise, start anew is the task's own business."""
    told = table(real_data, f"kalman_seq_{sequence}.csv.xz")
    runs = runs_of(table(real_data, f"kalman_seq_{imu}_imu.csv.xz"))
    rows = np.flatnonzero(told["op"] == "finalize")
    assert len(rows) == finalized
    at = np.searchsorted(runs["t_ms"], told["t_ms"][rows])
    assert np.array_equal(runs["t_ms"][at], told["t_ms"][rows])
    task, out = np.zeros(1, TASK), np.zeros(len(rows), kalman.CORE)
    run_task(runs, measurements_of(told), parameters(sequence), task, at, out)
    compared(out, told, rows, tolerance, of_covariance)
    assert task["resets"][0] == np.sum(told["op"] == "reset")
    assert task["refused"][0] == 0


def test_edge_cases_call_by_call(real_data):
    """The sequence that shows every call, with its states between them."""
    told = table(real_data, "kalman_seq_edge_cases.csv.xz")
    calls = np.zeros(len(told["op"]), kalman.OPERATION)
    calls["kind"] = [KINDS[name] for name in told["op"]]
    calls["flying"], calls["t_ms"] = told["flying"], told["t_ms"]
    calls["value"] = columns(told, *(f"in{k}" for k in range(9)))
    core, trace = np.zeros(1, kalman.CORE), np.zeros(len(calls), kalman.CORE)
    kalman.run_operations(calls, kalman.defaults(), core, trace)
    compared(trace, told, slice(None), 1e-3, 1e-3)
    np.testing.assert_array_equal(trace["updated"], told["is_updated"])


def test_defaults_and_first_state(real_data):
    told = table(real_data, "kalman_defaults.csv")
    value = dict(zip(told["name"], told["value"].astype(np.float32), strict=True))
    names = {"sd_xy_m": "stdDevInitialPosition_xy", "sd_z_m": "stdDevInitialPosition_z",
             "sd_velocity_m_s": "stdDevInitialVelocity", "sd_tilt_rad": "stdDevInitialAttitude_rollpitch",
             "sd_yaw_rad": "stdDevInitialAttitude_yaw", "acc_xy_m_s2": "procNoiseAcc_xy",
             "acc_z_m_s2": "procNoiseAcc_z", "velocity_m_s": "procNoiseVel", "position_m": "procNoisePos",
             "attitude_rad": "procNoiseAtt",
             "gyro_tilt_rad_s": "measNoiseGyro_rollpitch", "gyro_yaw_rad_s": "measNoiseGyro_yaw",
             "initial_yaw_rad": "initialYaw", "reversion": "attitudeReversion"}
    start = kalman.defaults()[0]
    for own, theirs in names.items():
        assert start[own] == value[theirs], own
    assert np.float32(kalman.POSITION_SD_M) == value["extPosStdDev_default"]
    assert np.float32(kalman.ATTITUDE_SD_RAD) == value["extQuatStdDev_default"]
    for yaw in (0.0, 0.5, -2.0, 3.0):
        given, core = kalman.defaults(), np.zeros(1, kalman.CORE)
        given["initial_yaw_rad"] = yaw
        kalman.run_operations(np.zeros(1, kalman.OPERATION), given, core, np.zeros(1, kalman.CORE))
        prefix = f"initialYaw_{yaw:g}_q" if yaw else "init_q"
        assert np.allclose(core["quaternion"][0], [value[prefix + c] for c in "wxyz"], rtol=0.0, atol=1e-7)
    assert np.array_equal(np.diag(core["covariance"][0]), [value[f"init_P_{name}"] for name in STATES])
    assert np.array_equal(core["rotation"][0], np.eye(3))


def test_sine_of_the_table(real_data):
    told = table(real_data, "arm_sin_cos.csv")
    angle = told["x_rad"].astype(np.float32)
    for function, name in ((kalman.sine, "arm_sin"), (kalman.cosine, "arm_cos")):
        assert np.max(np.abs(np.array([function(a) for a in angle]) - told[name])) < 5e-7


def test_what_controllers_are_told(real_data):
    told = table(real_data, "kalman_externalize.csv")
    core = np.zeros(len(told["case"]), kalman.CORE)
    core["state"] = columns(told, *(f"S_{name}" for name in STATES))
    core["quaternion"] = columns(told, *(f"q{c}" for c in "wxyz"))
    for i in range(3):
        core["rotation"][:, i] = columns(told, *(f"R{i}{j}" for j in range(3)))
    found = np.zeros(len(core), stabilizer.LOOP)
    found["acc_g"] = columns(told, *(f"acc_{a}_g" for a in "xyz"))
    for vehicle, believed in zip(found, core, strict=True):
        stabilizer.believe(vehicle, believed)
    estimate = found["estimate"]
    for field, names in (("position_m", "xyz"), ("velocity_m_s", ("vx", "vy", "vz")),
                         ("acceleration_g", ("accx_g", "accy_g", "accz_g")), ("quaternion", ("qx", "qy", "qz", "qw"))):
        where = found if field == "acceleration_g" else estimate
        assert relative(where[field], columns(told, *(f"out_{name}" for name in names))) < 2e-6, field
    upright = told["case"] % 20 != 19
    angles = columns(told, "out_roll_deg", "out_pitch_legacy_deg", "out_yaw_deg")
    off = (estimate["attitude_deg"] - angles + 180.0) % 360.0 - 180.0
    assert np.abs(off[upright]).max() < 1e-3
    assert np.abs(off[:, 1]).max() < 0.05


def test_a_recording_gives_the_firmware_s_numbers(real_data):
    """12 s of a flight: poses, IMU and motors as recorded, against the released code fed with the same rows."""
    folder = real_data / "nanobench" / "datasets" / "dataset"
    recorded = load_recordings(sorted(folder.glob("B9_trefoil_medium_rep14*"))).flights[0]
    told = read(real_data, "kalman_seq_real_B9_trefoil_medium_rep14_no_delay.csv.xz")
    rows = told["op"] == "finalize"
    found = FirmwareEkf(kalman.defaults(), held=True).estimate(recorded)
    n = int(np.sum(rows))
    assert n == 1200
    assert np.abs(found.position_m[:n] - columns(told, "S_X", "S_Y", "S_Z")[rows]).max() < 1e-5
    assert np.abs(found.quaternion[:n] - columns(told, "qx", "qy", "qz", "qw")[rows]).max() < 1e-5
