"""The exported filter: its C against its Python and against the truth, on invalid inputs, and within a vehicle."""

import ctypes
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimators import inertial
from estimators.filter_app import RECORDED, SETTINGS, costs, write_filter
from nanobench_tools.sources import load_recordings

pytestmark = pytest.mark.skipif(not (shutil.which("cc") and shutil.which("make")),
                                reason="NO C COMPILER OR MAKE: the exported filter is not tested")
STUB = Path(__file__).parents[1] / "firmware_stub"
STRICT = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wdouble-promotion", "-Wfloat-conversion"]
WITHIN = 1e-4
"""m, m/s and 1: what a state of C and of Python may differ by."""
TRUTH = slice(100, None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    found = tmp_path_factory.mktemp("filter")
    write_filter(found)
    return found


@pytest.fixture(scope="module")
def library(folder):
    return built(folder)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The filter with a delay of the poses as a state."""
    found = tmp_path_factory.mktemp("recorded")
    write_filter(found, RECORDED)
    return built(found)


def built(folder):
    subprocess.run(["make", "-s", "-C", str(folder), "host"], check=True, capture_output=True, text=True)
    found = ctypes.CDLL(str(folder / "build-host" / "libdrag_filter.so"))
    found.drag_filter_step.argtypes = [ctypes.c_float, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_bool, ctypes.c_void_p,
                                       ctypes.c_int, ctypes.c_void_p]
    found.drag_filter_start.argtypes = [ctypes.c_void_p]
    found.drag_filter_start.restype = found.drag_filter_running.restype = ctypes.c_bool
    return found


def begun(library, pose):
    return library.drag_filter_start(np.array([*pose, 0.0], np.float32).ctypes.data)


def stepped(library, dt_s, acc, gyro, poses=(), flying=True):
    """State (10,) after a row; poses (k, 8) with their ages."""
    out, poses = np.zeros(10, np.float32), np.array(poses, np.float32).reshape(-1, 8)
    acc, gyro = np.array(acc, np.float32), np.array(gyro, np.float32)
    library.drag_filter_step(dt_s, acc.ctypes.data, gyro.ctypes.data, flying, poses.ctypes.data, len(poses),
                             out.ctypes.data)
    return out


def filtered(library, rows):
    """(n, 10) by C."""
    assert begun(library, rows.poses[0])
    found = []
    for i, time_s in enumerate(rows.time_s):
        new = slice(rows.arrived[i], rows.arrived[i + 1])
        poses = np.column_stack([rows.poses[new], time_s - rows.pose_s[new]])
        dt_s = time_s - rows.time_s[i - 1] if i else 0.0
        found.append(stepped(library, dt_s, rows.acc[i], rows.gyro[i], poses, bool(rows.flying[i])))
    return np.array(found)


def difference(library, rows, settings=SETTINGS):
    """(n,): the largest difference of C and Python in any state."""
    python = inertial.run(rows, inertial.values_of(settings), False)
    c = filtered(library, rows)
    q = python.quaternion * np.sign(np.sum(python.quaternion * c[:, 6:], axis=1))[:, None]
    return np.abs(c - np.hstack([python.position_m, python.velocity_m_s, q])).max(axis=1), c


def circles(seconds, every=1, late_s=0.0, noise_m=3e-4, step_s=0.0101):
    """A vehicle with drag on circles of varying height whose nose goes round, and poses every so many rows.

    Rows, and the true position and velocity (n, 6). No multiple of ``step_s`` is near the setting change_s, where
    rounding decides."""
    rng, t = np.random.default_rng(1), step_s * np.arange(round(seconds / step_s))
    w, v = 1.5, 0.7
    position = np.column_stack([np.cos(w * t), np.sin(w * t), 1.0 + 0.3 * np.sin(v * t)])
    velocity = np.column_stack([-w * np.sin(w * t), w * np.cos(w * t), 0.3 * v * np.cos(v * t)])
    push = np.column_stack([-w * w * np.cos(w * t), -w * w * np.sin(w * t), 9.81 - 0.3 * v * v * np.sin(v * t)])
    push[:, :2] += SETTINGS["drag"] * velocity[:, :2]
    z = push / np.linalg.norm(push, axis=1, keepdims=True)
    y = np.cross(z, np.column_stack([np.cos(0.4 * t), np.sin(0.4 * t), 0.0 * t]))
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    turn = Rotation.from_matrix(np.stack([np.cross(y, z), y, z], axis=-1))
    feels = push - np.column_stack([SETTINGS["drag"] * velocity[:, :2], 0.0 * t])
    acc = turn.inv().apply(feels) + 0.02 * rng.standard_normal((len(t), 3)) + [0.05, -0.03, 0.1]
    gyro = np.gradient(turn.as_rotvec(), t, axis=0)  # replaced below: a rotation vector is no integral of rates
    gyro[1:-1] = (turn[:-2].inv() * turn[2:]).as_rotvec() / (2.0 * step_s)
    gyro[[0, -1]] = gyro[[1, -2]]
    gyro = gyro + 0.01 * rng.standard_normal((len(t), 3)) + [0.01, 0.02, -0.01]
    at = np.arange(0, len(t), every)
    poses = np.hstack([position[at] + noise_m * rng.standard_normal((len(at), 3)), turn.as_quat()[at]])
    arrived = np.concatenate(([0], np.searchsorted(t[at] + late_s, t, side="right")))
    rows = inertial.Rows(t, t, acc, gyro, 0.0 * t, np.ones(len(t), bool), arrived.astype(np.int64), t[at], poses)
    return rows, np.hstack([position, velocity])


def test_c_is_python_and_both_are_near_the_truth(library):
    rows, truth = circles(60.0)
    off, c = difference(library, rows)
    assert off.max() < WITHIN
    assert np.abs(c[TRUTH, :3] - truth[TRUTH, :3]).max() < 0.005
    assert np.abs(c[TRUTH, 3:6] - truth[TRUTH, 3:]).max() < 0.06


@pytest.mark.parametrize("late_s", [0.03, 0.25])
def test_late_and_rare_poses(library, recorded, late_s):
    rows, truth = circles(40.0, every=10, late_s=late_s, noise_m=0.0)
    assert difference(recorded, rows, RECORDED)[0].max() < WITHIN
    off, c = difference(library, rows)
    assert off.max() < WITHIN
    assert np.abs(c[1000:, :3] - truth[1000:, :3]).max() < 0.1


def test_poses_in_bursts_between_rows_and_rows_that_are_missing(library):
    rows, _ = circles(40.0)
    arrived = rows.arrived.copy()
    arrived[:-1] -= arrived[:-1] % 3  # three at a time
    good = np.random.default_rng(2).random(len(rows.time_s)) > 0.2
    good[:2] = True
    later = np.append(arrived[:-1][good], arrived[-1])
    some = replace(rows, **{name: getattr(rows, name)[good] for name in ("time_s", "clock_s", "acc", "gyro", "drawn",
                                                                         "flying")},
                   arrived=later, pose_s=rows.pose_s + 0.004)  # not on a row, some after the newest
    assert difference(library, some)[0].max() < WITHIN


def test_twenty_seconds_without_a_pose(library):
    rows, _ = circles(40.0)
    dark = rows.arrived.copy()
    dark[2000:] = dark[2000]
    off = difference(library, replace(rows, arrived=dark))[0]
    assert off[:2000].max() < WITHIN
    assert off.max() < 1e-3  # a rounded tilt grows with the square of the time


@pytest.mark.slow
def test_ten_minutes(library):
    rows, truth = circles(600.0, every=10, noise_m=1e-3)
    off, c = difference(library, rows)
    assert off.max() < WITHIN
    assert np.abs(c[TRUTH, :3] - truth[TRUTH, :3]).max() < 0.02


@pytest.mark.real
def test_recordings(recorded, real_data):
    files = sorted((real_data / "nanobench").rglob("B[357]_*rep1.csv*"))[:4]
    assert files
    for file in files:
        rows = inertial.rows_of(load_recordings([file]).flights[0], False)
        struck = np.append(np.flatnonzero(np.abs(rows.acc).max(axis=1) > 40.0), len(rows.time_s))[0]  # the landing
        assert struck > 1000
        assert difference(recorded, rows, RECORDED)[0][:struck].max() < WITHIN, file.name
        few = np.arange(0, len(rows.pose_s), 10)
        arrived = np.concatenate(([0], np.searchsorted(rows.pose_s[few] + 0.03, rows.time_s, side="right")))
        late = replace(rows, pose_s=rows.pose_s[few], poses=np.ascontiguousarray(rows.poses[few]), arrived=arrived)
        assert difference(recorded, late, RECORDED)[0][:struck].max() < WITHIN, file.name


def test_invalid_inputs_leave_a_finite_state(library):
    pose, rest = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], ([0.0, 0.0, 9.81], [0.0, 0.0, 0.0])
    for bad in (np.nan, np.inf, -np.inf, 1e30):
        for k in range(7):
            spoilt = list(pose)
            spoilt[k] = bad
            assert not begun(library, spoilt)
        assert begun(library, pose)
        for _ in range(50):
            good = stepped(library, 0.01, *rest, [[*pose, 0.0]])
        for k in range(14):
            acc, gyro, seen = [0.0, 0.0, 9.81], [0.0] * 3, [*pose, 0.0]
            (acc if k < 3 else gyro if k < 6 else seen)[k if k < 3 else k - 3 if k < 6 else k - 6] = bad
            assert stepped(library, 0.01, acc, gyro, [seen]) == pytest.approx(good, abs=1e-3)
            assert library.drag_filter_running()
        assert np.isfinite(stepped(library, bad, *rest)).all()
        assert not library.drag_filter_running()
        assert stepped(library, 0.01, *rest) == pytest.approx(good, abs=1e-3)  # the last valid state
        assert begun(library, pose)
    stepped(library, 0.01, *rest)
    stepped(library, 0.6, *rest)  # too long without a row
    assert not library.drag_filter_running()


MAIN = r"""
#include <stdio.h>
#include "drag_filter.h"
int main(void) {
    float in[17];
    DragFilterState out;
    while (fread(in, sizeof in, 1, stdin) == 1) {
        const DragFilterPose *pose = (const DragFilterPose *)(in + 9);
        if (!drag_filter_running()) drag_filter_start(pose);
        drag_filter_step(in[0], in + 1, in + 4, in[7] > 0.0f, pose, in[8] > 0.0f ? 1 : 0, &out);
        fwrite(&out, sizeof out, 1, stdout);
    }
    return 0;
}
"""


@pytest.mark.slow
def test_sanitizers_find_no_fault(folder, tmp_path):
    (tmp_path / "main.c").write_text(MAIN)
    subprocess.run(["cc", *STRICT, "-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all",
                    f"-I{folder / 'src'}", str(folder / "src" / "drag_filter.c"), str(tmp_path / "main.c"), "-lm", "-o",
                    str(tmp_path / "sane")], check=True)
    rng, rows = np.random.default_rng(3), np.zeros((3000, 17))
    rows[:] = [0.01, 0.0, 0.0, 9.81, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    rows[:, 1:7] += rng.standard_normal((3000, 6)) * rng.choice([0.1, 10.0], (3000, 1))
    rows[:, 8] = rng.random(3000) > 0.5
    rows[:, 16] = rng.choice([0.0, 0.05, 0.4, -0.01], 3000)
    rows[rng.random(rows.shape) < 0.0005] = np.nan
    ran = subprocess.run([tmp_path / "sane"], input=rows.astype(np.float32).tobytes(), capture_output=True, check=True)
    assert ran.stderr == b""
    assert np.isfinite(np.frombuffer(ran.stdout, np.float32)).all()


def test_it_estimates_within_the_interface_of_the_firmware(folder, library, tmp_path):
    for name in ("FreeRTOS", "app", "estimator", "log", "stabilizer_types", "supervisor", "task"):
        (tmp_path / f"{name}.h").write_text('#include "firmware_stub.h"\n')
    subprocess.run(["cc", *STRICT, "-O2", "-shared", "-fPIC", f"-I{STUB}", f"-I{tmp_path}", f"-I{folder / 'src'}",
                    str(folder / "src" / "out_of_tree_estimator.c"), str(folder / "src" / "drag_filter.c"),
                    str(STUB / "stub_filter.c"), "-Wl,-Bsymbolic", "-lm", "-o", str(tmp_path / "libstub.so")],
                   check=True)
    stub = ctypes.CDLL(str(tmp_path / "libstub.so"))
    rows, truth = circles(20.0, step_s=0.01)
    out, waits = np.zeros(16, np.float32), 0
    stub.estimatorOutOfTreeInit()
    stub.stub_begin_app()
    begun(library, rows.poses[0])
    for step in range(1, 19990):
        k = step // 10
        imu = np.hstack([rows.acc[k] / 9.81, np.degrees(rows.gyro[k])]).astype(np.float32)
        pose = rows.poses[k].astype(np.float32) if step % 10 == 0 else None
        waits += stub.stub_loop(step, ctypes.c_void_p(imu.ctypes.data),
                                ctypes.c_void_p(pose.ctypes.data if pose is not None else None), 1, 1,
                                ctypes.c_void_p(out.ctypes.data))
        if step % 10 == 0:
            own = stepped(library, 0.01 if k > 1 else 0.0, rows.acc[k], rows.gyro[k], [[*rows.poses[k], 0.0]])
    assert waits == 1998
    assert out[:10] == pytest.approx(own, abs=1e-3)  # given out a loop later
    assert out[:3] == pytest.approx(truth[1998, :3], abs=0.03)
    roll, pitch, yaw = Rotation.from_quat(out[6:10]).as_euler("ZYX", degrees=True)[::-1]
    assert out[10:13] == pytest.approx([roll, -pitch, yaw], abs=1e-2)  # the firmware's pitch is nose up
    felt = Rotation.from_quat(out[6:10]).apply(rows.acc[1998] / 9.81) - [0.0, 0.0, 1.0]
    assert out[13:] == pytest.approx(felt, abs=1e-3)


def test_the_estimate_of_its_cost_by_hand(folder):
    # 23 states; a position of a pose has four entries (itself, velocity, two of the clock)
    position = 23 * (4 + 2) + 4 * 23 * 24 // 2
    assert costs()["pose"].multiply_adds == 6 * position + 12 * 10 + 16 * 10
    assert f"| pose | {costs()['pose'].multiply_adds} |" in (folder / "README.md").read_text()
