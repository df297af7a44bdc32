"""Flies recordings again on the plant, with the firmware's controller that flew them; ``protocols.gate`` judges.

Inputs are the logged setpoints, the battery, and the times of radio silence (gaps between the log's packets, in which
no pose arrives). At the first instant they also include state, rotor commands and the integrals that the controller
had gathered on the ground. Its own code, fed with the log until then, computes the integrals. PID flights fly the
build of the firmware their own log shows. Nothing else of the recording is used.
"""

from collections.abc import Sequence

import numpy as np

from nanobench_tools import so3
from nanobench_tools.auditing.usable import MOTORS
from nanobench_tools.firmware.motor_output import BUILD, MotorOutput
from nanobench_tools.firmware.onboard import PERIOD_S, Mellinger, PidCascade
from nanobench_tools.firmware.replay import build_of, flown_state
from nanobench_tools.methods import Reference
from nanobench_tools.physics.simulator import loads
from nanobench_tools.protocols.gate import Case, FlownAgain, score, setpoints

from .closed_loop import Flown, fly
from .kalman_senses import Onboard
from .plant import Plant, Trace
from .senses import TICK_S, Sensing

FLEET: dict[str, type[PidCascade] | type[Mellinger]] = {"pid": PidCascade, "mellinger": Mellinger}
REST_S = 1.0
"""The vehicle is on the ground for so long at the start of a whole recording."""
KEPT = 2
"""Every second tick of a path is kept: 50 Hz."""
IDLE = 0.05
"""PWM ratio; motors of a cut piece run faster from its first row on, and the ground is not known."""


def fly_cases(cases: Sequence[Case], simulator: str, seed: int = 0) -> FlownAgain:
    """Cases behind one controller, flown again and judged.

    simulator: the text of a simulator.toml. The cases fly side by side; each flies the same alone.
    """
    flown = flight_of(cases, simulator, seed)
    rows, paths = [], {}
    for i, case in enumerate(cases):
        ticks = case.ticks
        rows.append(score(case, flown.position_m[:ticks, i], flown.motor[:ticks, i]))
        path = np.column_stack([case.time_s, flown.position_m[:ticks, i], flown.quaternion[:ticks, i]])[::KEPT]
        paths[case.flight.name] = np.round(path, 5).tolist()
    return FlownAgain(rows, paths)


def flight_of(cases: Sequence[Case], simulator: str, seed: int = 0) -> Flown:
    """The cases, all of one controller, flown until the longest ends (a shorter one goes on with its last
    setpoint)."""
    n, ticks = len(cases), max(case.ticks for case in cases)
    place, velocity, yaw, volts = np.zeros((ticks, n, 3)), np.zeros((ticks, n, 3)), np.zeros((ticks, n)), np.zeros(
        (ticks, n))
    start, motor, ground = np.zeros((n, 13)), np.zeros((n, 4)), np.zeros(n)
    kind = FLEET[cases[0].controller]
    controller = kind()
    controller.reset(n)
    builds = np.repeat(BUILD, n, axis=0)
    for i, case in enumerate(cases):
        rows = np.minimum(np.arange(ticks), case.ticks - 1)
        for whole, own in zip((place, yaw, velocity), setpoints(case), strict=True):
            whole[:, i] = own[rows]
        volts[:, i] = case.flight["battery"].interpolate("vbat", case.time_s)[rows]
        start[i], motor[i], ground[i] = _begin(case)
        controller.state[i] = flown_state(case.flight, case.controller, case.span.start_s)[0]
        build = build_of(case.flight)
        builds[i] = BUILD[0] if build is None else build[0]
    outputs = MotorOutput(n, PERIOD_S, builds)
    outputs.filtered_V[:] = volts[0]
    controller.drive_with(outputs)
    plant = Plant(loads(simulator), start, motor, Trace(volts, TICK_S), ground_z=ground)
    rngs = [np.random.default_rng([seed, int(case.flight.provenance.sha256[:8] or "0", 16)]) for case in cases]
    shut = np.zeros((ticks, n), bool)
    for i, case in enumerate(cases):
        for span in case.silent:
            shut[:case.ticks, i] |= (case.time_s > span.start_s) & (case.time_s < span.end_s)
    senses = Onboard(plant, Sensing(shut=shut), rngs)
    still = np.zeros((n, 3))
    return fly(plant, senses, controller, lambda k: Reference(place[k], yaw[k], velocity[k], still), ticks, begun=True)


def _begin(case: Case) -> tuple[np.ndarray, np.ndarray, float]:
    """State (13,), PWM ratios (4,) at the start, and the height of the ground (-inf where it is not known).

    Position and velocity of the motion capture; the attitude is the logged one, whose frame is that of the thrust.
    """
    flight, at = case.flight, np.array([case.span.start_s])
    mocap, attitude = flight["mocap"], flight["attitude_qw"]
    q = so3.interpolate(attitude.time_s, so3.make_continuous(attitude["qx", "qy", "qz", "qw"]), at)
    state = np.concatenate([mocap.interpolate(("px", "py", "pz", "vx", "vy", "vz"), at)[0], q[0],
                            flight["imu"].interpolate(("gyro_x", "gyro_y", "gyro_z"), at)[0]])
    before = mocap.time_s < mocap.time_s[0] + REST_S
    resting = flight["motor"].interpolate(MOTORS, mocap.time_s[before]).max() < IDLE
    ground = float(np.median(mocap["pz"][before])) if resting else -np.inf
    return state, flight["motor"].interpolate(MOTORS, at)[0], ground
