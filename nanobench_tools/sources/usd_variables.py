"""Crazyflie log variables -> the vocabulary: which quantity, in which unit, with which sign.

A quantity may come from several variables; the first one that was logged is taken. Meanings are those of firmware
2025.12.1 (and of the forks that log ``rpm`` and ``pwm``); what is not listed here is kept as found in stream ``extra``.
The Lee controller logs SI with our signs: on 69 public flights its attitude turns as its rates say, the vehicle speeds
up forward where its pitch is positive, and its thrust in hover is .94 of the weight on standard motors.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..units import GRAVITY_M_S2, factor


@dataclass(frozen=True)
class Variable:
    """``value_SI = sign * factor(unit) * value + offset``."""

    name: str
    unit: str = "1"
    sign: float = 1.0
    offset: float = 0.0

    @property
    def scale(self) -> float:
        return self.sign * factor(self.unit)


def _table() -> dict[str, dict[str, tuple[Variable, ...]]]:
    v = Variable
    motors = range(1, 5)
    millimetres = {a: v(f"stateEstimateZ.{a}", "mm") for a in "xyz"}
    return {
        "mocap": {
            **{f"p{a}": (v(f"locSrv.{a}", "m"),) for a in "xyz"},
            **{q: (v(f"locSrv.{q}"),) for q in ("qx", "qy", "qz", "qw")},
        },
        "imu": {
            **{f"acc_{a}": (v(f"acc.{a}", "g"),) for a in "xyz"},
            # compressed rates: the pitch rate keeps the legacy sign there, gyro.y does not
            **{
                f"gyro_{a}": (v(f"gyro.{a}", "deg/s"), v(f"stateEstimateZ.rate{n}", "mrad/s", s),
                              v(f"ctrlLee.omega{a}", "rad/s"))
                for a, n, s in (("x", "Roll", 1.0), ("y", "Pitch", -1.0), ("z", "Yaw", 1.0))
            },
        },
        # pwm.* is what the motors got; motor.* before the battery compensation where both exist, else the same
        "motor": {f"m{i}": (v(f"pwm.m{i}_pwm", "pwm16"), v(f"motor.m{i}", "pwm16")) for i in motors},
        "motor_request": {f"m{i}": (v(f"motor.m{i}req", "pwm16"), v(f"motor.m{i}", "pwm16")) for i in motors},
        "estimator": {
            **{a: (v(f"stateEstimate.{a}", "m"), millimetres[a]) for a in "xyz"},
            **{f"v{a}": (v(f"stateEstimate.v{a}", "m/s"), v(f"stateEstimateZ.v{a}", "mm/s")) for a in "xyz"},
        },
        # the compressed acceleration still has gravity in z
        "estimator_acc": {
            f"a{a}": (v(f"stateEstimate.a{a}", "g"),
                      v(f"stateEstimateZ.a{a}", "mm/s^2", offset=-GRAVITY_M_S2 if a == "z" else 0.0))
            for a in "xyz"
        },
        "attitude": {
            a: (v(f"stateEstimate.{a}", "deg", s), v(f"stabilizer.{a}", "deg", s), v(f"ctrlLee.rpy{axis}", "rad"))
            for a, s, axis in (("roll", 1.0, "x"), ("pitch", -1.0, "y"), ("yaw", 1.0, "z"))
        },
        "attitude_qw": {q: (v(f"stateEstimate.{q}"),) for q in ("qx", "qy", "qz", "qw")},
        # ctrltarget.yaw is a rate, hence in extra
        "setpoint": {a: (v(f"ctrltarget.{a}", "m"), v(f"ctrltargetZ.{a}", "mm")) for a in "xyz"},
        "pid": {
            **{a: (v(f"controller.{a}", "deg", s),) for a, s in (("roll", 1.0), ("pitch", -1.0), ("yaw", 1.0))},
            "cmd_thrust": (v("controller.cmd_thrust", "pwm16"),),
        },
        "command": {
            "thrust": (v("stabilizer.thrust", "pwm16"), v("ctrlLee.thrustSi", "N"), v("ctrlLee.thrustSI", "N"))
        },
        "battery": {"vbat": (v("pm.vbat", "V"), v("pm.vbatMV", "mV"))},
        "rpm": {f"m{i}": (v(f"rpm.m{i}", "rpm"),) for i in motors},
    }


VARIABLES = _table()
"""stream -> quantity -> variables that can give it, best first."""


def assign(logged: tuple[str, ...]) -> dict[str, dict[str, Variable]]:
    """Which logged variable becomes which quantity: stream -> quantity -> Variable. A variable is used once."""
    left = set(logged)
    chosen: dict[str, dict[str, Variable]] = {}
    for stream, quantities in VARIABLES.items():
        for quantity, options in quantities.items():
            found = next((o for o in options if o.name in left), None)
            if found is not None:
                left.discard(found.name)
                chosen.setdefault(stream, {})[quantity] = found
    return chosen
