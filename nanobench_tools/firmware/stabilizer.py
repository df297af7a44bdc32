"""One vehicle's 1 kHz loop (stabilizer.c of 2025.12.1): IMU filters, estimate, controller, mixer, motors.

Order within a loop: new IMU sample, the state that the Kalman task left in the loop before, controller, motors; then
the task runs. Set-points and what the supervisor allows come from outside and are held between calls.
"""

import math

import numba as nb
import numpy as np
from numpy.typing import ArrayLike

from . import kalman, kalman_task, lee, mellinger, motor_output, pid
from .float32 import ATTITUDE_EVERY, ONE, TO_DEG, TWO, F, Real
from .kalman import PX
from .kalman_task import task_step
from .lee import lee_step
from .mellinger import mellinger_step
from .motor_output import VOLTAGE_START_V, cap, drive, filter_voltage, mix_legacy, mix_wrench
from .pid import low_pass, pid_step
from .records import CONTROL, ESTIMATE, SETPOINT, WRENCH, Record

PID, MELLINGER, LEE = 1, 2, 5
"""Values of ``stabilizer.controller`` that are flown here; 0 means the first."""
QUEUE = 20
"""Measurements that wait for the Kalman task at most; more are lost (estimator.c)."""
GYRO_HZ, ACC_HZ = 80.0, 30.0
"""Corners of the IMU's low passes (sensors_bmi088_bmp3xx.c)."""

LOOP = np.dtype([("step", "i8"), ("controller", "i1"), ("allowed", "i1"), ("override", "i1"), ("acc_g", "f4", 3),
                 ("gyro_deg_s", "f4", 3), ("memory", "f4", (6, 2)), ("acceleration_g", "f4", 3), ("vbat_V", "f4"),
                 ("filtered_V", "f4"), ("cmd_thrust", "f4"), ("request", "i4", 4), ("motor", "i4", 4),
                 ("direct", "i4", 4), ("motor_on_step", "i8"), ("control", CONTROL), ("wrench", WRENCH),
                 ("estimate", ESTIMATE)], align=True)
"""The loop.

- Count of steps, flying controller, whether motors may turn, ``motorPowerSet.enable`` and its values (``direct``).
- Filtered IMU, memory of its low passes, world acceleration without gravity [g], battery measured and filtered.
- Thrust of the loop before, motors before and after the cap [counts], the step at which one last turned.
"""

_GYRO_FILTER = np.array(low_pass(1000.0, GYRO_HZ), np.float32)
_ACC_FILTER = np.array(low_pass(1000.0, ACC_HZ), np.float32)
FULL = 65535


@nb.njit()
def _filtered(c: np.ndarray, memory: np.ndarray, x: Real) -> Real:
    """lpf2pApply of filter.c."""
    d0 = x - memory[0] * c[3] - memory[1] * c[4]
    if not math.isfinite(d0):
        d0 = x
    y: Real = d0 * c[0] + memory[0] * c[1] + memory[1] * c[2]
    memory[1], memory[0] = memory[0], d0
    return y


@nb.njit()
def sense(s: Record, acc_g: np.ndarray, gyro_deg_s: np.ndarray) -> None:
    """A raw sample, both (3,), through the low passes."""
    for k in range(3):
        s.gyro_deg_s[k] = _filtered(_GYRO_FILTER, s.memory[k], F(gyro_deg_s[k]))
        s.acc_g[k] = _filtered(_ACC_FILTER, s.memory[3 + k], F(acc_g[k]))
        s.estimate.gyro_deg_s[k] = s.gyro_deg_s[k]


@nb.njit()
def believe(s: Record, core: Record) -> None:
    """kalmanCoreExternalizeState for one vehicle and its newest accelerometer sample [g].

    - Position [m], velocity [m/s] and acceleration [g] in the world, gravity taken off z.
    - Roll, legacy pitch (nose up), yaw [deg]; quaternion x, y, z, w."""
    r, q, e = core.rotation, core.quaternion, s.estimate
    for i in range(3):
        e.position_m[i] = core.state[i]
        e.velocity_m_s[i] = r[i, 0] * core.state[PX] + r[i, 1] * core.state[PX + 1] + r[i, 2] * core.state[PX + 2]
        s.acceleration_g[i] = r[i, 0] * s.acc_g[0] + r[i, 1] * s.acc_g[1] + r[i, 2] * s.acc_g[2]
    s.acceleration_g[2] -= ONE
    w, x, y, z = q[0], q[1], q[2], q[3]
    sine = min(max(-TWO * (x * z - w * y), -ONE), ONE)
    e.attitude_deg[0] = math.atan2(TWO * (y * z + w * x), w * w - x * x - y * y + z * z) * TO_DEG
    e.attitude_deg[1] = -math.asin(sine) * TO_DEG
    e.attitude_deg[2] = math.atan2(TWO * (x * y + w * z), w * w + x * x - y * y - z * z) * TO_DEG
    e.quaternion[0], e.quaternion[1], e.quaternion[2], e.quaternion[3] = x, y, z, w


