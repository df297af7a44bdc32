"""An estimate that another program made: one TUM trajectory file per flight, scored at its own timestamps."""

from __future__ import annotations

import hashlib
from pathlib import Path

from ..errors import InputError
from ..flight import Flight
from ..methods import Estimate
from .tum import TumTrajectory


class TrajectoryFile:
    """``<flight>.tum``: lines of Unix time [s], position [m], quaternion x y z w. The method is the folder's name.

    Its inputs and its causality are unknown.
    """

    causal = None
    given = "not known: a trajectory file"

    def __init__(self, path: Path) -> None:
        """InputError if the file cannot be read. By its content hash a changed file is another method to the runner."""
        self.path = Path(path)
        self.name = self.path.absolute().parent.name
        self.sha256 = hashlib.sha256(self._read()).hexdigest()

    def estimate(self, flight: Flight) -> Estimate:
        """InputError that names file and line if the file cannot be read whole."""
        found = TumTrajectory().read(self.path, self._read())
        if found.provenance.findings:
            raise InputError(str(self.path), found.provenance.findings[0].evidence, "mend the trajectory")
        mocap = found["mocap"]
        time_s = mocap.time_s + (found.epoch_s - flight.epoch_s)
        return Estimate(time_s, mocap["px", "py", "pz"], mocap["qx", "qy", "qz", "qw"])

    def _read(self) -> bytes:
        try:
            return self.path.read_bytes()
        except OSError as error:
            raise InputError(str(self.path), f"cannot be read ({error.strerror or error})") from None
