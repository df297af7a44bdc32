"""Poses from anybody's code: ``module:callable``, for example a node of ROS 2.

The callable is called once with ``emit`` and returns at once. For every pose it later calls ``emit(time_s, (x, y, z),
(qx, qy, qz, qw))`` from any thread. There time_s is the Unix time of the exposure. It may return None, or an object
with ``setpoint(time_s, said)`` and ``close()``. The first is called with what is sent to the vehicle, the second at
the end.
"""

from typing import Any

from ...errors import InputError, UsageError
from ...lookup.registry import load
from .pose_source import Sink, checked


class CallableMocap:
    """Poses from ``module:callable``."""

    synthetic = False

    def __init__(self, spec: str) -> None:
        self.name = spec
        self._make = load("sources", spec)  # only module:name can come here; the registry knows how to import it
        if not callable(self._make):
            raise UsageError(f"--mocap {spec}: not callable")
        self.synthetic = bool(getattr(self._make, "synthetic", False))
        self._held: Any = None

    def start(self, sink: Sink) -> None:
        """Raises InputError for a callable that raises."""

        def emit(time_s: float, position_m: object, quaternion: object) -> None:
            sink(checked(self.name, time_s, position_m, quaternion))

        try:
            self._held = self._make(emit)
        except Exception as error:
            raise InputError(f"--mocap {self.name}", f"raised {type(error).__name__}: {error}") from error

    def setpoint(self, time_s: float, command: dict[str, object]) -> None:
        listener = getattr(self._held, "setpoint", None)
        if listener is not None:
            listener(time_s, command)

    def close(self) -> None:
        end = getattr(self._held, "close", None)
        if end is not None:
            end()
