"""The air of the room moves."""

from typing import ClassVar

from .effect import Effect, near, turned


class Wind(Effect):
    name = "wind"
    sizes: ClassVar = {"small": "0.15 m/s, a draught", "medium": "0.4 m/s", "large": "1.0 m/s, a fan"}
    wants = ("turning", "fast", "lateral")

    @staticmethod
    def draw(size, rng, airframe):
        speed = near(rng, {"small": 0.15, "medium": 0.4, "large": 1.0}[size])
        return {"w_m_s": [float(f"{x:.4g}") for x in turned(rng, speed, 0.2)]}

    @staticmethod
    def arrays(p, airframe):
        return {"w": p["w_m_s"]}

    @staticmethod
    def term(p, airframe):
        return {"w_m_s": p["w_m_s"]}

    def wind(self):
        return self.a["w"]
