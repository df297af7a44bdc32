# %% [markdown]
# # 5. A controller of your own
#
# A controller is a class with `name`, `information`, `period_s`, `reset(n)` and `command(time_s, state, reference)`. It
# steers `n` vehicles at once and returns motor commands from 0 to 1. This one tilts towards the wanted position.

# %%
import numpy as np
import pandas as pd

import nanobench_tools as nb
from nanobench_tools import so3
from nanobench_tools.frames import MOTOR_SIGNS, gravity_up


class TiltAndTurn:
    name = "tilt_and_turn"
    information = "as flown"  # position and yaw of the set-point only
    period_s = 0.002
    hover_V = 2.75  # mean motor voltage that carries the vehicle

    def reset(self, n):
        self.pull, self.rate = np.zeros((n, 3)), np.zeros((n, 3))

    def command(self, time_s, state, reference):
        error = np.clip(reference.position_m - state.position_m, -0.5, 0.5)
        self.pull = np.clip(self.pull + 2.0 * error * self.period_s, -2.0, 2.0)
        wanted = gravity_up() + 7.0 * error - 4.5 * state.velocity_m_s + self.pull  # specific force, m/s^2
        lift = np.linalg.norm(wanted, axis=1, keepdims=True)
        up = so3.rotate_inverse(state.quaternion, wanted / lift)  # the wanted thrust axis in the body frame
        yaw = np.remainder(reference.yaw_rad - so3.euler_zyx(state.quaternion)[:, 2] + np.pi, 2 * np.pi) - np.pi
        turn = np.column_stack([-up[:, 1], up[:, 0], 0.5 * yaw])  # rotation vector, rad
        lead = 0.03 * (state.rate_rad_s - self.rate) / self.period_s  # compensates the lag of the motors
        self.rate = state.rate_rad_s
        moment = np.array([0.05, 0.05, 0.1]) * (8.0 * turn - state.rate_rad_s - lead)
        ratio = self.hover_V * np.sqrt(lift / 9.81) / state.battery_V[:, None]
        return np.clip(ratio + moment @ MOTOR_SIGNS.T, 0.0, 1.0)


# %% [markdown]
# Let it fly two SYNTHETIC vehicles along a circle, and the onboard controllers along the same paths.

# %%
mine = nb.control(nb.simulate(2, seed=1, family="circle", seconds=8.0, controller=TiltAndTurn()))
theirs = nb.control(nb.simulate(2, seed=1, family="circle", seconds=8.0))
print(pd.concat([mine.table, theirs.table])[["reference", "speed", "controller", "n", "rmse_m", "rmse_lag_removed_m"]]
      .round(3).to_string(index=False))

# %% [markdown]
# The error has two parts. A controller that sees the position of the set-point alone lags behind it; the last column
# removes a constant lag.

# %%
# alt: Tracking error of the new controller along the slow and the medium circle.
mine.plot()

# %% [markdown]
# Gains can be searched with `nb.tune`, which judges them on plants and paths that the search did not use. The same
# object runs over a radio: `nanobench fly --controller module:TiltAndTurn --dry-run`; see [Flying](../flying.md).
