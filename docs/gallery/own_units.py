# %% [markdown]
# # A table with its own names and units
#
# This table has positions in millimetres, turning rates in degrees a second, and unknown names. `nanobench columns`
# drafts its map from the names and the values. The data are SYNTHETIC.

# %%
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import plotly.graph_objects as go

import nanobench_tools as nb

flight = nb.sample()["sample_circle"]
poses, imu = flight["mocap"], flight["imu"]
table = pd.DataFrame({"stamp_ms": 1000 * poses.time_s})
for axis, name in zip("xyz", ("px", "py", "pz"), strict=True):
    table[f"pos_{axis}_mm"] = 1000 * poses[name]
for name in ("qw", "qx", "qy", "qz"):
    table[name] = poses[name]
for axis in "xyz":
    table[f"gyro_{axis}[deg/s]"] = np.degrees(np.interp(poses.time_s, imu.time_s, imu[f"gyro_{axis}"]))
    table[f"acc_{axis}[g]"] = np.interp(poses.time_s, imu.time_s, imu[f"acc_{axis}"]) / 9.80665
table.to_csv("mine.csv", index=False)

subprocess.run([sys.executable, "-m", "nanobench_tools.cli.main", "columns", "mine.csv", "--out", "columns.toml"],
               capture_output=True, check=True)
print(Path("columns.toml").read_text())

# %% [markdown]
# With the map, the table is a flight in SI units:

# %%
again = nb.load_flight("mine.csv", columns="columns.toml")
print(again["mocap"].to_pandas().head(2).round(4))
print(nb.audit(again).verdict)

# %%
# alt: The path of the table from above, in metres.
path = again["mocap"]["px", "py"][::10].round(3)
figure = go.Figure(go.Scatter(x=path[:, 0], y=path[:, 1]))
figure.update_layout(title="The path from above", xaxis_title="x, m", yaxis_title="y, m")
