"""A path that is moved to a place."""

from dataclasses import dataclass

import numpy as np

from ...practice.curves import PathPoint
from ...practice.references import PathSpec


@dataclass(frozen=True)
class PlacedPath(PathSpec):
    """``centre_m``: where the origin of the path lies, x y z [m]."""

    centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def altitude_m(self) -> float:
        """Height to which the take-off goes."""
        return super().altitude_m + self.centre_m[2]

    def at(self, t: np.ndarray) -> PathPoint:
        """t (n,) s from the start of the path."""
        point = super().at(t)
        return point._replace(position_m=point.position_m + np.array(self.centre_m))
