# %% [markdown]
# # 4. Fit a vehicle and its thrust
#
# `nb.fit` combines flights with priors from thrust-stand data and the firmware. The flights are SYNTHETIC, of one
# vehicle with a mass of 40.85 g.

# %%
import nanobench_tools as nb

flights = nb.sample()
model = nb.fit(flights, mass_kg=0.04085)
print(model.parameters_.loc[["thrust_scale.s", "drag_linear.d[0]", "drag_linear.d[1]", "motor_lag.tau_up_s"],
                            ["value", "ci95_low", "ci95_high", "ci_why"]].to_string(max_colwidth=32))

# %% [markdown]
# The last column matters: a value marked "prior" was not seen in these flights. `trouble` is empty where the fit is
# physically plausible.

# %%
print(model.trouble or "no trouble")

# %% [markdown]
# The score is the error of predictions after one, ten and fifty steps of 10 ms, without feedback:

# %%
print(model.score(flights).round(4).to_string())

# %%
# alt: Parameters of the fitted vehicle with their 95 % intervals.
model.plot().update_layout(height=640)

# %% [markdown]
# Thrust of one motor follows from its command and the battery voltage. From flights, only thrust over mass is visible,
# so the mass has to be known.

# %%
thrust = nb.thrust(flights, mass_kg=0.04085)
print(thrust.formula)
print(f"{1000 * float(thrust.thrust_N(0.8, 3.6)):.1f} mN at a command of 0.8 and 3.6 V")

# %% [markdown]
# The battery of a short flight has a small range of voltages. `thrust.sentence` therefore warns that the formula is not
# valid at other voltages.

# %%
# alt: Thrust of one motor over its command, for the voltages of the flights.
thrust.plot()

# %% [markdown]
# `model.to_toml("vehicle.toml")` writes the simulator, and `nanobench convert vehicle.toml --to rotorpy` exports it.
# On the command line: `nanobench sysid sample --out model` and `nanobench thrust sample --mass 0.04085`.
