# %% [markdown]
# # Model-predictive control against the onboard controller
#
# The same controller objects fly the simulator and a real vehicle over a radio. Here a linear MPC and geometric
# control fly one SYNTHETIC circle, and the onboard controller does.
#
# The circle begins a metre away from where the vehicle hovers, as in recorded flights. In so short a flight most of the
# error is the way there.

# %%
import plotly.graph_objects as go

import nanobench_tools as nb
from nanobench_tools.lookup.registry import load

errors = {}
for name in ("geometric", "mpc_osqp"):
    flights = nb.simulate(1, seed=3, family="circle", seconds=6.0, controller=load("controllers", name)())
    errors[name] = 1000 * nb.control(flights).table["rmse_m"].iloc[0]
onboard = nb.control(nb.simulate(1, seed=3, family="circle", seconds=6.0)).table
errors[onboard["controller"].iloc[0]] = 1000 * onboard["rmse_m"].iloc[0]
for name, error in errors.items():
    print(f"{name:12} {error:6.0f} mm")

# %%
# alt: Tracking error of geometric control, linear MPC and the onboard controller on one circle, as bars.
figure = go.Figure(go.Bar(x=list(errors), y=list(errors.values())))
figure.update_layout(title="Tracking error along a circle", yaxis_title="RMSE, mm")
