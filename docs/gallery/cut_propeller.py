# %% [markdown]
# # A cut propeller
#
# A damaged propeller needs a higher command for the same thrust. Here four SYNTHETIC vehicles fly twice: as they are,
# and with a third motor that gets only 93 % of its command. By the firmware's thrust curve that is 14 % less thrust
# in hover. `nanobench diagnose --normal` compares the commands of the second flights with those of the first.

# %%
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import plotly.graph_objects as go

import nanobench_tools as nb
from controllers.onboard_pid import OnboardPid
from nanobench_tools.sources import write_nanobench


class OnCutPropeller(OnboardPid):
    """The onboard PID; its third motor gets 93 % of the command."""

    def command(self, time_s: float, state: object, reference: object) -> np.ndarray:
        return super().command(time_s, state, reference) * [1.0, 1.0, 0.93, 1.0]


normal = nb.simulate(4, seed=5, seconds=8.0, controller=OnboardPid())
cut = nb.simulate(4, seed=5, seconds=8.0, controller=OnCutPropeller())
for flight in normal:
    write_nanobench(flight, Path("normal") / f"{flight.name}.csv")
for flight in cut:
    motor = flight["motor"]
    sent = replace(motor, values=motor.values / [1.0, 1.0, 0.93, 1.0])  # the log has the command of the controller
    write_nanobench(flight.with_streams(motor=sent), Path("cut") / f"{flight.name}.csv")

# %%
options = "--data cut --normal normal --nothing-added --same-vehicle --out found --quiet"
subprocess.run([sys.executable, "-m", "nanobench_tools.cli.main", "diagnose", *options.split()], check=True)
verdict = json.loads(Path("found/verdict.json").read_text())
print(verdict["paragraph"])

# %%
# alt: Change of the commanded thrust of each motor: 17 per cent for motor 3, near zero for the others.
change = verdict["trim"]["change_percent"]
figure = go.Figure(go.Bar(x=[f"motor {i}" for i in (1, 2, 3, 4)], y=change,
                          error_y={"array": [verdict["trim"]["normal_sd_percent"]] * 4}))
figure.update_layout(title="Change of the commanded thrust", yaxis_title="%")
