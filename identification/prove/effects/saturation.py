"""Motors that can do no more than so much, though asked."""

from typing import ClassVar

import numpy as np

from .base import Effect


class Saturation(Effect):
    name = "saturation"
    sizes: ClassVar = {"small": "most thrust 12 % above hover", "medium": "9 %", "large": "6 %"}
    wants = ("full", "fast", "vertical", "turning")

    @staticmethod
    def draw(size, rng, airframe):
        more = 1.0 + {"small": 0.12, "medium": 0.09, "large": 0.06}[size]
        return {"T_max_N": float(f"{more * airframe.mass_kg * 9.81 / 4.0:.4g}")}

    @staticmethod
    def arrays(p, airframe):
        return {"most": p["T_max_N"]}

    @staticmethod
    def term(p, airframe):
        return {"T_max_N": p["T_max_N"]}

    def asked(self, thrust_N):
        return np.minimum(thrust_N, self.a["most"])
