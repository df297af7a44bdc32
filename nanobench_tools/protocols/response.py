"""Is a predictor a vehicle? Its answer to a command that is added to the inputs of real windows.

A step of PWM is added to the logged inputs of a window from its start on. Its pattern is that of a controller that
commands roll, pitch, yaw or thrust. In a second prediction it is subtracted. Everything else is unchanged. Half the
difference of the two predictions is the response. It is the body rate [rad/s], or for thrust the velocity [m/s] along
the body's z at the start. A predictor that turns the other way than its motors push, or not at all, may predict flights
well but is unsuitable as a plant. Any predictor is tested through the same contract.

The size is compared with rigid-body physics: the firmware's thrust curve and yaw arm, mass, inertia and geometry of the
vehicle. Only the motor lag comes from recordings of flights.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from .. import so3
from ..errors import InputError
from ..methods import Prediction, Predictor, Windows
from ..results import array_fields
from ..settings import number
from .result_rows import Answer, AxisAnswer, CommandResponse
from .task1 import Case
from .windows import cut_windows

MIX = {"roll": (-1.0, -1.0, 1.0, 1.0), "pitch": (-1.0, 1.0, 1.0, -1.0), "yaw": (-1.0, 1.0, -1.0, 1.0),
       "thrust": (1.0, 1.0, 1.0, 1.0)}
"""Motors 1..4 (front right, back right, back left, front left): direction of each push, as in the firmware's X mixer.
Axes are x forward, y left, z up. Motors 2 and 4 turn the vehicle to the left."""
STEP = number("prediction.response.step")
AFTER_ROWS = {"0.1": 10, "0.2": 20, "0.5": 50}
"""Seconds after the step -> rows; the verdict hears all of them."""
SHOWN_S = "0.2"
FLIGHTS, PER_FLIGHT = 12, 5
"""Number of tested windows, spread evenly over test flights and over each of them."""
NONE = 0.01
"""An answer below this share of the physics' is none."""
LAG_S = number("prediction.response.lag_s")


def reference() -> Predictor:
    """Physics with numbers from firmware, scale and ruler."""
    from ..firmware.motor_output import YAW_ARM_M
    from ..firmware.thrust_curve import COEFFICIENTS
    from ..physics import Model, Vehicle
    from ..physics.predictor import ModelPredictor

    return ModelPredictor(Model(Vehicle(), {
        "thrust_voltage": {"c": COEFFICIENTS}, "yaw_torque": {"k_m": float(YAW_ARM_M)},
        "motor_lag": {"tau_up_s": LAG_S, "tau_down_s": LAG_S}}), "reference")


def few(cases: Sequence[Case]) -> list[Case]:
    """At most FLIGHTS of ``cases``, spread evenly."""
    return [cases[i] for i in np.unique(np.linspace(0, len(cases) - 1, FLIGHTS).astype(int))] if cases else []


def probed(cases: Sequence[Case], past: bool) -> Windows | None:
    """About FLIGHTS x PER_FLIGHT windows of ``cases``; or None."""
    parts = []
    for case in few(cases):
        cut = cut_windows(case.flight, case.spans, "onboard", past=past)
        if cut is not None:
            rows = np.unique(np.linspace(0, len(cut[0]) - 1, PER_FLIGHT).astype(int))
            parts.append(array_fields.rows(cut[0], rows))
    return array_fields.joined(parts) if parts else None


def answers(predictor: Predictor, windows: Windows) -> dict[str, np.ndarray]:
    """{roll, pitch, yaw, thrust: (n, H)}: change of rad/s (thrust: m/s) 1..H rows after a step of STEP."""
    steps = [sign * STEP * np.array(mix) for mix in MIX.values() for sign in (1.0, -1.0)]
    many = array_fields.joined([windows] * len(steps))
    moved = np.concatenate([windows.motor + step for step in steps])
    found: Prediction = predictor.predict(replace(many, motor=moved))
    shape = (len(MIX), 2, len(windows), windows.horizon, 3)
    rate, velocity = (np.asarray(x, float).reshape(shape) for x in (found.rate_rad_s, found.velocity_m_s))
    turned, pushed = (0.5 * (x[:, 0] - x[:, 1]) for x in (rate, velocity))
    up = so3.rotate(windows.quaternion, np.array([0.0, 0.0, 1.0]))
    lift = np.sum(pushed[3] * up[:, None], axis=-1)
    return {"roll": turned[0, ..., 0], "pitch": turned[1, ..., 1], "yaw": turned[2, ..., 2], "thrust": lift}


def command_response(cases: Sequence[Case], predictor: Predictor) -> CommandResponse:
    """Means over windows. A sign is ``wrong`` if it is so at any of AFTER_ROWS; ratio and right_share are those after
    SHOWN_S. InputError where there is no window."""
    windows = probed(cases, predictor.information == "past")
    if windows is None:
        raise InputError("command response", "no window to put a command into")
    mine, theirs = answers(predictor, windows), answers(reference(), replace(windows, past=None))
    found: dict[str, AxisAnswer] = {}
    for name, answer in mine.items():
        unit = "m/s" if name == "thrust" else "rad/s"
        means = {s: (float(answer[:, rows - 1].mean()), float(theirs[name][:, rows - 1].mean()))
                 for s, rows in AFTER_ROWS.items()}
        ratios = [own / physics for own, physics in means.values()]
        sign = "wrong" if min(ratios) < -NONE else "right" if means[SHOWN_S][0] / means[SHOWN_S][1] > NONE else "none"
        own, physics = means[SHOWN_S]
        found[name] = AxisAnswer(sign, own / physics, {s: Answer(a, p, unit) for s, (a, p) in means.items()},
                                 float(np.mean(answer[:, AFTER_ROWS[SHOWN_S] - 1] > 0.0)))
    return CommandResponse(windows=len(windows), step=STEP, vehicle=no_vehicle(found), **found)


def no_vehicle(found: Mapping[str, AxisAnswer]) -> str:
    """Why a predictor with these answers is no vehicle; empty for one that is."""
    wrong = [name for name in MIX if found[name].sign == "wrong"]
    none = [name for name in MIX if found[name].sign == "none"]
    parts = ([f"answers {', '.join(wrong)} with the wrong sign"] if wrong else []) + (
        [f"does not answer {', '.join(none)}"] if none else [])
    return f"no vehicle: {'; '.join(parts)}" if parts else ""
