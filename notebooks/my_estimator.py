# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
#   kernelspec: {name: python3, display_name: Python 3}
# ---

# %% [markdown]
# # My estimator against the ones that are here
#
# An estimator is a class with a name, `causal`, and `estimate(flight)`. In the protocol `aided` it gets ten noisy poses
# of the motion capture a second, 30 ms late, and every other stream whole.

# %%
import os

import numpy as np

import nanobench_tools as nb

place = os.environ.get("NANOBENCH_NOTEBOOK_DATA")
flights = nb.load(place) if place else nb.simulate(3, seed=1, seconds=15.0)


class LastPose:
    """Says that the vehicle is where it was last seen, and goes on with the velocity between the last two poses."""

    name = "last_pose"
    causal = True

    def estimate(self, flight: nb.Flight) -> nb.Estimate:
        poses, at = flight["mocap"], flight["imu"].time_s
        seen, where = poses.time_s, poses["px", "py", "pz"]
        velocity = np.gradient(where, seen, axis=0)
        velocity[1:] = np.diff(where, axis=0) / np.diff(seen)[:, None]  # of the past alone
        row = np.clip(np.searchsorted(seen, at, side="right") - 1, 0, len(seen) - 1)
        since = np.clip(at - seen[row], 0.0, 0.2)[:, None]
        return nb.Estimate(at, where[row] + velocity[row] * since, poses["qx", "qy", "qz", "qw"][row])


# %%
found = nb.estimate(flights, [LastPose(), "drag_ekf"])
found

# %% [markdown]
# Better means that the interval of the ratio on the same flights excludes one. `given` says what each method got.

# %%
table = nb.compare(flights, [LastPose(), "drag_ekf"])
table[table["metric"] == "ate_rmse_m"][["method", "mean", "ratio", "ratio_low", "ratio_high", "n", "given", "ci_why"]]

# %%
found.plot()
