"""Numbers of motors up to 1: shares of full command, or forces of the rotors in N."""

from __future__ import annotations

import numpy as np
import pytest
from test_draft_axes import G, flown

from nanobench_tools.signals.column_draft import draft_columns

FOUR = ("u0", "u1", "u2", "u3")


def drafted(folder, names, hover, digits=9, *, counts=False, stands=False):
    """The draft of a flight whose rotors (or their sum) show ``hover`` where the vehicle hovers."""
    t, p, _, a, *_ = flown()
    weight = np.linalg.norm(a + G, axis=1) / 9.81
    shares = hover * np.stack([weight * (1.0 + 0.02 * np.sin(3.0 * t + k)) for k in range(len(names))], axis=1)
    if counts:
        shares = np.round(65535.0 * shares) / 65535.0
    path = folder / "flight.csv"
    np.savetxt(path, np.column_stack([t, 0.0 * p if stands else p, shares]), delimiter=",",
               header=",".join(["t", "px", "py", "pz", *names]), comments="", fmt=f"%.{digits}f")
    return draft_columns(path)


@pytest.mark.parametrize("names", [FOUR, tuple(f"motor_thrust_{k}" for k in range(1, 5))])
def test_forces_and_shares_of_one_size_are_a_question(tmp_path, names):
    draft = drafted(tmp_path, names, 0.25 * 9.81 / 4.0)
    assert not any(stream == "motor" for stream, _ in draft.mapped)
    (question,) = draft.questions
    assert "forces in N" in question


@pytest.mark.parametrize("names", [("thrust",), ("cmd_thrust",), ("collective",)])
def test_a_collective_up_to_1_is_a_question(tmp_path, names):
    draft = drafted(tmp_path, names, 0.034 * 9.81)
    assert ("command", "thrust") not in draft.mapped
    assert "forces in N" in draft.questions[0]
    assert drafted(tmp_path, ("throttle",), 0.034 * 9.81).mapped["command", "thrust"] == ("throttle", "1")


def test_names_of_motors_are_assumed_to_be_shares(tmp_path):
    """The map, the audit and a note say so: nothing shows it."""
    draft = drafted(tmp_path, ("m1", "m2", "m3", "m4"), 0.6)
    assert draft.mapped["motor", "m1"] == ("m1", "1")
    assert draft.status["m1"] == "assumed"
    assert any("forces in N look alike" in note for note in draft.notes)


def test_more_than_full_command_is_a_force(tmp_path):
    draft = drafted(tmp_path, ("m1", "m2", "m3", "m4"), 0.92)
    assert ("motor", "m1") not in draft.mapped
    assert "forces in N" in draft.questions[0]


@pytest.mark.parametrize("digits", [6, 9])
def test_counts_over_their_full_scale_are_shares(tmp_path, digits):
    draft = drafted(tmp_path, FOUR, 0.6, digits, counts=True)
    assert draft.questions == ()
    assert draft.mapped["motor", "m1"] == ("u0", "1")
    assert ("motor", "m1") not in drafted(tmp_path, FOUR, 0.85, digits).mapped


@pytest.mark.parametrize("names", [FOUR, ("m1", "m2", "m3", "m4")])
def test_a_vehicle_that_flies_has_no_commands_of_a_tenth(tmp_path, names):
    """The four rotors of a Crazyflie carry 0.09 N each."""
    draft = drafted(tmp_path, names, 0.037 * 9.81 / 4.0)
    assert not any(stream == "motor" for stream, _ in draft.mapped)
    assert "no share of full command that lifts a vehicle" in draft.questions[0]
    assert ("motor", "m1") in drafted(tmp_path, ("m1", "m2", "m3", "m4"), 0.09, stands=True).mapped
