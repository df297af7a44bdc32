"""Attitudes of Qualisys exports: the rotation matrix, angles in any order, and angles under other names."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_draft_axes import flown

from nanobench_tools.sources import load_recordings

LETTERS = {"Roll": "X", "Pitch": "Y", "Yaw": "Z"}


def read(folder, names, attitude, decimal="."):
    t, p, *_ = flown()
    head = "\t".join(["Frame", "Time", "a X", "Y", "Z", *names])
    cells = np.column_stack([np.arange(1, len(t) + 1), t, 1e3 * p, attitude])
    rows = ["\t".join(f"{c:.6f}".replace(".", decimal) for c in row) for row in cells]
    path = folder / "flight_6D.tsv"
    path.write_text("\n".join([f"NO_OF_FRAMES\t{len(t)}", "FREQUENCY\t100", "BODY_NAMES\ta", head, *rows]) + "\n")
    return load_recordings([path], cache=False).flights[0]


def apart(flight):
    q = flight["mocap"]["qx", "qy", "qz", "qw"]
    return (Rotation.from_quat(q).inv() * flown()[4]).magnitude().max()


@pytest.mark.parametrize("names", [("Roll", "Pitch", "Yaw"), ("Yaw", "Pitch", "Roll"), ("Pitch", "Roll", "Yaw")])
def test_angles_are_turned_in_the_order_of_their_columns(tmp_path, names):
    turn = flown()[4]
    flight = read(tmp_path, names, turn.as_euler("".join(LETTERS[n] for n in names), degrees=True))
    assert apart(flight) < 1e-6
    assert any("in this order" in note for note in flight.provenance.notes)


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("names", [(), ("Roll", "Pitch", "Yaw"), ("Alpha", "Beta", "Gamma")])
def test_the_matrix_is_read_whatever_the_angles_are(tmp_path, names, decimal):
    """The angles here are wrong on purpose; the matrix is written column by column."""
    turn = flown()[4]
    columns = turn.as_matrix().swapaxes(1, 2).reshape(-1, 9)
    wrong = np.full((len(columns), len(names)), 30.0)
    flight = read(tmp_path, [*names, "Residual", *(f"Rot[{k}]" for k in range(9))],
                  np.column_stack([wrong, 0.3 + 0.0 * columns[:, 0], columns]), decimal)
    assert apart(flight) < 1e-5


def test_angles_whose_axes_no_name_states_are_left_out(tmp_path):
    flight = read(tmp_path, ("Alpha", "Beta", "Gamma"), np.zeros((len(flown()[0]), 3)))
    assert "qx" not in flight["mocap"]
    assert any("Alpha, Beta, Gamma are not read" in note for note in flight.provenance.notes)


def test_the_audit_repeats_what_the_file_does_not_state(tmp_path):
    """Order and signs of the angles are a setting of the program; a rotation matrix has none."""
    turn = flown()[4]
    flight = read(tmp_path, ("Roll", "Pitch", "Yaw"), turn.as_euler("XYZ", degrees=True))
    (assumed,) = flight.provenance.assumptions
    assert (assumed.stream, assumed.column) == ("mocap", "Roll, Pitch, Yaw")
    columns = turn.as_matrix().swapaxes(1, 2).reshape(-1, 9)
    assert read(tmp_path, [f"Rot[{k}]" for k in range(9)], columns).provenance.assumptions == ()
