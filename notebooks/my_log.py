# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
#   kernelspec: {name: python3, display_name: Python 3}
# ---

# %% [markdown]
# # My log: its content and its faults
#
# Set `NANOBENCH_NOTEBOOK_DATA` to a folder of your recordings. Without it, flights are simulated (SYNTHETIC).

# %%
import os

import nanobench_tools as nb

place = os.environ.get("NANOBENCH_NOTEBOOK_DATA")
flights = nb.load(place) if place else nb.simulate(3, seed=1, seconds=15.0)
flights

# %% [markdown]
# One line per flight: how much of it is usable, what is wrong, what to do.

# %%
audits = nb.audit(flights)
audits

# %% [markdown]
# The first one in detail. Every row is one event, for any number of streams in which it shows.

# %%
first = audits[0]
print(first.verdict)
first.faults

# %%
first.plot()

# %% [markdown]
# What can this recording be used for? An empty text means: for this.

# %%
first.can

# %% [markdown]
# All streams on one grid, as a DataFrame with units in the second column level.

# %%
table = flights[0].to_pandas(rate_hz=100)
usable = first.usable[0]
table.loc[usable.start_s:usable.end_s].describe().T

# %% [markdown]
# Your own table becomes a flight by `Flight.from_pandas`. Units are turned into SI on the way in.

# %%
mine = nb.Flight.from_pandas({name: flights[0][name].to_pandas() for name in ("mocap", "imu", "motor")}, name="mine")
nb.audit(mine)
