# %% [markdown]
# # 1. A first log and its audit
#
# An audit comes before anything else is computed. It finds the faults of a recording, and the part of it that is
# usable. The package contains three short SYNTHETIC flights for this.

# %%
import nanobench_tools as nb

flights = nb.sample()
print(flights)

# %% [markdown]
# Your own files are read with `nb.load("folder/")`. Each flight has streams, and each stream has columns in SI units:

# %%
flight = flights["sample_trefoil"]
print(flight["imu"].to_pandas().head(3))

# %% [markdown]
# Audit all of them. The severity is `fine`, `minor`, `cut` or `unusable`.

# %%
audits = nb.audit(flights)
for audit in audits:
    print(audit)

# %% [markdown]
# One recording is cut. The picture shows why: the radio log stopped in the air, and the recorder continued every column
# with a straight line. Motion capture goes on.

# %%
# alt: Height of the trefoil by motion capture and by the estimate, which goes on along a straight line after 13 s.
audits["sample_trefoil"].plot()

# %% [markdown]
# Every event is a row of `faults`. An event may join several stretches of time. Then `from_s` is the begin of the first
# and `to_s` the end of the last. `cut_s` are the seconds of flight that are cut.

# %%
faults = audits["sample_trefoil"].faults
print(faults[["kind", "from_s", "to_s", "cut_s"]].to_string(index=False))
print(audits["sample_trefoil"].usable)

# %% [markdown]
# The clock of another recording wanders. [Clock error](../concepts/clock_error.md) explains it, and
# [tutorial 2](compare_estimators.md) removes it.

# %%
wander = audits["sample_multisine_sysid"].faults
print(wander.loc[wander["kind"] == "clock_wander", "what"].iloc[0])

# %% [markdown]
# On the command line: `nanobench sample`, then `nanobench audit sample`. Every kind of fault is described in
# [Faults](../reference/faults.md).
