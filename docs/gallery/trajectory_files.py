# %% [markdown]
# # The trajectory of another program
#
# An estimator that runs elsewhere writes TUM files: `t x y z qx qy qz qw`. Here the logged estimate of each SYNTHETIC
# flight is written in that way, and scored.

# %%
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import plotly.graph_objects as go

import nanobench_tools as nb

flights = nb.sample()
Path("mine").mkdir()
for flight in flights:
    logged, attitude = flight["estimator"], flight["attitude_qw"]
    turn = np.column_stack([np.interp(logged.time_s, attitude.time_s, attitude[q]) for q in ("qx", "qy", "qz", "qw")])
    rows = np.column_stack([flight.epoch_s + logged.time_s, logged["x", "y", "z"], turn])
    np.savetxt(f"mine/{flight.name}.tum", rows, fmt="%.6f")

nanobench = [sys.executable, "-m", "nanobench_tools.cli.main"]
subprocess.run([*nanobench, "sample", "--quiet"], check=True)
subprocess.run([*nanobench, "estimate", "sample", "--trajectory-dir", "mine", "--quiet", "--json", "scores.json"],
               check=True)
scores = {(row["method"], row["group"]): row for row in json.loads(Path("scores.json").read_text())["rows"]}
row = next(row for (method, group), row in scores.items() if group == "all")
print(f"{row['method']}: ATE {1000 * row['metrics']['ate_rmse_m']['mean']:.1f} mm over {row['n']} flights")

# %%
# alt: The three written trajectories from above: a circle, a multisine and a trefoil.
figure = go.Figure([go.Scatter(x=flight["estimator"]["x"][::10].round(3), y=flight["estimator"]["y"][::10].round(3),
                               name=flight.name) for flight in flights])
figure.update_layout(title="Logged estimates from above", xaxis_title="x, m", yaxis_title="y, m", yaxis_scaleanchor="x")
