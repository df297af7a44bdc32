# %% [markdown]
# # A wind, or a shifted centre of mass
#
# This simulator believes in a wind of 1 m/s. The SYNTHETIC flights were in still air. Three flights at one heading show
# that something turns the vehicle, and not what. A wind, a shifted centre of mass and unequal motors are one finding.
# The diagnosis does not guess between them.

# %%
import nanobench_tools as nb
from nanobench_tools.physics.model import find_term

flights = nb.sample()
model = nb.fit(flights).model
diagnosis = nb.diagnose(flights, model.with_term("wind", w_m_s=(1.0, 0.0, 0.0)))
print(diagnosis.outcome)
print(diagnosis.sentence)

# %% [markdown]
# Every term lists effects that look like it in flight, and the flight that separates them.

# %%
for other, flight in find_term("wind").confused_with.items():
    print(f"wind or {other}: {flight}")

# %%
# alt: Errors of predictions by this simulator, by quantity and time ahead, as bars on a logarithmic scale.
diagnosis.plot()
