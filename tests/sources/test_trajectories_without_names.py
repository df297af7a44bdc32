"""TUM trajectories with decimal commas or in inches, and what ``columns`` advises for files without names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_files import tum
from test_draft_axes import flown

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import InputError
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings


def loaded(path: Path):
    found = load_recordings([path], cache=False)
    assert not found.failed
    return found.flights[0]


@pytest.mark.parametrize("header", ["", "# timestamp tx ty tz qx qy qz qw", "# poses of a program"])
@pytest.mark.parametrize("blank", [b" ", b"\t"])
def test_decimal_commas_are_read(tmp_path, header, blank):
    points = tum(header)
    head, _, rows = points.partition(b"\n") if header else (b"", b"", points)
    (tmp_path / "points.txt").write_bytes(points)
    (tmp_path / "commas.txt").write_bytes(head + b"\n" * bool(header) + rows.replace(b".", b",").replace(b" ", blank))
    read = [loaded(tmp_path / name) for name in ("points.txt", "commas.txt")]
    np.testing.assert_array_equal(*(f["mocap"].values for f in read))
    np.testing.assert_array_equal(*(f["mocap"].time_s for f in read))


def test_commas_between_whole_numbers_are_no_decimals(tmp_path):
    """1,2 3,4 could be pairs: only rows of eight cells with a unit quaternion are poses."""
    (tmp_path / "pairs.txt").write_text("1,2 3,4 5,6 7,8 9,1 2,3 4,5 6,7\n" * 20)
    assert load_recordings([tmp_path / "pairs.txt"], cache=False).failed


def poses(path, metres, head=""):
    t, p, _, _, turn, _ = flown()
    np.savetxt(path, np.column_stack([t, p / metres, turn.as_quat()]), fmt="%.9f", header=head, comments="# ")
    return path


@pytest.mark.parametrize(("metres", "unit"), [(0.0254, "inches"), (0.01, "centimetres"), (0.001, "millimetres")])
def test_the_tilt_names_the_unit_of_a_trajectory(tmp_path, metres, unit):
    fault = next(f for f in audit(loaded(poses(tmp_path / "poses.txt", metres))).faults if f.kind == "unit")
    assert fault.evidence.endswith(unit)
    assert fault.size == pytest.approx(1.0 / metres)


def test_inches_that_a_line_of_names_states(tmp_path):
    flight = loaded(poses(tmp_path / "poses.txt", 0.0254, "timestamp tx[in] ty[in] tz[in] qx qy qz qw"))
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], flown()[1], atol=1e-8)


@pytest.mark.parametrize("comma", [False, True])
def test_columns_states_how_a_trajectory_gets_a_map(tmp_path, comma):
    path = poses(tmp_path / "poses.txt", 1.0)
    lines = path.read_text().replace("# \n", "").replace(".", "," if comma else ".")
    path.write_text(lines)
    with pytest.raises(InputError, match="reads as it is; for a map, write names above its rows"):
        draft_columns(path)
    path.write_text("t x y z qx qy qz qw\n" + lines.replace(",", "."))
    assert draft_columns(path).mapped["mocap", "qw"] == ("qw", "1")


def test_rows_without_names_and_with_other_marks_are_refused(tmp_path):
    path = poses(tmp_path / "poses.txt", 1.0)
    path.write_text(path.read_text().replace("# \n", "").replace(".", ",").replace(" ", ";"))
    with pytest.raises(InputError, match="no header"):
        draft_columns(path)


def test_inches_that_a_file_calls_cm_contradict_the_tilt(tmp_path):
    """2.54 times: less than feet for metres, more than any real flight is off."""
    path = poses(tmp_path / "poses.txt", 0.0254, "timestamp tx[cm] ty[cm] tz[cm] qx qy qz qw")
    fault = next(f for f in audit(loaded(path)).faults if f.kind == "unit")
    assert "(inches read as cm)" in fault.evidence
