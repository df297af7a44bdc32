"""A trajectory of another program in another convention is scored as written, and a sentence names the convention."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nanobench_tools.flight import Span
from nanobench_tools.protocols.foreign_conventions import convention_of
from nanobench_tools.protocols.task3 import Case, score
from nanobench_tools.sources.trajectory_file import TrajectoryFile

CAMERA = Rotation.from_matrix([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
FRD = Rotation.from_euler("x", 180, degrees=True)
NED = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def found(crowd, folder, change):
    """What is said of the motion capture's own poses with 10 mm of noise, after ``change`` of position, rotation."""
    flight = crowd.log("trefoil")[0]
    mocap = flight["mocap"]
    keep = np.isfinite(mocap.values).all(axis=1)
    t = (mocap.time_s + flight.epoch_s)[keep]
    p = mocap["px", "py", "pz"][keep]
    p = p + 0.01 * np.random.default_rng(0).standard_normal(p.shape)
    p, q = change(p, Rotation.from_quat(mocap["qx", "qy", "qz", "qw"][keep]))
    np.savetxt(folder / "a.tum", np.column_stack([t, p, q]), fmt="%.9f")
    return score(Case(flight, (Span(4.0, 11.0),), ("all",)), TrajectoryFile(folder / "a.tum"), "clean").convention


@pytest.mark.parametrize(("change", "says"), [
    (lambda p, r: (p, r.as_quat()), None),
    (lambda p, r: (p, (r * Rotation.from_euler("z", 10, degrees=True)).as_quat()), None),
    (lambda p, r: (p, (r * CAMERA).as_quat()), "its body is turned by 120.0 deg"),
    (lambda p, r: (NED.apply(p), (NED * r * FRD).as_quat()), "its body is turned by 1"),
    (lambda p, r: (p, np.roll(r.as_quat(), 1, axis=1)), "its quaternions are in the order w, x, y, z"),
    (lambda p, r: (p, r.inv().as_quat()), "its quaternions are inverted (world to body)"),
    (lambda p, r: (1000.0 * p, r.as_quat()), "1000 times as large as the tracked one: it is in mm"),
    (lambda p, r: (1.4 * p, r.as_quat()), "1.4 times as large as the tracked one, and"),
    (lambda p, r: (0.01 * p, r.as_quat()), "0.01 times as large"),
], ids=["same", "heading", "camera", "NED and FRD", "w first", "inverted", "mm", "scale of a camera", "hundredths"])
def test_a_sentence_names_the_convention(crowd, tmp_path, change, says):
    sentence = found(crowd, tmp_path, change)
    assert (says in sentence) if says else not sentence


def test_an_estimator_that_is_merely_wrong_has_no_convention():
    """Its path drifts, and its attitude wanders by 30 deg and more."""
    rng = np.random.default_rng(1)
    t = np.linspace(0.0, 20.0, 400)
    truth = np.stack([np.sin(t), np.cos(2.0 * t), 0.2 * np.sin(0.5 * t)], axis=1)
    turn = Rotation.from_euler("ZYX", np.stack([0.5 * np.sin(t), 0.2 * np.sin(2.0 * t), 0.2 * np.cos(t)], axis=1))
    wander = Rotation.from_rotvec(0.15 * np.cumsum(rng.standard_normal((400, 3)), axis=0))
    drift = 0.2 * np.cumsum(rng.standard_normal((400, 3)), axis=0)
    assert convention_of(truth + drift, (turn * wander).as_quat(), np.eye(3), truth, turn.as_quat()) == ""
