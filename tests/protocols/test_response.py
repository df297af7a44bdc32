"""Answers to commands: predictors whose answer is known by hand, and the physics they are measured by."""

from dataclasses import replace

import numpy as np
import pytest
from fifteen import FIFTEEN
from made_flights import made_flight

from identification.naive import Naive
from nanobench_tools import InputError
from nanobench_tools.flight import Span
from nanobench_tools.protocols import response, task1


def cases(n=3):
    return [task1.Case(made_flight(name, seed=k), (Span(6.0, 12.0),), ("all",))
            for k, name in enumerate("abcde"[:n], start=1)]


class Turns(Naive):
    """Rates rise by ``gains`` rad/s^2 per unit of what the motors are mixed to, velocity by ``lift`` along world z."""

    name = "turns"

    def __init__(self, *gains, lift=1.0, information="state"):
        self.gains, self.lift, self.information = np.array(gains), lift, information

    def predict(self, windows):
        found = super().predict(windows)
        held = 0.01 * np.cumsum(windows.motor, axis=1)
        mixed = np.stack([held @ np.array(response.MIX[name]) for name in ("roll", "pitch", "yaw")], axis=-1)
        rise = self.lift * held.sum(axis=2)[..., None] * [0.0, 0.0, 1.0]
        return replace(found, rate_rad_s=found.rate_rad_s + self.gains * mixed,
                       velocity_m_s=found.velocity_m_s + rise)


@pytest.mark.parametrize("information", ["state", "past"])
def test_sign_and_size_are_what_was_put_in(information):
    found = response.command_response(cases(), Turns(30.0, -20.0, 0.0, lift=5.0, information=information))
    step = found.step
    after = {name: getattr(found, name).after_s["0.2"].answer for name in response.MIX}
    assert after["roll"] == pytest.approx(30.0 * 4 * step * 0.2)
    assert after["pitch"] == pytest.approx(-20.0 * 4 * step * 0.2)
    assert after["yaw"] == pytest.approx(0.0, abs=1e-12)
    assert after["thrust"] == pytest.approx(5.0 * 4 * step * 0.2, rel=0.01)  # along a body z that is nearly up
    assert [getattr(found, name).sign for name in response.MIX] == ["right", "wrong", "none", "right"]
    assert found.vehicle == "no vehicle: answers pitch with the wrong sign; does not answer yaw"
    assert (found.roll.right_share, found.pitch.right_share) == (1.0, 0.0)
    assert found.windows == 3 * response.PER_FLIGHT


class Late(Turns):
    """Turns the right way first, and back within the window."""

    def predict(self, windows):
        found = super().predict(windows)
        back = np.where(np.arange(windows.horizon) < 30, 1.0, -1.0)[:, None]
        return replace(found, rate_rad_s=found.rate_rad_s * back)


def test_an_answer_that_turns_round_within_the_window_is_wrong():
    assert response.command_response(cases(), Turns(9.0, 9.0, 9.0)).vehicle == ""
    assert response.command_response(cases(), Late(9.0, 9.0, 9.0)).vehicle == (
        "no vehicle: answers roll, pitch, yaw with the wrong sign")


def test_the_physics_it_is_measured_by_is_that_of_the_vehicle():
    """Rate of a rigid body behind a first-order lag: a (t - tau (1 - exp(-t / tau))), a = moment / inertia."""
    made = response.command_response(cases(), response.reference())
    assert all(getattr(made, name).ratio == pytest.approx(1.0) for name in response.MIX)
    assert made.vehicle == ""
    windows = response.probed(cases(), False)
    volts, u, step = windows.battery_V.mean(), windows.motor.mean(), response.STEP
    slope = 0.06523793527519485 - 2 * 0.026792504967750107 * volts * u + 3 * 0.006776789303971145 * (volts * u) ** 2
    push = slope * volts * step  # N of every motor
    t, tau = 0.2, response.LAG_S
    grown = t - tau * (1 - np.exp(-t / tau))
    for name, moment, inertia in (("roll", 4 * 0.0325 * push, 1.8e-5), ("pitch", 4 * 0.0325 * push, 1.8e-5),
                                  ("yaw", 4 * 0.0069928948992470565 * push, 3.1e-5)):
        assert getattr(made, name).after_s["0.2"].physics == pytest.approx(moment / inertia * grown, rel=0.03)
    assert made.thrust.after_s["0.2"].physics == pytest.approx(4 * push / 0.04085 * grown, rel=0.03)


def test_a_model_that_stands_still_answers_nothing():
    found = response.command_response(cases(1), Naive())
    assert found.vehicle == "no vehicle: does not answer roll, pitch, yaw, thrust"
    with pytest.raises(InputError, match="no window"):
        response.command_response([], Naive())


def test_signs_are_those_of_the_mixer_of_the_firmware():
    """Its X mixer with a thrust of 1 and one command at a time (yaw and pitch of the legacy axes turned)."""
    from nanobench_tools.physics import Vehicle

    vehicle = Vehicle()
    x, y = np.array(vehicle.motor_positions_m).T
    assert np.all(np.array(response.MIX["roll"]) * y > 0.0)
    assert np.all(np.array(response.MIX["pitch"]) * -x > 0.0)
    assert response.MIX["yaw"] == vehicle.spin


@pytest.mark.real
@pytest.mark.parametrize("names", [FIFTEEN, pytest.param(None, marks=pytest.mark.slow)], ids=["15", "all"])
@pytest.mark.slow
def test_real_flights_turn_as_the_mixer_says(real, names):
    """Differential PWM goes with the angular acceleration 70 ms later, all three axes, in every training flight."""
    from nanobench_tools.protocols.windows import cut_windows

    flights, audits = real
    chosen = [f for f in flights if f.metadata.get("family") in ("circle", "star") and (not names or f.name in names)]
    late, train = 7, task1.split(chosen, audits).train
    assert len(train) >= 3
    for case in train:
        past = cut_windows(case.flight, case.spans, "onboard", past=True)[0].past
        turning = np.gradient(past.rate_rad_s, 0.01, axis=1)[:, late:]
        for axis, name in enumerate(("roll", "pitch", "yaw")):
            mixed = (past.motor @ np.array(response.MIX[name]))[:, :-late]
            x, y = (v - v.mean(axis=1, keepdims=True) for v in (mixed, turning[..., axis]))
            assert np.corrcoef(x.ravel(), y.ravel())[0, 1] > 0.1, (case.flight.name, name)
