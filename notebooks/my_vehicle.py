# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
#   kernelspec: {name: python3, display_name: Python 3}
# ---

# %% [markdown]
# # My vehicle: what physics does it obey
#
# Physical terms are fitted to their predictions half a second ahead.
# Mass comes from a scale: flights show ratios to it.

# %%
import os

import nanobench_tools as nb

place = os.environ.get("NANOBENCH_NOTEBOOK_DATA")
flights = nb.load(place) if place else nb.simulate(3, seed=1, seconds=15.0)
train, test = flights[:-1], flights[-1:]

# %%
model = nb.fit(train, terms=["thrust_voltage", "motor_lag", "drag_linear", "inertia"], mass_kg=0.04085)
print(model.summary())
model.parameters_

# %% [markdown]
# A failed fit has a message in `trouble`: a parameter at its bound, a vehicle that does not fly.

# %%
model.trouble

# %% [markdown]
# Judged on a flight that it has not seen: mean errors after 1, 10 and 50 steps of 10 ms.

# %%
model.score(test)

# %%
model.plot()
