"""Rotor speeds of a table in eRPM or eRPM/100, as ESCs report them, are no revolutions per minute."""

from __future__ import annotations

import numpy as np
import pytest
from test_ambiguous_units import drafted
from test_draft_axes import flown

RPM = 21000.0
PAIRS = 6
NAMES = {"rpm1": "rpm", "m1_rpm": "motor", "m1 [rpm]": "motor", "m1 (rpm)": "motor"}


def numbered(name):
    return [name.replace("1", str(k)) for k in range(1, 5)]


def speeds(factor):
    return factor * RPM * (1.0 + 0.01 * np.sin(np.outer(flown()[0], np.arange(1.0, 5.0))))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("factor", "question"), [(PAIRS / 100.0, "eRPM/100 of an ESC"), (PAIRS, "no rotor turns so")])
def test_an_electrical_speed_under_the_name_rpm_is_a_question(tmp_path, name, factor, question):
    draft = drafted(tmp_path, numbered(name), speeds(factor))
    assert not {"rpm", "motor"} & {stream for stream, _ in draft.mapped}
    assert question in draft.questions[0]


@pytest.mark.parametrize("name", NAMES)
def test_revolutions_per_minute_are_read(tmp_path, name):
    draft = drafted(tmp_path, numbered(name), speeds(1.0))
    assert draft.questions == ()
    assert draft.mapped[NAMES[name], "m1"] == (name, "rpm")


@pytest.mark.parametrize("name", ["erpm1", "m1_erpm", "motor1_eRPM", "eRPM[1]", "eRPM/100 1", "m1 [eRPM]",
                                  "Motor 1 electrical speed (rpm)"])
def test_a_name_that_states_an_electrical_speed_is_left_out(tmp_path, name):
    draft = drafted(tmp_path, numbered(name), speeds(PAIRS / 100.0))
    assert not {"rpm", "motor"} & {stream for stream, _ in draft.mapped}
    assert "pairs of poles" in draft.unknown[name]


def test_a_name_that_ends_in_e_is_no_electrical_speed(tmp_path):
    assert "pairs of poles" not in drafted(tmp_path, numbered("side_rpm 1"), speeds(1.0)).unknown["side_rpm 1"]
