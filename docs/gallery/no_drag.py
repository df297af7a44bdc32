# %% [markdown]
# # A simulator without drag
#
# Many simulators of small quadrotors have no drag of the air. Here drag is removed from a simulator that was fitted to
# the SYNTHETIC flights, and the diagnosis has to find out what is missing.

# %%
import re

import nanobench_tools as nb

flights = nb.sample()
text = nb.fit(flights).to_toml()
without = re.sub(r'\[\[terms\]\]\nname = "drag_linear".*?(?=\n\[\[terms\]\])', "", text, flags=re.S)
with open("no_drag.toml", "w") as file:
    file.write(without)

found = nb.diagnose(flights, "no_drag.toml")
print(found.sentence)
columns = ["term", "or", "confidence", "believed", "value", "unit"]
print(found.findings[columns].to_string(index=False, float_format="{:.3g}".format))

# %% [markdown]
# Three terms explain the residual equally well on these short flights, and they are reported as one class. The residual
# shows the drag; predictions over half a second hardly change with it.

# %%
# alt: Errors of predictions before and after the correction, as bars for each quantity and time predicted.
found.plot()
