"""The exported controller as a shared library, behind the Controller Protocol, next to its twin in Python."""

import ctypes
import shutil
import subprocess

import numpy as np

from controllers.mpc.hover_mpc import PERIOD_S, HoverMpc
from nanobench_tools.firmware.flatness import body_rates
from nanobench_tools.firmware.motor_output import MotorOutput
from nanobench_tools.firmware.records import WRENCH

needs_compiler = not (shutil.which("cc") and shutil.which("make"))
COMMANDS = 4


def built(folder, flags="-O2"):
    """The library of an exported folder."""
    subprocess.run(["make", "-s", "-C", str(folder), "host", f"HOST_CFLAGS={flags}"], check=True, capture_output=True,
                   text=True)
    library = ctypes.CDLL(str(folder / "build-host" / "libhover_mpc.so"))
    library.hover_mpc_step.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_float, ctypes.c_void_p]
    return library


def stepped(library, state, reference, battery_V):
    """Outcome and wrench (4,) of state (13,) and reference (13,)."""
    wrench = np.zeros(4, np.float32)
    state, reference = np.asarray(state, np.float32), np.asarray(reference, np.float32)
    outcome = library.hover_mpc_step(state.ctypes.data, reference.ctypes.data, battery_V, wrench.ctypes.data)
    return outcome, wrench


class Twins:
    """The C flies one vehicle; ``wrenches`` keeps its answers (k, 4) and those of Python to the same inputs."""

    name, information, on_board, period_s = "twins", "preview", True, PERIOD_S

    def __init__(self, library, model=None):
        self.library, self.python = library, HoverMpc(model)

    def reset(self, n):
        assert n == 1
        self.library.hover_mpc_reset()
        self.python.reset(1)
        self._motors, self._wrench = MotorOutput(1, PERIOD_S), np.zeros(1, WRENCH)
        self.wrenches, self.outcomes, self.iterations = [], [], []

    def command(self, time_s, state, reference):
        jerk, turn = reference.jerk_m_s3, reference.yaw_rate_rad_s
        rates = np.zeros((1, 3)) if jerk is None else body_rates(reference.acceleration_m_s2, jerk, reference.yaw_rad,
                                                                 turn)
        now = np.hstack([state.position_m[0], state.velocity_m_s[0], state.quaternion[0], state.rate_rad_s[0]])
        goal = np.hstack([reference.position_m[0], reference.velocity_m_s[0], reference.acceleration_m_s2[0],
                          reference.yaw_rad[0], rates[0]])
        outcome, wrench = stepped(self.library, now, goal, state.battery_V[0])
        self.python.command(time_s, state, reference)
        other = self.python._wrench[0]
        self.wrenches.append((wrench, np.hstack([other["thrust_N"], other["torque_N_m"]])))
        self.outcomes.append(outcome)
        self.iterations.append(self.library.hover_mpc_iterations())
        self._wrench["thrust_N"], self._wrench["torque_N_m"] = wrench[0], wrench[1:]
        return self._motors(self._wrench, state.battery_V)

    def differences(self):
        """(k, 4): of C and Python, over the range of each command in Python."""
        c, python = np.array(self.wrenches).swapaxes(0, 1).astype(float)
        return np.abs(c - python) / np.ptp(python, axis=0)
