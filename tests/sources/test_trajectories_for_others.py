"""Trajectories for evo, rpg_trajectory_evaluation and KITTI's tools: their readers and ours find the same poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_draft_axes import flown

from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.sources import load_recordings
from nanobench_tools.steps.export import export

EPOCH_S = 1772689631.25
POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")


def flight():
    t, p, v, _, turn, _ = flown()
    pose = np.hstack([p, turn.as_quat()])
    pose[7] = np.nan
    return Flight("a flight", {
        "mocap": make_stream("mocap", t, pose, POSE),
        "estimator": make_stream("estimator", t[10:] + 0.004, np.hstack([p, v])[10:] + 0.01,
                                 ("x", "y", "z", "vx", "vy", "vz")),
        "attitude_qw": make_stream("attitude_qw", t, turn.as_quat(), POSE[3:])}, {}, Provenance("", "", ""),
        epoch_s=EPOCH_S)


def poses():
    """Seconds, positions and rotations of the rows that hold a pose."""
    t, p, _, _, turn, _ = flown()
    kept = np.arange(len(t)) != 7
    return t[kept], p[kept], turn[kept]


def check(stream, epoch_s, since=EPOCH_S):
    t, p, turn = poses()
    np.testing.assert_allclose(epoch_s - since + stream.time_s, t - (t[0] if since == 0.0 else 0.0), atol=1e-6)
    np.testing.assert_allclose(stream["px", "py", "pz"], p, atol=1e-8)
    assert (Rotation.from_quat(stream[POSE[3:]]).inv() * turn).magnitude().max() < 1e-6


@pytest.mark.parametrize(("to", "source"), [("euroc", "euroc"), ("kitti", "kitti"), ("rpg", "tum")])
def test_they_are_read_back(tmp_path, to, source):
    export(flight(), tmp_path, to)
    loaded = load_recordings([tmp_path], cache=False)
    assert loaded.failed == []
    read = loaded.flights[0]
    assert read.provenance.source == source
    check(read["mocap"], read.epoch_s, 0.0 if to == "kitti" else EPOCH_S)
    assert len(loaded.flights) == (2 if to == "rpg" else 1)
    if to == "rpg":
        estimate = loaded.flights[1]
        t, p, _, _, turn, _ = flown()
        at_s = estimate.epoch_s - EPOCH_S + estimate["mocap"].time_s
        np.testing.assert_allclose(at_s, t[10:-1] + 0.004, atol=1e-6)
        np.testing.assert_allclose(estimate["mocap"]["px", "py", "pz"], p[10:-1] + 0.01, atol=1e-8)
        apart = Rotation.from_quat(estimate["mocap"][POSE[3:]]).inv() * turn[10:-1]
        assert 0.0 < apart.magnitude().max() < 0.02


def test_evo_reads_the_same(tmp_path):
    import evo.tools.file_interface as files

    t, p, turn = poses()
    for to, read in (("euroc", files.read_euroc_csv_trajectory), ("kitti", files.read_kitti_poses_file),
                     ("tum", files.read_tum_trajectory_file)):
        whole = flight()
        found = read(export(whole.with_streams(mocap=whole["mocap"].rows(np.arange(len(whole["mocap"])) != 7)),
                            tmp_path, to))
        np.testing.assert_allclose(found.positions_xyz, p, atol=1e-8)
        assert (Rotation.from_matrix([m[:3, :3] for m in found.poses_se3]).inv() * turn).magnitude().max() < 1e-6
        if to != "kitti":
            np.testing.assert_allclose(found.timestamps - EPOCH_S, t, atol=1e-6)


def test_kitti_without_its_times_or_with_others_is_refused(tmp_path):
    path = export(flight(), tmp_path, "kitti")
    times = tmp_path / "a flight.times.txt"
    text = times.read_text()
    for content, words in ((None, "without the file of their times"), (text[: len(text) // 2], "is not whole"),
                           ("1e12\n" * text.count("\n"), "no seconds"), ("x\n" * text.count("\n"), "holds no times")):
        times.unlink()
        if content is not None:
            times.write_text(content)
        (failure,) = load_recordings([path], cache=False).failed
        assert words in failure["error"]
        times.write_text(text)


@pytest.mark.parametrize("seeds", [6, pytest.param(60, marks=pytest.mark.slow)])
def test_damage_of_kitti_poses_gives_no_other_pose(tmp_path, seeds):
    path = export(flight(), tmp_path, "kitti")
    (before,) = load_recordings([path], cache=False).flights
    lines = path.read_bytes().splitlines(keepends=True)
    count = 0
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        some = set(rng.choice(np.arange(25, len(lines)), 3, replace=False).tolist())
        for change in (lambda line: b"nan " * 12 + b"\n", lambda line: line[: len(line) // 2] + b"\n",
                       lambda line: b"x" + line, lambda line: line.replace(b"e-01", b"e+01", 1)):
            path.write_bytes(b"".join(change(line) if k in some else line for k, line in enumerate(lines)))
            loaded = load_recordings([path], cache=False)
            count += 1
            for read in loaded.flights:
                kept = np.isin(before["mocap"].time_s, read["mocap"].time_s)
                same = np.abs(read["mocap"].values - before["mocap"].values[kept]).max(axis=1) < 1e-9
                assert (~same).sum() <= 3
        path.write_bytes(b"".join(line for k, line in enumerate(lines) if k not in some))
        assert "is not whole" in load_recordings([path], cache=False).failed[0]["error"]
        count += 1
    assert count == 5 * seeds


def test_poses_are_needed(tmp_path):
    whole = flight()
    bare = replace(whole, streams={"mocap": make_stream("mocap", [0.0, 0.1], np.zeros((2, 3)), POSE[:3])})
    for to in ("euroc", "kitti", "rpg"):
        with pytest.raises(InputError, match="mocap has no qx"):
            export(bare, tmp_path, to)