@nb.njit()
def _drive(s: Record, build: np.ndarray) -> None:
    """Motors from the controller's output; all off while they are not allowed to turn."""
    if s.allowed != 0:
        s.filtered_V = filter_voltage(s.filtered_V, s.vbat_V)
        if s.controller == LEE:
            mix_wrench(s.wrench, build, s.request)
        else:
            mix_legacy(s.control, s.request)
        for i in range(4):
            s.motor[i] = s.request[i]
        drive(s.filtered_V, build, s.motor)
    else:
        for i in range(4):
            s.motor[i] = 0
    if s.override != 0:
        for i in range(4):
            s.motor[i] = s.direct[0] if s.override != 1 else s.direct[i]
        if s.override == 3:
            drive(s.filtered_V, build, s.motor)
        else:
            cap(s.motor)
    if max(s.motor[0], s.motor[1], s.motor[2], s.motor[3]) > 0:
        s.motor_on_step = s.step


@nb.njit()
def stabilizer_step(s: Record, acc_g: np.ndarray, gyro_deg_s: np.ndarray, setpoint: Record, gains: tuple[Record, ...],
                    states: tuple[Record, ...], build: np.ndarray, kalman_parameters: Record, task: Record, run: Record,
                    measurements: np.ndarray) -> None:
    """One loop of one vehicle; s LOOP, gains and states (pid, mellinger, lee), run RUN, measurements that wait."""
    s.step += 1
    sense(s, acc_g, gyro_deg_s)
    believe(s, task.core)
    if s.step % ATTITUDE_EVERY == 0:
        s.cmd_thrust = s.control.thrust
    if s.controller == LEE:
        lee_step(s.step, gains[2], states[2], setpoint, s.estimate, s.wrench)
    elif s.controller == MELLINGER:
        mellinger_step(s.step, gains[1], states[1], setpoint, s.estimate, s.control)
    else:
        pid_step(s.step, gains[0], states[0], setpoint, s.estimate, s.control)
    _drive(s, build)
    run.t_ms += 1
    for k in range(3):
        run.acc_g[k], run.gyro_deg_s[k] = s.acc_g[k], s.gyro_deg_s[k]
    task_step(kalman_parameters, task, run, measurements, 0)


class Stabilizer:
    """The records of one vehicle's loop; compiled code steps them (``stabilizer_step``), others look and set.

    loop (1,) LOOP, setpoint (1,) SETPOINT; parameters and states of the controllers by number (1,); the Kalman task.
    ``measured`` (QUEUE,) MEASUREMENT of which ``waiting`` are taken in by the next step.
    """

    def __init__(self, tick_ms: int = 1000) -> None:
        self.loop, self.setpoint = np.zeros(1, LOOP), np.zeros(1, SETPOINT)
        self.gains = (pid.defaults(), mellinger.defaults(), lee.defaults())
        self.states = (np.zeros(1, pid.STATE), np.zeros(1, mellinger.STATE), np.zeros(1, lee.STATE))
        self.build = motor_output.BUILD.copy()
        self.kalman, self.task = kalman.defaults(), np.zeros(1, kalman_task.TASK)
        self.run = np.zeros(1, kalman_task.RUN)
        self.run["t_ms"] = tick_ms
        self.measured, self.waiting = np.zeros(QUEUE, kalman_task.MEASUREMENT), 0
        self.loop["filtered_V"], self.loop["vbat_V"] = VOLTAGE_START_V, 3.7
        self.loop["motor_on_step"] = -(10**6)
        self.loop["estimate"]["quaternion"][:, 3] = ONE
        self.choose(PID)

    def choose(self, controller: int) -> None:
        """Another controller flies from the next step on, with empty integrals."""
        self.loop["controller"] = controller
        for state in self.states:
            state[:] = np.zeros(1, state.dtype)
        self.loop["control"] = np.zeros(1, CONTROL)
        self.loop["wrench"] = np.zeros(1, WRENCH)

    def measure(self, position_m: ArrayLike, quaternion: ArrayLike | None, position_sd_m: float,
                attitude_sd_rad: float) -> bool:
        """Queues a pose, or a position (quaternion None), for the filter; False if the queue was full."""
        if self.waiting >= QUEUE:
            return False
        m = self.measured[self.waiting]
        m["t_ms"], m["attitude"] = 0, quaternion is not None
        m["position_m"], m["position_sd_m"], m["attitude_sd_rad"] = position_m, position_sd_m, attitude_sd_rad
        m["quaternion"] = (0.0, 0.0, 0.0, 1.0) if quaternion is None else quaternion
        self.waiting += 1
        return True
