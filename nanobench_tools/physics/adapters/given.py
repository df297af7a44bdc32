"""A callable as simulator: its inputs, its outputs, and a one-line message for every mistake.

    nanobench diagnose --data FLIGHTS --simulator my_simulator:accelerations

    # my_simulator.py
    import numpy as np

    def accelerations(along):
        lift = 0.0105 * (along.motor * along.battery_V[:, None]) ** 2             # N, (n, 4)
        force = np.zeros_like(along.position_m)
        force[:, 2] = lift.sum(axis=1)
        body_velocity = np.einsum("nji,nj->ni", along.rotation, along.velocity_m_s)
        force -= 0.015 * body_velocity
        roll = 0.0325 * (lift @ [-1, -1, 1, 1])
        pitch = 0.0325 * (lift @ [-1, 1, 1, -1])
        yaw = 0.006 * (lift @ [-1, 1, -1, 1])
        inertia = np.array([1.8e-5, 1.8e-5, 3.1e-5])
        torque = np.stack([roll, pitch, yaw], axis=1)
        torque -= np.cross(along.rate_rad_s, inertia * along.rate_rad_s)
        return force / 0.041, torque / inertia

It is called once for every stretch of flight, with ``Along``. It returns (specific force in the body m/s^2 (n, 3),
angular acceleration in the body rad/s^2 (n, 3)). Specific force is the reading of an accelerometer, +9.81 in z at
hover. Or a dictionary of "specific_force_m_s2" or "acceleration_m_s2" (world, gravity in it), and
"angular_acceleration_rad_s2". Motors that lag may be integrated over the rows of the stretch; nothing else has to be.

A class is made without arguments first. Its objects are callable in the same way, or have ``reset()`` and
``step(row)``. ``reset()`` is called before every stretch. ``step(row)`` is called for its rows in order, and returns
the same for one row. The row is an ``Along`` without the axis n ((3,), (4,), floats). ``vehicle``
(``nanobench_tools.physics.Vehicle``) of a callable gives its mass and arms, because flights show only thrust over
mass.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ... import so3
from ...errors import InputError, NanobenchError, UsageError
from ...lookup import registry

UP = np.array([0.0, 0.0, 9.81])
"""m/s^2: what an accelerometer at rest feels, world."""
GROUP = "simulators"
FORCES = {"specific_force_m_s2", "acceleration_m_s2"}


@dataclass(frozen=True)
class Along:
    """A measured stretch of flight, n rows ``row_s`` apart, in the order of time.

    ``time_s`` (n,); position_m, velocity_m_s (n, 3) world, z up; ``quaternion`` (n, 4) x, y, z, w, body (x forward, y
    left, z up) to world; ``rate_rad_s`` (n, 3) body; ``motor`` (n, 4) PWM ratio 0..1 of front right, back right, back
    left, front left; ``battery_V`` (n,). Motor and battery are held from time_s to time_s + row_s. The half second
    before the judged stretch is part of it, so that rotors can warm up; they start settled on the first row's command.
    """

    time_s: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    quaternion: np.ndarray
    rate_rad_s: np.ndarray
    motor: np.ndarray
    battery_V: np.ndarray
    row_s: float = 0.01

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def rotation(self) -> np.ndarray:
        """(n, 3, 3), body to world."""
        return so3.matrix(self.quaternion)

    def row(self, k: int) -> Along:
        """One row, without the axis n."""
        return Along(**{f.name: getattr(self, f.name)[k] for f in fields(self) if f.name != "row_s"},
                     row_s=self.row_s)


Simulator = Callable[[Along], Any]
"""See above; ``run`` calls it and looks at what comes back."""


@dataclass(frozen=True)
class Stepped:
    """An object with ``reset`` and ``step`` as a callable of whole stretches."""

    inner: Any

    def __call__(self, along: Along) -> tuple[np.ndarray, np.ndarray]:
        self.inner.reset()
        found = [_pair(self.inner.step(along.row(k)), along.quaternion[k], ()) for k in range(len(along))]
        return np.array([f for f, _ in found]), np.array([t for _, t in found])

    @property
    def vehicle(self) -> Any:
        return getattr(self.inner, "vehicle", None)


def load_simulator(text: str) -> Simulator:
    """``module:callable``, or the name of an adapter, ``name`` or ``name:argument``. Raises UsageError for what cannot
    be found, imported or called, MissingExtraError for an adapter whose package is absent."""
    name, _, argument = text.partition(":")
    if name in registry.names(GROUP):
        adapter: Simulator = registry.load(GROUP, name)(argument or None)
        return adapter
    if ":" not in text:
        raise UsageError(f"--simulator {text}: no such file, and no adapter of that name; there are "
                         f"{', '.join(registry.names(GROUP))}; or give module:callable")
    if name.endswith(".py"):
        raise UsageError(f"--simulator {text}: a module is given as {name[:-3].replace('/', '.')}:{argument}, from "
                         "its folder")
    return wrapped(registry.load(GROUP, text), f"--simulator {text}")


def wrapped(found: Any, place: str) -> Simulator:
    """A user's function, object or class as a callable of whole stretches; UsageError that begins with ``place`` for
    one that cannot be made or called."""
    if isinstance(found, type):
        try:
            found = found()
        except (Exception, SystemExit) as error:  # the class is the user's
            raise UsageError(f"{place}: making one raised {reported(error)}; it is made without "
                             "arguments") from error
    if callable(getattr(found, "step", None)) and callable(getattr(found, "reset", None)):
        return Stepped(found)
    if not callable(found):
        raise UsageError(f"{place}: is a {type(found).__name__} and cannot be called; give a function, or a "
                         "class with __call__(along), or with reset() and step(row)")
    simulator: Simulator = found
    return simulator


def run(simulator: Simulator, along: Along, place: str) -> tuple[np.ndarray, np.ndarray]:
    """(specific force (n, 3), angular acceleration (n, 3)), body, of one stretch. Raises InputError that names the
    mistake: an exception (which, and where), wrong shapes, a value that is not finite (the first row of them)."""
    try:
        answer = simulator(along)
    except (NanobenchError, MemoryError):
        raise
    except (Exception, SystemExit) as error:  # the callable is the user's
        advice = "it is called with one Along, see nanobench diagnose --help" if isinstance(error, TypeError) else ""
        raise InputError(place, f"raised {reported(error)}", advice) from error
    try:
        force, turning = _pair(answer, along.quaternion, (len(along),))
    except ValueError as error:
        raise InputError(place, str(error), "return (specific force (n, 3), angular acceleration (n, 3))") from None
    for what, values in (("specific force", force), ("angular acceleration", turning)):
        bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if len(bad):
            raise InputError(place, f"{what} is {values[bad[0]].tolist()} in row {bad[0]} of {len(along)} "
                             f"({len(bad)} such rows)", "every row needs a finite answer")
    return force, turning


def _pair(answer: Any, quaternion: np.ndarray, rows: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Both arrays (*rows, 3); ValueError says what was returned instead."""
    if isinstance(answer, Mapping):
        if "angular_acceleration_rad_s2" not in answer or not FORCES & set(answer):
            raise ValueError(f"returned a dictionary of {', '.join(map(str, answer)) or 'nothing'}")
        turning = _array(answer["angular_acceleration_rad_s2"], "angular acceleration", rows)
        if "specific_force_m_s2" in answer:
            return _array(answer["specific_force_m_s2"], "specific force", rows), turning
        moved = _array(answer["acceleration_m_s2"], "acceleration", rows)
        return so3.rotate_inverse(quaternion, moved + UP), turning
    if not isinstance(answer, (tuple, list)) or len(answer) != 2:
        shape = f" {np.shape(answer)}" if isinstance(answer, np.ndarray) else ""
        raise ValueError(f"returned {type(answer).__name__}{shape}, no pair of arrays")
    return _array(answer[0], "specific force", rows), _array(answer[1], "angular acceleration", rows)


def _array(values: Any, what: str, rows: tuple[int, ...]) -> np.ndarray:
    try:
        found = np.array(values, float)  # a simulator may use one buffer again and again
    except (TypeError, ValueError):
        raise ValueError(f"{what} is no array of numbers") from None
    if found.shape != (*rows, 3):
        raise ValueError(f"{what} has shape {found.shape} where {(*rows, 3)} is needed")
    return found


def reported(error: BaseException) -> str:
    """An exception in a few words: its name, what it says, and where it was raised."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    own = trace is None or trace.tb_frame.f_code.co_filename == __file__  # the call itself failed
    where = "" if own else f" in line {trace.tb_lineno} of {trace.tb_frame.f_code.co_filename}"  # type: ignore[union-attr]
    text = " ".join(str(error).split())
    return f"{type(error).__name__}{f': {text}' if text else ''}{where}"


__all__ = ["Along", "Simulator", "Stepped", "load_simulator", "reported", "run"]
