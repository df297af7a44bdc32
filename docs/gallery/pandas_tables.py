# %% [markdown]
# # Flights in pandas
#
# Streams and results are DataFrames, and DataFrames become flights. The flights are SYNTHETIC.

# %%
import numpy as np
import plotly.graph_objects as go

import nanobench_tools as nb

flight = nb.sample()["sample_circle"]
imu, poses = flight["imu"].to_pandas(), flight["mocap"].to_pandas()
print(imu["acc_z"].describe().round(3).T.to_string())

# %% [markdown]
# Units are turned into SI on the way in. A flight made from tables is audited as any other:

# %%
again = nb.Flight.from_pandas({"mocap": poses, "imu": imu})
print(nb.audit(again).verdict)

# %%
# alt: Vertical specific force and height of a flight over time.
table = flight.to_pandas(rate_hz=20)
force = imu["acc_z"].to_numpy().ravel()
figure = go.Figure(go.Scatter(x=imu.index[::5], y=np.round(force[::5], 3), name="acc_z"))
figure.update_layout(title="Vertical specific force", xaxis_title="time, s", yaxis_title="m/s²")
