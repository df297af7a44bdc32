"""How fast the firmware's control code runs in batch, as multiples of real time on one core.

    python benchmarks/speed/firmware_speed.py [--vehicles 1000] [--seconds 2]

A chain is estimate and setpoint in, PWM out: the controller at every step of the 1 kHz loop. Mixer, battery
compensation of four motors and cap run at 500 Hz. Compilation is not counted. The plain version is a cascade of as
many PID loops as the firmware has, in Python.
"""

import argparse
import time

import numpy as np
from kept import show

from nanobench_tools.firmware import lee, mellinger, motor_output, pid
from nanobench_tools.firmware.records import ABSOLUTE, CONTROL, ESTIMATE, SETPOINT, WRENCH

CHUNK = 20
"""Steps for which the same inputs are held: 20 ms."""


def chain_s(code, output, drive, n: int, steps: int) -> float:
    """Seconds of wall clock for ``steps`` of n vehicles."""
    rng = np.random.default_rng(0)
    setpoint, estimate = np.zeros((CHUNK, n), SETPOINT), np.zeros((CHUNK, n), ESTIMATE)
    for mode in ("mode_x", "mode_y", "mode_z", "mode_yaw"):
        setpoint[mode] = ABSOLUTE
    for name in ("position_m", "velocity_m_s", "attitude_deg", "gyro_deg_s"):
        estimate[name] = rng.standard_normal((CHUNK, n, 3))
    estimate["quaternion"][..., 3] = 1.0
    state, control, trace = np.zeros(n, code.STATE), np.zeros((CHUNK, n), output), np.zeros((0, n), code.STATE)
    volt, filtered, counts = np.full(n, 3.7, np.float32), np.full(n, 3.7, np.float32), np.zeros((n, 4), np.int32)
    parameters = code.defaults()

    def run(count: int) -> None:
        for first in range(1, count + 1, CHUNK):
            code.run_steps(np.arange(first, first + CHUNK), parameters, state, setpoint, estimate, control, trace)
            for k in range(1, CHUNK, 2):
                drive(2, control[k], volt, filtered, motor_output.BUILD, counts)

    run(CHUNK)
    before = time.perf_counter()
    run(steps)
    return time.perf_counter() - before


def plain_step_s(steps: int = 20000) -> float:
    """Seconds of a step of position, velocity, attitude and rate loops on three axes in plain Python."""
    integral, last, wanted = [[0.0] * 3 for _ in range(4)], [[0.0] * 3 for _ in range(4)], [0.0] * 3
    before = time.perf_counter()
    for _ in range(steps):
        for axis in range(3):
            command = 1.0
            for loop in range(4):
                error = command - wanted[axis]
                integral[loop][axis] = min(max(integral[loop][axis] + 0.001 * error, -1.0), 1.0)
                command = 2.0 * error + 0.5 * integral[loop][axis] + 0.01 * (error - last[loop][axis]) / 0.001
                last[loop][axis] = error
            wanted[axis] = min(max(command, -1.0), 1.0)
    return (time.perf_counter() - before) / steps


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vehicles", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=2.0)
    given = parser.parse_args()
    steps = CHUNK * max(round(1000.0 * given.seconds / CHUNK), 1)
    plain_s = plain_step_s()
    for name, code, output, drive in (("PID", pid, CONTROL, motor_output.drive_legacy),
                                      ("Mellinger", mellinger, CONTROL, motor_output.drive_legacy),
                                      ("Lee", lee, WRENCH, motor_output.drive_wrench)):
        for n in sorted({1, given.vehicles}):
            wall = chain_s(code, output, drive, n, steps)
            print(f"{name:10} {n:6} vehicles, {steps} steps of 1 ms: {1e9 * wall / (n * steps):7.0f} ns a step, "
                  f"{1e-3 * n * steps / wall:8.0f} x real time")
        show(f"plain Python cascade / {name}, a step in a batch", plain_s * n * steps / wall, steps)


if __name__ == "__main__":
    main()
