"""A yaw that is counted like a compass shows in the path, since a vehicle speeds up towards its tilt."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import flown
from test_other_spellings import read, written

from nanobench_tools.signals.column_draft import draft_columns


def drafted(folder, reading, *, position=None):
    t, p, *_, turn, _ = flown()
    yaw, pitch, roll = turn.as_euler("ZYX", degrees=True).T
    path = folder / "flight.csv"
    np.savetxt(path, np.column_stack([t, p if position is None else position, roll, pitch, reading(yaw)]), fmt="%.8g",
               delimiter=",", header="t,px,py,pz,roll,pitch,yaw", comments="")
    return draft_columns(path)


@pytest.mark.parametrize(("reading", "words"), [(lambda yaw: (90.0 - yaw) % 360.0, "as a compass"),
                                                (lambda yaw: -yaw, "clockwise from x")])
def test_a_yaw_that_turns_the_other_way_is_a_question(tmp_path, reading, words):
    draft = drafted(tmp_path, reading)
    assert ("attitude", "yaw") not in draft.mapped
    assert ("attitude", "roll") in draft.mapped
    assert any(words in question for question in draft.questions)


@pytest.mark.parametrize("turned", ["as it is", "world turned"])
def test_another_heading_of_the_world_is_none(tmp_path, turned):
    p = flown()[1]
    position = np.stack([-p[:, 1], p[:, 0], p[:, 2]], axis=1) if turned == "world turned" else p
    draft = drafted(tmp_path, lambda yaw: yaw, position=position)
    assert not any("clockwise" in question for question in draft.questions)
    if turned == "as it is":
        assert ("attitude", "yaw") in draft.mapped


@pytest.mark.parametrize("name", ["yaw [rad]", "yaw [deg]"])
def test_the_sense_of_a_yaw_alone_is_assumed_in_every_audit(tmp_path, name):
    t, p, *_ = flown()
    yaw = np.linspace(0.0, 1.2, len(t)) * (180.0 / np.pi if "deg" in name else 1.0)
    flight, _ = read(written(tmp_path, {"t": t, "x [m]": p[:, 0], "y [m]": p[:, 1], "z [m]": p[:, 2], name: yaw}))
    (assumption,) = [a for a in flight.provenance.assumptions if a.column == name]
    assert "counter-clockwise" in assumption.unit
