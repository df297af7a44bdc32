"""Lengths in inches, feet, cm, mm and m of a table that states no unit: the tilt shows them, else the draft asks."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import flown

from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings

LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}


def drafted(folder, metres, names="px py pz", *, turn=False, speed=False, time=1.0):
    t, p, v, _, attitude, _ = flown()
    columns = {"t": time * t, **dict(zip(names.split(), p.T / metres, strict=True))}
    columns |= dict(zip(("vx", "vy", "vz"), v.T / metres, strict=True)) if speed else {}
    columns |= dict(zip(("qx", "qy", "qz", "qw"), attitude.as_quat().T, strict=True)) if turn else {}
    path = folder / "flight.csv"
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns), comments="",
               fmt="%.10g")
    return path, draft_columns(path)


@pytest.mark.parametrize("speed", [False, True])
@pytest.mark.parametrize("unit", [unit for unit in LENGTHS if unit != "ft"])
def test_the_tilt_shows_the_unit(tmp_path, unit, speed):
    path, draft = drafted(tmp_path, LENGTHS[unit], turn=True, speed=speed)
    assert draft.questions == ()
    assert draft.mapped["mocap", "px"] == ("px", unit)
    assert draft.status["px"] == "shown"
    (tmp_path / "map.toml").write_text(draft.text)
    flight, = load_recordings([path], columns=tmp_path / "map.toml", cache=False).flights
    np.testing.assert_allclose(flight["mocap"]["px", "py", "pz"], flown()[1], atol=1e-6)
    if speed:
        np.testing.assert_allclose(flight["mocap"]["vx", "vy", "vz"], flown()[2], atol=1e-6)


@pytest.mark.parametrize(("metres", "time"), [(LENGTHS["ft"], 1.0), (1.0, 0.5)])
def test_feet_and_a_time_that_is_too_short_look_alike(tmp_path, metres, time):
    draft = drafted(tmp_path, metres, turn=True, time=time)[1]
    assert ("mocap", "px") not in draft.mapped
    assert "ft by the tilt, or m with a time" in draft.questions[0]


@pytest.mark.parametrize("unit", ["in", "cm"])
def test_a_path_alone_in_cm_or_inches_is_a_question(tmp_path, unit):
    with pytest.raises(Exception, match=r"cm(, mm)?(, | or )in.*Each is possible"):
        drafted(tmp_path, LENGTHS[unit])


@pytest.mark.parametrize("names", ["x[in] y[in] z[in]", "x(inches) y(inches) z(inches)"])
def test_inches_that_the_header_states(tmp_path, names):
    assert drafted(tmp_path, LENGTHS["in"], names)[1].mapped["mocap", "px"] == (names.split()[0], "in")


@pytest.mark.parametrize(("stated", "metres"), [("mm", 1.0), ("cm", 1.0), ("m", 1.0), ("m", 1e-2), ("mm", 1e-3)])
def test_a_stated_unit_that_the_tilt_contradicts_is_a_question(tmp_path, stated, metres):
    names = " ".join(f"p{a}_{stated}" for a in "xyz")
    _, draft = drafted(tmp_path, metres, names, turn=True)
    right = LENGTHS[stated] == metres
    assert (("mocap", "px") in draft.mapped) == right
    assert bool(draft.questions) != right
