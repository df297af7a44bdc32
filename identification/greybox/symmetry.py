"""What each nuisance sees of the features, by the symmetry of the vehicle.

A quadrotor looks the same after a quarter turn about z, and in a mirror. So gains learned about roll are valid for
pitch. For a turning quantity (rate, moment, attitude error), x is to roll what y is to pitch. For a moving one
(velocity, tilt of gravity), y is to roll what -x is to pitch. Yaw depends on z of turning quantities, thrust on z of
moving ones and on scalars. In addition, every nuisance has its own constant, as no single vehicle is symmetric.
Halving what has to be learnt, and leaving out what the symmetry forbids, matters where fifteen flights have to teach
it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

SIDES = ("roll", "pitch", "yaw", "thrust")


@dataclass
class Features:
    """Arrays of features, and ``views``: for each of SIDES [(column, sign)], matched between roll and pitch."""

    arrays: list[np.ndarray] = field(default_factory=list)
    views: dict[str, list[tuple[int, float]]] = field(default_factory=lambda: {side: [] for side in SIDES})

    def _add(self, array: np.ndarray) -> int:
        at: int = sum(a.shape[1] for a in self.arrays)
        self.arrays.append(array)
        return at

    def turn(self, vector: np.ndarray) -> None:
        """(n, 3) body components of a rate, a moment, a small rotation."""
        at = self._add(vector)
        for side, column in (("roll", at), ("pitch", at + 1), ("yaw", at + 2)):
            self.views[side].append((column, 1.0))

    def lean(self, vector: np.ndarray) -> None:
        """(n, 2) x and y of a turning quantity."""
        at = self._add(vector)
        self.views["roll"].append((at, 1.0))
        self.views["pitch"].append((at + 1, 1.0))

    def move(self, vector: np.ndarray) -> None:
        """(n, 3) body components of a velocity, a force."""
        at = self._add(vector)
        for side, column, sign in (("roll", at + 1, 1.0), ("pitch", at, -1.0), ("thrust", at + 2, 1.0)):
            self.views[side].append((column, sign))

    def level(self, scalar: np.ndarray) -> None:
        """(n,) what no turn about z changes."""
        self.views["thrust"].append((self._add(scalar[:, None]), 1.0))

    def matrix(self) -> np.ndarray:
        """(n, F)."""
        return np.concatenate(self.arrays, axis=1)


def joined(parts: Sequence[Features]) -> Features:
    """The features of several batches of windows, made the same way, end to end."""
    return Features([np.concatenate([part.matrix() for part in parts])], parts[0].views)
