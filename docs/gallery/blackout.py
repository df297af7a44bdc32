# %% [markdown]
# # After the last pose
#
# In the protocol `blackout`, an estimator gets no pose after a time *t0*. Its error then grows with time. The flights
# are SYNTHETIC.

# %%
import plotly.graph_objects as go

import nanobench_tools as nb

found = nb.estimate(nb.sample(), ["drag_ekf", "error_state_ekf", "constant_velocity"], protocol="blackout")
print(found.sentence)

# %%
# alt: Position error of three estimators 1 and 5 s after the last pose, on a logarithmic axis.
table = found.table[found.table["group"] == "all"].set_index(["method", "metric"])["mean"]
after = (1, 5)
figure = go.Figure([go.Bar(name=method, x=[f"{s} s" for s in after],
                           y=[table.get((method, f"end_error_{s}s_m")) for s in after])
                    for method in found.metrics.index])
figure.update_layout(title="Position error after the last pose", yaxis_title="m", yaxis_type="log")
