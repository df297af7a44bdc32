# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
#   kernelspec: {name: python3, display_name: Python 3}
# ---

# %% [markdown]
# # My simulator: where is it wrong
#
# This simulator is 15 % heavier than the vehicle that flew. The diagnosis has to say that its
# thrust per mass is wrong, how large that is, and how much better it predicts once mended. All else is fitted with
# every term: further omissions of a simulator would be reported with the effect, or hide it.

# %%
import os
from dataclasses import replace

import nanobench_tools as nb
from nanobench_tools.physics import Model

place = os.environ.get("NANOBENCH_NOTEBOOK_DATA")
flights = nb.load(place) if place else nb.simulate(3, seed=1, seconds=15.0)

# %%
fitted = nb.fit(flights).model
believed = Model(replace(fitted.vehicle, mass_kg=1.15 * fitted.vehicle.mass_kg), fitted.as_dict())

# %%
found = nb.diagnose(flights, believed)
print(found.sentence)
found.good_for

# %%
found.findings

# %% [markdown]
# Errors on flights left out of the fit, before and after mending.

# %%
found.improvement

# %%
found.plot()
