"""Tables with the columns of several ROS topics, as PlotJuggler writes them: the topics' names decide, as in a bag."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import G, flown

from nanobench_tools.errors import InputError
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings

EPOCH_S = 1.7e9
ABOVE, BESIDE = np.array([0.0, 0.0, 0.3]), np.array([0.1, 0.0, 0.0])


def write(path, **topics):
    """topics: ``a__b`` -> {field: ((n,) values, every how many rows)}; a topic has no cells in the other rows."""
    t, *_ = flown()
    columns = {"__time": [f"{EPOCH_S + s:.6f}" for s in t]}
    for name, fields in topics.items():
        for field, (values, every) in fields.items():
            columns[f"/{name.replace('__', '/')}/{field}"] = [
                f"{v:.7g}" if k % every == 0 else "" for k, v in enumerate(values)]
    path.write_text("\n".join([",".join(columns), *map(",".join, zip(*columns.values(), strict=True))]) + "\n")
    return path


def vector(stem, values, axes="xyz", every=1):
    return {f"{stem}/{a}": (column, every) for a, column in zip(axes, values.T, strict=True)}


def pose(position, turn, every=1, within="pose"):
    return {**vector(f"{within}/position", position, every=every),
            **vector(f"{within}/orientation", turn.as_quat(), "xyzw", every)}


def read(path, tmp_path):
    draft = draft_columns(path)
    (tmp_path / "map.toml").write_text(draft.text)
    return draft, load_recordings([path], columns=tmp_path / "map.toml", cache=False).flights[0]


def test_tracker_estimate_set_point_and_imu_are_separate(tmp_path):
    """Each is another path by 0.1 m or more, so that a wrong topic shows."""
    t, p, v, a, turn, w = flown()
    path = write(tmp_path / "log.csv",
                 mavros__setpoint_position__local=pose(p + ABOVE, turn),
                 mavros__local_position__odom={**pose(p + BESIDE, turn, 2, "pose/pose"),
                                               **vector("twist/twist/linear", turn.inv().apply(v), every=2)},
                 optitrack__uav1=pose(p, turn, 4),
                 mavros__imu__data={**vector("linear_acceleration", turn.inv().apply(a + G)),
                                    **vector("angular_velocity", w)},
                 mavros__battery={"voltage": (np.linspace(16.4, 15.8, len(t)), 10)})
    draft, flight = read(path, tmp_path)
    assert draft.questions == ()
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p[::4], atol=1e-5)
    np.testing.assert_allclose(flight["estimator"]["x", "y", "z"], p[::2] + BESIDE, atol=1e-5)
    np.testing.assert_allclose(flight["setpoint"]["x", "y", "z"], p + ABOVE, atol=1e-5)
    np.testing.assert_allclose(flight["imu"]["acc_x", "acc_y", "acc_z"], turn.inv().apply(a + G), atol=1e-4)
    np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-5)
    assert flight["battery"]["vbat"][0] == pytest.approx(16.4)
    assert "vx" not in flight["estimator"].quantities  # it is in the body
    assert len(flight["mocap"]) == len(t[::4])


def test_a_pose_that_does_not_say_what_it_is_beside_a_set_point(tmp_path):
    _, p, _, _, turn, _ = flown()
    draft, flight = read(write(tmp_path / "log.csv", uav1__reference=pose(p + 0.3, turn), uav1__pose=pose(p, turn)),
                         tmp_path)
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p, atol=1e-5)
    assert any("/uav1/pose is taken for motion capture" in note for note in draft.notes)


def test_two_vehicles_and_two_trackers_are_questions(tmp_path):
    _, p, _, _, turn, w = flown()
    path = write(tmp_path / "log.csv", vicon__uav1__uav1=pose(p, turn), vicon__uav2__uav2=pose(p + 1.0, turn))
    with pytest.raises(InputError, match="which vehicle: uav1, uav2"):
        draft_columns(path)
    path = write(tmp_path / "log.csv", vicon__pose=pose(p, turn), optitrack__pose=pose(p + 0.1, turn),
                 imu=vector("angular_velocity", w))
    with pytest.raises(InputError, match="2 topics may be the mocap: /optitrack/pose"):
        draft_columns(path)
