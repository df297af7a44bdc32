"""Exports of motion capture with two rigid bodies are two flights; Qualisys without a column of time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_draft_axes import flown

from nanobench_tools.sources import load_recordings

STEP_S = 0.02
SHIFT_M = np.array([2.0, -1.0, 0.0])
EAST_UP_SOUTH = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def lines(separator, head, *columns):
    rows = [separator.join([str(k + 1), *(f"{c:.7f}" for c in row)]) for k, row in enumerate(np.column_stack(columns))]
    return "\n".join([*head, *rows]) + "\n"


def motive(t, bodies):
    turned = [np.hstack([Rotation.from_matrix(EAST_UP_SOUTH @ turn.as_matrix() @ EAST_UP_SOUTH.T).as_quat(),
                         p @ EAST_UP_SOUTH.T, np.full((len(p), 1), 1e-4)]) for p, turn in bodies.values()]
    kinds = ["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"]
    names = [[kind, name, '"1"', group] for name in bodies for kind, group in zip(["Rigid Body"] * 8, kinds,
                                                                                 strict=True)]
    head = ["Format Version,1.23,Take Name,A,Export Frame Rate,50,Rotation Type,Quaternion,Length Units,Meters", ""]
    head += [",".join(["", "", *cells]) for cells in zip(*names, strict=True)]
    return lines(",", [*head, ",".join(["Frame", "Time (Seconds)", *["X", "Y", "Z", "W", "X", "Y", "Z", ""] * len(
        bodies)])], t, *turned)


def qualisys(t, bodies, timed=True):
    names = [f"{name} {first}" if first == "X" else first for name in bodies
             for first in ("X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual", *(f"Rot[{k}]" for k in range(9)))]
    cells = [np.hstack([1e3 * p, turn.as_euler("XYZ", degrees=True), np.full((len(p), 1), 0.2),
                        turn.as_matrix().swapaxes(1, 2).reshape(-1, 9)]) for p, turn in bodies.values()]
    head = [f"NO_OF_FRAMES\t{len(t)}", "FREQUENCY\t50", "\t".join(["BODY_NAMES", *bodies]),
            "\t".join([*["Frame", "Time"], *names])]
    text = lines("\t", head, t, *cells)
    if timed:
        return text
    return "\n".join(line if k < 3 else line.split("\t", 2)[2] for k, line in enumerate(text.splitlines())) + "\n"


def vicon(t, bodies):
    cells = [np.hstack([turn.as_quat(), 1e3 * p]) for p, turn in bodies.values()]
    head = ["Objects", "50", "," + "".join(f",{name}:{name}{',' * 6}" for name in bodies),
            ",".join(["Frame", "Sub Frame", *["RX", "RY", "RZ", "RW", "TX", "TY", "TZ"] * len(bodies)]),
            ",".join(["", "", *["", "", "", "", "mm", "mm", "mm"] * len(bodies)])]
    return lines(",", head, 0.0 * t, *cells)


@pytest.mark.parametrize("program", [motive, qualisys, vicon])
def test_each_body_is_a_flight(tmp_path, program):
    t, p, _, _, turn, _ = flown()
    other = Rotation.from_euler("z", 90.0, degrees=True) * turn
    (tmp_path / "a.csv").write_text(program(t, {"cf1": (p, turn), "cf2": (p + SHIFT_M, other)}))
    loaded = load_recordings([tmp_path / "a.csv"], cache=False)
    assert not loaded.failed
    first, second = (flight["mocap"] for flight in loaded.flights)
    assert ["cf1" in f.name for f in loaded.flights] == [True, False]
    np.testing.assert_allclose(first["px", "py", "pz"], p, atol=1e-5)
    np.testing.assert_allclose(second["px", "py", "pz"], p + SHIFT_M, atol=1e-5)
    for stream, attitude in ((first, turn), (second, other)):
        assert (Rotation.from_quat(stream["qx", "qy", "qz", "qw"]).inv() * attitude).magnitude().max() < 1e-4
        np.testing.assert_allclose(stream.time_s, STEP_S * np.arange(len(t)), atol=1e-6)


def test_rows_of_qualisys_without_a_time_are_counted(tmp_path):
    t, p, _, _, turn, _ = flown()
    (tmp_path / "a.tsv").write_text(qualisys(t, {"cf1": (p, turn)}, timed=False))
    (flight,) = load_recordings([tmp_path / "a.tsv"], cache=False).flights
    np.testing.assert_allclose(flight["mocap"].time_s, STEP_S * np.arange(len(t)), atol=1e-6)
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], p, atol=1e-5)
