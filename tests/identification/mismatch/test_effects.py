"""Effects that are asked for, and how far they move their parameters."""

from __future__ import annotations

import numpy as np
import pytest
from carried_tracks import MODEL, wrench_of

from identification.mismatch.posterior.effects import effects_of, within_reach
from identification.mismatch.space import space_around


def test_rising_and_falling_thrust_each_have_their_lag():
    """Both time constants move together in the first direction, and against each other in the second."""
    model = MODEL.with_parameters({"motor_lag.tau_down_s": 0.08})
    wrench = wrench_of(MODEL, flights=1, seconds=6.0)
    space = within_reach(wrench, space_around(model))
    found = [e for e in effects_of(wrench, space, model) if e.term == "motor_lag"]
    assert [e.width for e in found] == [2, 2, 2]
    none = found[0]
    assert none.moves["motor_lag.tau_up_s"] == pytest.approx([-0.04, -0.02])
    assert none.moves["motor_lag.tau_down_s"] == pytest.approx([-0.08, 0.04])
    without = space.model.with_parameters({"motor_lag.tau_up_s": 0.0, "motor_lag.tau_down_s": 0.0})
    for effect, there, here in zip((none.force, none.torque), wrench.model(without), wrench.model(space.model),
                                   strict=True):
        assert effect[..., 0] == pytest.approx(there - here, abs=1e-9)  # exact where it ends, however it bends


def test_every_effect_that_a_simulator_may_lack_is_asked():
    """A factor of 0 hides what it multiplies, and a limit that nothing reaches has no slope."""
    wrench = wrench_of(MODEL, flights=1, seconds=6.0)
    space = within_reach(wrench, space_around(MODEL))
    found = effects_of(wrench, space, MODEL)
    assert {e.term for e in found} - {"thrust_pwm"} == set(space.terms) - {"thrust_rpm"}
    for effect in found:
        size = np.abs(effect.force).max() + (np.abs(effect.torque).max() if effect.torque.size else 0.0)
        assert size > 0.0, effect.term


def test_a_limit_below_every_command_hides_the_shape_of_the_thrust_map():
    """All thrusts are 0.03 N, whatever the map: it has no direction, and the other terms are still asked for."""
    model = MODEL.with_term("saturation", T_max_N=0.03)
    wrench = wrench_of(MODEL, flights=1, seconds=6.0)
    found = effects_of(wrench, within_reach(wrench, space_around(model)), model)
    terms = [e.term for e in found if not e.map_share]
    assert "thrust_voltage" not in terms
    assert {"saturation", "mass", "drag_linear"} <= set(terms)
    assert all(np.isfinite(e.force).all() for e in found)
