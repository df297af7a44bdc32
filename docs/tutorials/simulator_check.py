# %% [markdown]
# # 3. Is my simulator good?
#
# This tutorial makes a simulator with a known mistake and asks `nb.diagnose` to find it. The flights are SYNTHETIC.
# First, a simulator is fitted to them.

# %%
import re

import nanobench_tools as nb

flights = nb.sample()
model = nb.fit(flights)
print(model.to_toml()[:420])

# %% [markdown]
# Now the mistake: the thrust of every motor is made 16 % too strong.

# %%
text = model.to_toml()
scale = float(re.search(r'name = "thrust_scale".*?\ns = ([\d.]+)', text, re.S)[1])
with open("simulator.toml", "w") as file:
    file.write(re.sub(r'(name = "thrust_scale".*?\ns = )[\d.]+', rf"\g<1>{1.16 * scale:.4f}", text, flags=re.S))

found = nb.diagnose(flights, "simulator.toml")
print(found.sentence)
print(found.good_for)

# %% [markdown]
# Mass and thrust cannot be distinguished in free flight: only their ratio accelerates the vehicle. The diagnosis
# reports both as one class. A scale decides between them.

# %%
print(found.findings[["term", "or", "confidence", "believed", "value", "ci95_low", "ci95_high", "unit"]]
      .round(4).to_string(index=False))

# %% [markdown]
# Predictions of flights that were left out become better with the correction:

# %%
# alt: Errors of predictions before and after the correction, as bars for each quantity and time predicted.
found.plot()

# %% [markdown]
# `found.to_toml("corrected.toml")` writes the corrected simulator. In the simulator without the mistake, thrust and
# mass are left alone:

# %%
print(nb.diagnose(flights, model).sentence)

# %% [markdown]
# One mistake of it is known here: `nb.fit` took the lag of the motors, 0.055 s up and 0.119 s down, from a prior. The
# simulated vehicle has 0.045 s in both directions. So the most probable effect is right, and just misses the certainty
# that a finding needs.
#
# The flights that fitted the model also judge it here, because the sample is small. With your own data, fit on some
# flights and diagnose with others. [Reading a diagnosis](../concepts/reading_a_diagnosis.md) explains every line.
