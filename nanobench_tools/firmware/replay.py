"""What the firmware's controllers command when they are fed with a recording: logged states in, commands out.

Every logged value is held from its row to the next on a 100 Hz grid. While the motors are off the setpoint is the
firmware's null setpoint, which holds all integrators at zero.
"""

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..errors import InputError
from ..flight import Flight
from ..methods import VehicleState
from ..units import PWM_FULL_SCALE
from . import mellinger, motor_output, pid
from .onboard import estimates
from .records import ABSOLUTE, CONTROL, ESTIMATE, SETPOINT
from .thrust_curve import thrust_of_voltage

CONTROLLERS = {"pid": pid, "mellinger": mellinger}
MOTORS = ("m1", "m2", "m3", "m4")
GRID_S = 0.01
HELD = 10
"""Steps of 1 ms for which a row is held."""
MOTOR_ON = 1000.0 / PWM_FULL_SCALE
BELOW_CAP = 0.99
MIN_ROWS = 200
"""For telling the build: the thrusts differ by 6.5 %, the rows scatter by 1 to 2 %."""


@dataclass(frozen=True)
class Replay:
    """On time_s (m,): thrust (m,) counts, attitude_rad (m, 3) desired roll, pitch, yaw FLU (nan behind Mellinger,
    which logs none).

    Also motor (m, 4) PWM ratio with the logged battery, and on (m,) bool where the motors ran."""

    time_s: np.ndarray
    thrust: np.ndarray
    attitude_rad: np.ndarray
    motor: np.ndarray
    on: np.ndarray


def replay(flight: Flight, controller: str, build: np.ndarray = motor_output.BUILD) -> Replay:
    """``controller`` pid or mellinger, ``build`` of the motors (1, 2).

    Needs estimator, attitude, gyro, setpoint, motor and battery streams.

    The yaw wanted is the logged one where the recording has it (stream ``pid``), which a Mellinger flight has not: 0.
    Raises InputError when a stream is missing or shorter than one second.
    """
    t, on, state, setpoint, estimate = _inputs(flight, controller)
    code = CONTROLLERS[controller]
    steps = 1 + np.arange(HELD * len(t))
    control, trace = np.zeros((len(steps), 1), CONTROL), np.zeros((len(steps), 1), code.STATE)
    code.run_steps(steps, code.defaults(), np.zeros(1, code.STATE), np.repeat(setpoint, HELD, axis=0),
                   np.repeat(estimate, HELD, axis=0), control, trace)
    counts, filtered = np.zeros((len(t), 1, 4), np.int32), np.full(1, motor_output.VOLTAGE_START_V)
    volt, last = state.battery_V.astype(np.float32), slice(HELD - 1, None, HELD)
    for k, row in enumerate(control[last]):
        motor_output.drive_legacy(HELD, row, volt[k:k + 1], filtered, build, counts[k])
    attitude = np.full((len(t), 3), np.nan)
    if controller == "pid":
        attitude = np.radians(trace["attitude_deg"][last, 0].astype(float)) * [1.0, -1.0, 1.0]
    return Replay(t, control["thrust"][last, 0].astype(float), attitude, counts[:, 0] / PWM_FULL_SCALE, on)


def flown_state(flight: Flight, controller: str, end_s: float) -> np.ndarray:
    """(1,) STATE of ``controller`` at ``end_s`` of a recording, from what was logged until then: its integrals.

    As at power-up where nothing was logged before. Raises InputError as ``replay`` does.
    """
    _, _, _, setpoint, estimate = _inputs(flight, controller, end_s)
    code, steps = CONTROLLERS[controller], 1 + np.arange(HELD * len(setpoint))
    found = np.zeros(1, code.STATE)
    code.run_steps(steps, code.defaults(), found, np.repeat(setpoint, HELD, axis=0), np.repeat(estimate, HELD, axis=0),
                   np.zeros((len(steps), 1), CONTROL), np.zeros((0, 1), code.STATE))
    return found


