# %% [markdown]
# # One vehicle for other simulators
#
# A fitted vehicle is exported to RotorPy, Crazyflow, URDF, C and CasADi. The report lists what each target approximates
# and what it leaves out. The flights are SYNTHETIC.

# %%
import subprocess
import sys

import plotly.graph_objects as go

import nanobench_tools as nb

model = nb.fit(nb.sample())
model.to_toml("vehicle.toml")
command = [sys.executable, "-m", "nanobench_tools.cli.main", "convert", "vehicle.toml", "--to"]
for target in ("rotorpy", "urdf"):
    done = subprocess.run([*command, target, "--out", "exported"], capture_output=True, text=True, check=True)
    print(done.stdout)

# %%
# alt: Thrust of the fitted vehicle's motors over the command at two battery voltages, from its formula.
found = model.parameters_["value"]
c, s = [found[f"thrust_voltage.c[{k}]"] for k in range(4)], found["thrust_scale.s"]
u = [0.1 * k for k in range(11)]
figure = go.Figure([go.Scatter(x=u, y=[1000 * s * sum(c[k] * (x * volts) ** k for k in range(4)) for x in u],
                               name=f"{volts} V") for volts in (3.9, 3.5)])
figure.update_layout(title="Thrust of one motor of the fitted vehicle", xaxis_title="command", yaxis_title="mN")
