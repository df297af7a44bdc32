"""Which controller says what is sent: names and classes to pilots."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import UsageError
from ...settings import setting
from ...steps.named_methods import load_methods

if TYPE_CHECKING:
    from ...radio.fly.pilot import Pilot

CONTROLLERS_HELP = ("onboard_pid, onboard_mellinger fly on board and are sent set-points; mpc_osqp, mpc_daqp, nmpc, "
                    "geometric, lqr and module:Class fly from here.")
NOW: dict[str, Any] = setting("flying.flight_controllers.now")
"""Of the observer: its input is of the present (``radio.pose_tracker``), and its rates come from poses, noisier than a
gyro's."""


def pilot_for(name: str, kind: str | None, simulator: Path | None) -> Pilot:
    """The pilot that ``--controller`` and ``--setpoints`` name. Raises UsageError."""
    from ...firmware.onboard import Mellinger, PidCascade
    from ...lookup.registry import load
    from ...radio.fly.motor_commands import MotorPilot
    from ...radio.fly.pilot import MELLINGER, PID, OnboardPilot, StreamingPilot

    found = load("controllers", name)
    if isinstance(found, type) and _is_predictive(found):
        return _predictive(name, found, kind or "thrust-rates", simulator)
    if simulator is not None:
        raise UsageError("--simulator is for predictive controllers")
    if isinstance(found, type) and hasattr(found, "setpoint"):
        made = _made(name, found)
        return StreamingPilot(made.name, kind or "thrust-rates", lambda delay_s: made)
    method = load_methods("controllers", [name])[0]
    for kinds, value in ((PidCascade, PID), (Mellinger, MELLINGER)):
        if isinstance(method, kinds):
            setpoint_kind = kind or ("full-state" if method.information == "preview" else "position")
            if setpoint_kind == "thrust-rates":
                raise UsageError(f"--setpoints: {name} flies on board; its set-points are position, velocity or "
                                 "full-state")
            return OnboardPilot(method.name, value, setpoint_kind, float(getattr(method, "lead_s", 0.0)))
    if kind not in (None, "thrust-rates"):
        raise UsageError(f"--setpoints: {name} commands motors; it is sent as thrust-rates")
    return MotorPilot(method)


def _is_predictive(kind: type) -> bool:
    try:
        from controllers.mpc.predictive_base import Mpc
    except ImportError:  # without casadi no controller is predictive
        return False
    return issubclass(kind, Mpc)


def _predictive(name: str, kind: Any, setpoints: str, simulator: Path | None) -> Pilot:
    from controllers.mpc.disturbance import Tuning
    from controllers.plants.served_vehicle import served_simulator

    from ...physics.simulator import loads, read_simulator
    from ...radio.fly.predictive import PlannedPilot

    model = loads(served_simulator()) if simulator is None else read_simulator(simulator)
    if setpoints != "thrust-rates":
        raise UsageError(f"--setpoints: {name} plans for motors; it is sent as thrust-rates")

    def make(delay_s: float) -> Any:
        # the firmware's mixer takes thrust from all motors for a plan that needs them whole, and the vehicle sinks
        return kind(model, delay_s=delay_s, tuning=Tuning(**NOW), near_m=0.0)

    return PlannedPilot(make)


def _made(name: str, kind: Any) -> Any:
    try:
        return kind()
    except Exception as error:  # the class is anybody's code
        raise UsageError(f"{name}: making it raised {type(error).__name__}: {error}") from error
