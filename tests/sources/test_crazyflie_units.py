"""Crazyflie logs whose numbers are in another unit than the names of the firmware have."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import G, flown

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import InputError
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings

XYZ = ("x", "y", "z")


def written(folder, *groups):
    """A table of ``Timestamp`` and of (prefix, names, vectors)."""
    t = flown()[0]
    table = np.column_stack([np.round(1e3 * t), *(vectors for *_, vectors in groups)])
    names = ["Timestamp", *(f"{prefix}{name}" for prefix, names, _ in groups for name in names)]
    path = folder / "log.csv"
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    return path


def place(scale, *, prefix="stateEstimate.", whole=True):
    p = scale * flown()[1]
    return prefix, XYZ, np.round(p) if whole else p


def speed(scale, *, prefix="stateEstimate.", whole=False):
    v = scale * flown()[2]
    return prefix, ("vx", "vy", "vz"), np.round(v) if whole else v


@pytest.mark.parametrize("groups", [
    [place(1000.0)], [place(1000.0), speed(1000.0, whole=True)], [place(1000.0), speed(1.0)],
    [("kalman.state", ("X", "Y", "Z"), np.round(1000.0 * flown()[1]))]],
    ids=["position", "position and velocity", "position alone", "filter"])
def test_millimetres_under_a_name_in_metres_are_a_question_and_a_fault(tmp_path, groups):
    path = written(tmp_path, *groups)
    with pytest.raises(InputError, match=r"write (the unit of|it at) each"):
        draft_columns(path)
    (flight,) = load_recordings([path], cache=False).flights
    (fault,) = [f for f in audit(flight).faults if f.kind == "unit"]
    assert fault.stream == "estimator"
    assert len(fault.columns) == 3
    assert fault.size == 1000.0


def test_metres_per_second_in_millimetres_are_a_question(tmp_path):
    with pytest.raises(InputError, match="no flight; which unit"):
        draft_columns(written(tmp_path, speed(1000.0)))
    assert ("estimator", "vx") in draft_columns(written(tmp_path, speed(1.0))).mapped


def test_metres_under_a_compressed_name_are_a_question(tmp_path):
    z = "stateEstimateZ."
    with pytest.raises(InputError, match="whole mm as Crazyflie firmware log has them, or m"):
        draft_columns(written(tmp_path, place(1.0, prefix=z, whole=False), speed(1.0, prefix=z)))


def test_the_compressed_groups_are_right_as_they_are(tmp_path):
    z, w = "stateEstimateZ.", flown()[-1]
    path = written(tmp_path, place(1000.0, prefix=z), speed(1000.0, prefix=z, whole=True),
                   (z, ("ax", "ay", "az"), np.round(1000.0 * (flown()[3] + G))),
                   (z, ("rateRoll", "ratePitch", "rateYaw"), np.round(1000.0 * w * [1.0, -1.0, 1.0])),
                   place(1000.0, prefix="ctrltargetZ."))
    draft = draft_columns(path)
    assert draft.questions == ()
    (tmp_path / "map.toml").write_text(draft.text)
    for flight in (load_recordings([path], columns=tmp_path / "map.toml", cache=False).flights[0],
                   load_recordings([path], cache=False).flights[0]):
        np.testing.assert_allclose(flight["estimator"][XYZ], flown()[1], atol=1e-3)
        np.testing.assert_allclose(flight["setpoint"][XYZ], flown()[1], atol=1e-3)
        np.testing.assert_allclose(flight["imu"]["gyro_x", "gyro_y", "gyro_z"], w, atol=1e-3)
        assert not [f for f in audit(flight).faults if f.kind == "unit"]


def test_a_vehicle_that_stands_in_whole_millimetres_is_no_question(tmp_path):
    noise = np.round(2.0 * np.random.default_rng(3).standard_normal(flown()[1].shape))
    assert draft_columns(written(tmp_path, ("stateEstimateZ.", XYZ, noise))).questions == ()


@pytest.mark.parametrize(("prefix", "scale"), [("ctrltarget.", 1000.0), ("ctrltargetZ.", 1.0)])
def test_a_set_point_in_another_unit_than_the_path_that_follows_it_is_a_question(tmp_path, prefix, scale):
    draft = draft_columns(written(tmp_path, place(1.0, whole=False), place(scale, prefix=prefix, whole=False)))
    (question,) = draft.questions
    assert "times the position that follows it" in question
    assert not any(stream == "setpoint" for stream, _ in draft.mapped)


def test_an_outdoor_flight_in_metres_is_no_question(tmp_path):
    """Two kilometres at 25 m/s."""
    t = np.arange(0.0, 160.0, 0.1)
    path = tmp_path / "log.csv"
    circle = np.column_stack([np.round(1e3 * t), 1e3 * np.sin(0.025 * t), 1e3 * np.cos(0.025 * t), 50.0 + 0.0 * t])
    np.savetxt(path, circle, delimiter=",", header="Timestamp,stateEstimate.x,stateEstimate.y,stateEstimate.z",
               comments="", fmt="%.9g")
    draft = draft_columns(path)
    assert draft.questions == ()
    (flight,) = load_recordings([path], cache=False).flights
    assert not [f for f in audit(flight).faults if f.kind == "unit"]
