"""Exports of Vicon with several sections, each with its title, rate, names and rows."""

from __future__ import annotations

import numpy as np
import pytest

from nanobench_tools.sources import load_recordings

N = 60
X_MM = 500.0 * np.sin(0.1 * np.arange(N))


def section(title, units="mm,mm,mm", rate="100", body="cf1:cf1", first=1):
    rows = [title, rate, f",,{body},,,,,,", "Frame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ", f",,,,,,{units}",
            *(f"{first + k},0,0,0,0,1,{x:.3f},{-x:.3f},1000" for k, x in enumerate(X_MM))]
    return "\n".join(rows) + "\n"


def markers(count):
    rows = ["Trajectories", "100", f",,{','.join(f'cf1:m{i},,' for i in range(count))}",
            f"Frame,Sub Frame,{','.join(['X,Y,Z'] * count)}", f",,{','.join(['mm,mm,mm'] * count)}",
            *(f"{k + 1},0,{','.join([f'{x:.3f},20,900'] * count)}" for k, x in enumerate(X_MM))]
    return "\n".join(rows) + "\n"


DEVICES = "Devices\n1000\n,,Force\nFrame,Sub Frame,Fx\n,,N\n" + "".join(f"{1 + k // 10},{k % 10},0.1\n" for k in range(
    10 * N)) + "\n"


def read(folder, text):
    (folder / "a.csv").write_text(text)
    return load_recordings([folder / "a.csv"], cache=False)


@pytest.mark.parametrize("text", [
    section("Segments") + "\n" + markers(1), section("Segments") + "\n" + markers(3), DEVICES + section("Segments"),
    DEVICES + section("Segments") + "\n" + markers(2), section("Model Outputs"), section("Objects", rate="100 Hz"),
    section("Objects", body="")])
def test_rows_are_those_of_the_section_with_poses(tmp_path, text):
    (flight,) = read(tmp_path, text).flights
    np.testing.assert_allclose(flight["mocap"].time_s, 0.01 * np.arange(N), atol=1e-9)
    np.testing.assert_allclose(flight["mocap"]["px"], 1e-3 * X_MM, atol=1e-6)
    others = [title for title in ("Trajectories", "Devices") if title in text]
    assert all(any(f"section {title} is not read" in note for note in flight.provenance.notes) for title in others)


def test_two_sections_of_poses_are_refused(tmp_path):
    (failed,) = read(tmp_path, section("Objects") + "\n" + section("Objects", first=1001)).failed
    assert "with 2 sections of poses: Objects, Objects; export each to a separate file" in failed["error"]


def test_lengths_in_several_units_are_refused(tmp_path):
    (failed,) = read(tmp_path, section("Objects", units="mm,mm,m")).failed
    assert "TX, TY and TZ are in different units (mm, m)" in failed["error"]
