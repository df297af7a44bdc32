# %% [markdown]
# # A tracker that loses the vehicle
#
# A known fault is put into a SYNTHETIC flight: the motion capture does not see the vehicle for half a second. The audit
# does not know about it, and finds it.

# %%
import numpy as np

import nanobench_tools as nb
from nanobench_tools.practice.inject import INJECTIONS

clean = nb.sample()["sample_circle"]
broken, truth = INJECTIONS["mocap_occlusion"].function(clean, np.random.default_rng(1), 0.5)
print(f"put in: {truth.kind} from {truth.start_s:.2f} to {truth.end_s:.2f} s")

audit = nb.audit(broken)
found = audit.faults.set_index("kind").loc["mocap_occlusion"]
print(f"found:  mocap_occlusion from {found['from_s']:.2f} to {found['to_s']:.2f} s")
print(audit.verdict)

# %%
# alt: Height of the flight with the span in which the motion capture did not see the vehicle.
audit.plot()
