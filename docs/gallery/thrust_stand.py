# %% [markdown]
# # A thrust map from stand data
#
# Thrust-stand tables give thrust against command and voltage. These tables are SYNTHETIC: four motors of
# 0.011 N/V² each.

# %%
from pathlib import Path

import numpy as np
import plotly.graph_objects as go

import nanobench_tools as nb

for name, levels in (("first", (4.1, 3.7, 3.3)), ("second", (4.0, 3.6, 3.2))):
    pwm, volts = np.tile(np.linspace(8000, 65000, 30).astype(int), 3), np.repeat(levels, 30)
    newton = 4 * 0.011 * (pwm / 65535 * volts) ** 2
    speed = 20000 * np.sqrt(newton)
    rows = [f"{p},{v:.3f},{w:.0f},{w:.0f},{w:.0f},{w:.0f},{n / 9.81e-3:.3f}"
            for p, v, w, n in zip(pwm, volts, speed, newton, strict=True)]
    Path(f"{name}.csv").write_text("\n".join(["pwm,vbat[V],rpm1,rpm2,rpm3,rpm4,thrust[g]", *rows]))

found = nb.thrust(nb.load(["first.csv", "second.csv"]), mass_kg=0.0408)
print(found.formula)
for volts in (4.0, 3.5):
    fitted, true = float(found.thrust_N(0.7, volts)), 0.011 * (0.7 * volts) ** 2
    print(f"{volts} V: {1000 * fitted:.1f} mN at 0.7, made with {1000 * true:.1f} mN")

# %%
# alt: Thrust of one motor over its command for three battery voltages; a lower voltage gives less thrust.
command = np.linspace(0.1, 1.0, 40)
figure = go.Figure([go.Scatter(x=command, y=1000 * found.thrust_N(command, volts), name=f"{volts} V")
                    for volts in (4.1, 3.7, 3.3)])
figure.update_layout(title="Thrust of one motor", xaxis_title="command", yaxis_title="mN")
