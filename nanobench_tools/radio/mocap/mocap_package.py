"""Poses of real motion capture through the package ``motioncapture`` (Vicon, OptiTrack, Qualisys, VRPN and others).

The package gives no time of exposure: a pose is stamped when its frame arrives, and the latency of the system is in
every timestamp. The clock reading of ``nanobench audit`` shows it.
"""

import threading
from typing import Any

import numpy as np

from ...errors import InputError, MissingExtraError
from ..host_clock import HostClock
from .pose_datagram import Pose
from .pose_source import Sink

CONNECT_S = 10.0


class PackageMocap:
    """One rigid body of one system. A body that is not in a frame gives a pose of nan."""

    synthetic = False

    def __init__(self, kind: str, host: str, body: str) -> None:
        self.name, self.kind, self.host, self.body = f"{kind}://{host}/{body}", kind, host, body
        try:
            import motioncapture
        except ImportError:
            raise MissingExtraError("motioncapture", "mocap") from None
        self._package = motioncapture
        self._stop = threading.Event()
        self._ready = threading.Event()
        self._error = ""

    def start(self, sink: Sink) -> None:
        """Raises InputError when the system does not answer: connecting itself cannot be given a time limit."""
        threading.Thread(target=self._run, args=(sink,), name="motioncapture", daemon=True).start()
        if not self._ready.wait(CONNECT_S):
            raise InputError(f"--mocap {self.name}", f"no frame within {CONNECT_S:.0f} s", "check host and streaming")
        if self._error:
            raise InputError(f"--mocap {self.name}", self._error, "check the type, the host and streaming")

    def _run(self, sink: Sink) -> None:
        clock = HostClock()
        try:
            system = self._package.connect(self.kind, {"hostname": self.host})
            while not self._stop.is_set():
                system.waitForNextFrame()
                now = clock.now()
                sink(_pose(now, system.rigidBodies.get(self.body)))
                self._ready.set()
        except Exception as error:  # other people's code; without poses the flight ends automatically
            if not self._ready.is_set():
                self._error = f"{type(error).__name__}: {error}"
            self._ready.set()

    def setpoint(self, time_s: float, command: dict[str, object]) -> None:
        """Not of interest here."""

    def close(self) -> None:
        self._stop.set()


def _pose(now: float, body: Any) -> Pose:
    if body is None:
        return Pose(now, np.full(3, np.nan), np.full(4, np.nan))
    turn = body.rotation
    return Pose(now, np.asarray(body.position, float), np.array([turn.x, turn.y, turn.z, turn.w], float))
