# %% [markdown]
# # A log that stopped in the air
#
# The radio link dies, and the recorder continues every column with a straight line. Three flights of the public
# recordings ended so, and their scores are averages over a line. This SYNTHETIC flight has the same fault.

# %%
import nanobench_tools as nb

flight = nb.sample()["sample_trefoil"]
audit = nb.audit(flight)
print(audit.severity, audit.usable)

# %% [markdown]
# The estimate is scored over the usable span alone, without a setting:

# %%
print(nb.estimate(flight, "onboard_ekf", protocol="clean").metrics[["n", "ate_rmse_m"]].round(4))

# %%
# alt: Height of a flight whose log stopped. The estimate leaves the motion capture along a straight line.
audit.plot()
