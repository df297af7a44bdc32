"""The first lines of a verdict, by hand-made bodies."""

import pytest

from identification.mismatch.headline import good_for, headline, uses


def improvement(position, floor=None, held_out=("a", "b")):
    row = {"before": {"position_m": position, "attitude_rad": 0.1}, "after": {"position_m": 0.05, "attitude_rad": 0.1},
           "floor": None if floor is None else {"position_m": floor, "attitude_rad": 0.08}}
    return {"10": row, "50": row, "held_out": list(held_out)}


@pytest.mark.parametrize(("position", "floor", "expected"), [
    (0.5, None, ("no", "no", "cannot say")),
    (0.1, 0.05, ("yes", "no", "no")),
    (0.06, 0.05, ("yes", "yes", "yes")),
    (None, None, ("cannot say",) * 3),
])
def test_good_for(position, floor, expected):
    assert tuple(good_for(improvement(position, floor)).values()) == expected


def test_half_a_second_of_constant_acceleration_is_what_the_limits_say():
    for acceleration, expected in ((0.9, "yes"), (1.1, "no")):
        assert good_for(improvement(0.5 * acceleration * 0.5**2))["hover"] == expected
        assert good_for(improvement(0.5 * 0.5 * acceleration * 0.5**2))["mpc"] == expected


def test_without_a_prediction_nothing_is_claimed():
    assert set(good_for(None).values()) == set(good_for({}).values()) == {"cannot say"}


def test_headlines():
    body = {"outcome": "named", "findings": [{"term": "drag_linear", "confidence": 0.97}], "unknown": None,
            "improvement": improvement(0.763)}
    assert headline(body) == ("The simulator is wrong about linear drag (97%); position error after 0.5 s "
                              "0.763 -> 0.050 m on 2 flights left out.")
    alike = [{"term": "mass", "equivalent": ["thrust_scale", "wind", "force_world", "frame_tilt"], "confidence": 1.0}]
    assert "wrong about mass or thrust scale or wind or 2 others (100%);" in headline({**body, "findings": alike})
    assert "something no term describes" in headline({**body, "unknown": {}} | {"unknown": {"hint": "x"}})
    found = improvement(0.763)
    worse = {**found["50"], "after": {"position_m": 0.05, "attitude_rad": 0.111}}
    assert headline({**body, "improvement": {**found, "50": worse}}).endswith(
        "2 flights left out, but attitude became worse.")
    quiet = {"outcome": "none", "findings": [], "unknown": None, "improvement": improvement(0.05, held_out=())}
    assert headline(quiet).endswith("position error after 0.5 s 0.050 m.")
    assert headline({**quiet, "leaning": {"wind": 0.6, "inflow": 0.7}}).startswith(
        "No effect is sure enough to be identified; the most probable is inflow (70%); position error")
    either = {"hint": "x", "between": [["wind", "mass"], ["inflow"]]}
    assert headline({**quiet, "outcome": "unknown", "unknown": either}) == (
        "The simulator is wrong, and these flights do not show what is missing: wind or mass; inflow; "
        "position error after 0.5 s 0.050 m.")
    both = headline({**body, "unknown": either})
    assert "wrong about linear drag (97%) and about wind or mass and about inflow;" in both
    assert headline({"outcome": "insufficient", "improvement": None}) == "No conclusion about physics."
    assert uses(good_for(None)).count("cannot say") == 3


def test_findings_that_share_a_term_state_their_axes():
    """Unequal motors turn a vehicle about z; in roll and pitch they act as its centre of mass."""
    findings = [{"term": "motor_imbalance", "equivalent": [], "confidence": 1.0, "where": {"axes": ["torque z"]}},
                {"term": "com_offset", "equivalent": ["motor_imbalance"], "confidence": 1.0,
                 "where": {"axes": ["torque x", "torque y"]}},
                {"term": "wind", "equivalent": [], "confidence": 0.92, "where": {"axes": ["force x"]}}]
    assert headline({"outcome": "named", "findings": findings}) == (
        "The simulator is wrong about unequal motors in torque z (100%), centre of mass or unequal motors in torque x "
        "and torque y (100%), wind (92%).")


def test_an_effect_that_may_be_hidden_is_mentioned_and_not_identified():
    body = {"outcome": "unknown", "findings": [], "improvement": improvement(0.1),
            "unknown": {"hides": ["thrust_voltage"]}}
    assert headline(body) == ("The simulator leaves out something: perhaps thrust by battery voltage, perhaps what no "
                              "term describes; position error after 0.5 s 0.100 m on 2 flights left out.")


def test_a_simulator_of_another_vehicle_is_named_as_one():
    assert headline({"outcome": "insufficient", "thrust_ratio": 0.0271}) == (
        "The simulator is of another vehicle: its thrust over mass is 0.027 times that of these flights.")
