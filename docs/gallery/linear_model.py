# %% [markdown]
# # A linear model for control design
#
# A fitted vehicle is linearised at hover for python-control. Without a controller it is unstable: a moment of the air
# tips a vehicle that moves. The delay of the commands is approximated, with poles far on the left. The flights are
# SYNTHETIC.

# %%
import numpy as np
import plotly.graph_objects as go

import nanobench_tools as nb

model = nb.fit(nb.sample())
plant = model.linearize(battery_V=3.7)
print(plant.nstates, "states,", plant.ninputs, "inputs,", plant.noutputs, "outputs")
poles = np.unique(np.round(np.linalg.eigvals(plant.A).real, 2))
print("real parts of the poles, 1/s:", *poles)

# %%
# alt: Poles of the linear model near the origin of the complex plane: real ones on the left, two pairs on the right.
values = np.round(np.linalg.eigvals(plant.A), 3)
figure = go.Figure(go.Scatter(x=values.real, y=values.imag, mode="markers", marker={"size": 10, "symbol": "x"}))
figure.update_layout(title="Poles at hover", xaxis_title="real, 1/s", yaxis_title="imaginary, 1/s",
                     xaxis_range=[-15, 5], yaxis_range=[-8, 8])
