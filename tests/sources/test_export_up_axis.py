"""Exports of motion capture with y or z up, whichever the program was set to: the ground shows it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_draft_axes import flown

from nanobench_tools.sources import load_recordings

EAST_UP_SOUTH = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def motive(t, p, turn):
    head = ("Format Version,1.23,Take Name,A,Export Frame Rate,50,Rotation Type,Quaternion,Length Units,Millimeters\n\n"
            ",,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body\n,,a,a,a,a,a,a,a\n"
            ",,1,1,1,1,1,1,1\n,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position\n"
            "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z\n")
    cells = np.column_stack([t, turn.as_quat(), 1000.0 * p])
    return head + "".join(f"{k},{','.join(f'{c:.6f}' for c in row)}\n" for k, row in enumerate(cells))


def motive_angles(t, p, turn):
    """Angles in an order that the first line states, in columns X, Y and Z."""
    head, *rows = motive(t, p, turn).split("\n", 7)[:8]
    lines = [head.replace("Quaternion", "YXZ"), *(r.replace(",W,", ",").replace(",Rigid Body", "", 1).replace(
        ",a,", ",", 1).replace(",1,", ",", 1).replace("Rotation,", "", 1) for r in rows[:6])]
    y, x, z = turn.as_euler("YXZ", degrees=True).T
    cells = np.column_stack([t, x, y, z, 1000.0 * p])
    return "\n".join([*lines, *(f"{k},{','.join(f'{c:.6f}' for c in row)}" for k, row in enumerate(cells))]) + "\n"


def qualisys(t, p, turn):
    head = f"NO_OF_FRAMES\t{len(t)}\nFREQUENCY\t50\nBODY_NAMES\ta\nFrame\tTime\ta X\tY\tZ\tRoll\tPitch\tYaw\n"
    cells = np.column_stack([t, 1000.0 * p, turn.as_euler("XYZ", degrees=True)])
    return head + "".join("\t".join([str(k), *(f"{c:.6f}" for c in row)]) + "\n" for k, row in enumerate(cells))


@pytest.mark.parametrize("program", [motive, motive_angles, qualisys])
@pytest.mark.parametrize("axes", [np.eye(3), EAST_UP_SOUTH], ids=["z up", "y up"])
@pytest.mark.parametrize("hidden", [False, True], ids=["all seen", "zeros while hidden"])
def test_the_axis_that_is_up_is_shown_by_the_ground(tmp_path, program, axes, hidden):
    t, p, _, _, turn, _ = flown()
    in_axes = Rotation.from_matrix(axes @ turn.as_matrix() @ axes.T)
    place = p @ axes.T
    rows = np.zeros(len(t), dtype=bool)
    rows[390:420] = hidden
    place[rows] = 0.0
    (tmp_path / "a.csv").write_text(program(t, place, in_axes))
    (flight,) = load_recordings([tmp_path / "a.csv"], cache=False).flights
    mocap = flight["mocap"]
    np.testing.assert_allclose(mocap["px", "py", "pz"][~rows], p[~rows], atol=1e-5)
    read = Rotation.from_quat(mocap["qx", "qy", "qz", "qw"][~rows])
    assert (read.inv() * turn[~rows]).magnitude().max() < 1e-4
    usual = np.array_equal(axes, np.eye(3)) == (program is qualisys)
    assert [a.column for a in flight.provenance.assumptions] == {
        motive: [], motive_angles: ["Rotation Y, Rotation X, Rotation Z"], qualisys: ["Roll, Pitch, Yaw"]}[program]
    assert any("is up, since" in note for note in flight.provenance.notes) != usual


@pytest.mark.parametrize("program", [motive, qualisys])
def test_without_the_ground_the_axes_are_those_of_the_program(tmp_path, program):
    t, p, _, _, turn, _ = flown()
    air = (t > 5.0) & (t < 11.0)
    axes = EAST_UP_SOUTH if program is motive else np.eye(3)
    (tmp_path / "a.csv").write_text(program(t[air], p[air] @ axes.T,
                                            Rotation.from_matrix(axes @ turn[air].as_matrix() @ axes.T)))
    (flight,) = load_recordings([tmp_path / "a.csv"], cache=False).flights
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p[air], atol=1e-5)
