# %% [markdown]
# # A simulator that is a Python function
#
# A simulator of your own is called with what was measured along a flight, and returns accelerations. This one has four
# quadratic motors and nothing else. The flights are SYNTHETIC.

# %%
import numpy as np

import nanobench_tools as nb


def accelerations(along):
    lift = 0.0117 * (along.motor * along.battery_V[:, None]) ** 2  # N, (n, 4)
    force = lift.sum(axis=1)[:, None] * [0.0, 0.0, 1.0]
    torque = np.stack([0.0325 * lift @ [-1, -1, 1, 1], 0.0325 * lift @ [-1, 1, 1, -1],
                       0.006 * lift @ [-1, 1, -1, 1]], axis=1)  # N m, (n, 3)
    return force / 0.041, torque / [1.8e-5, 1.8e-5, 3.1e-5]


found = nb.diagnose(nb.sample(), accelerations, mass_kg=0.041)
print(found.sentence)
print(found.good_for)

# %%
# alt: Errors of predictions before and after the correction, as bars for each quantity and time predicted.
found.plot()