def _inputs(flight: Flight, controller: str, end_s: float = np.inf,
            ) -> tuple[np.ndarray, np.ndarray, VehicleState, np.ndarray, np.ndarray]:
    """Grid (m,) s, motors on (m,) bool, VehicleState of m rows, SETPOINT (m, 1) and ESTIMATE (m, 1) as logged."""
    needed = ("estimator", "attitude_qw", "imu", "setpoint", "motor", "battery")
    missing = [name for name in needed if name not in flight]
    if missing:
        raise InputError(flight.provenance.path, f"has no stream {missing[0]}", "replaying a controller needs "
                         f"{', '.join(needed)}")
    start, end = max(flight[n].time_s[0] for n in needed), min(flight[n].time_s[-1] for n in needed)
    if end - start < 1.0:
        raise InputError(flight.provenance.path, "its streams have less than one second in common")
    t = np.arange(start, min(end, end_s), GRID_S)
    state = VehicleState(flight["estimator"].interpolate(("x", "y", "z"), t),
                         flight["estimator"].interpolate(("vx", "vy", "vz"), t),
                         _rotations(flight, t), flight["imu"].interpolate(("gyro_x", "gyro_y", "gyro_z"), t),
                         flight["battery"].interpolate("vbat", t))
    logged = flight["motor"].interpolate(MOTORS, t)
    on = logged.max(axis=1) > MOTOR_ON
    estimate, setpoint = np.zeros((len(t), 1), ESTIMATE), np.zeros((len(t), 1), SETPOINT)
    estimates(state, estimate[:, 0])
    for mode in ("mode_x", "mode_y", "mode_z", "mode_yaw"):
        setpoint[mode][:, 0] = np.where(on, ABSOLUTE, 0)
    setpoint["position_m"][:, 0] = flight["setpoint"].interpolate(("x", "y", "z"), t)
    if controller == "pid" and "pid" in flight:
        setpoint["attitude_deg"][:, 0, 2] = np.degrees(flight["pid"].interpolate("yaw", t))
    return t, on, state, setpoint, estimate


def flown_command(flight: Flight, time_s: np.ndarray, build: np.ndarray = motor_output.BUILD) -> np.ndarray:
    """Mean command [counts] (m,) of the four motors from the logged PWM and battery. It is the commanded thrust unless
    a motor is at the cap."""
    volt = flight["motor"].interpolate(MOTORS, time_s) * flight["battery"].interpolate("vbat", time_s)[:, None]
    return np.asarray(PWM_FULL_SCALE * thrust_of_voltage(volt).mean(axis=1) / float(build[0, 0]))


def build_of(flight: Flight) -> np.ndarray | None:
    """Which of the firmware's builds flew, by the thrust it takes 65535 counts for: BUILD or EARLIER_BUILD.

    From the logged thrust command, PWM and battery, through the firmware's own curve; None where no thrust was logged
    (the Mellinger controller logs none) or fewer than MIN_ROWS rows are below the cap.
    """
    if not {"pid", "motor", "battery"} <= set(flight.streams) or "cmd_thrust" not in flight["pid"]:
        return None
    t = flight["motor"].time_s
    ratio, command = flight["motor"][MOTORS], flight["pid"].interpolate("cmd_thrust", t)
    rows = (ratio.max(axis=1) < BELOW_CAP) & (ratio.min(axis=1) > MOTOR_ON) & (command < BELOW_CAP) & (command > 0.3)
    if rows.sum() < MIN_ROWS:
        return None
    share = flown_command(flight, t[rows], motor_output.BUILD) / (PWM_FULL_SCALE * command[rows])
    full_N = float(motor_output.BUILD[0, 0] * np.median(share))
    return min((motor_output.BUILD, motor_output.EARLIER_BUILD), key=lambda build: abs(float(build[0, 0]) - full_N))


def _rotations(flight: Flight, t: np.ndarray) -> np.ndarray:
    stream = flight["attitude_qw"]
    return so3.interpolate(stream.time_s, so3.make_continuous(stream["qx", "qy", "qz", "qw"]), t)
