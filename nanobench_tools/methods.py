"""What a method has to be: small classes behind three Protocols, and the arrays that go in and come out.

An estimator answers "where was it", a predictor "what will it do", a controller "what to command". Anything
with these attributes works, from inside the package or from outside (``--method module:Class``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from .flight import Flight


@dataclass(frozen=True)
class Estimate:
    """Estimated trajectory.

    Attributes
    ----------
    time_s : ndarray
        (n,) s from the first row of the recording, rising.
    position_m : ndarray
        (n, 3) m, world.
    quaternion : ndarray
        (n, 4) x, y, z, w, body to world.
    velocity_m_s : ndarray or None
        (n, 3) m/s, world.
    covariance : ndarray or None
        (n, 3, 3) of the error of position; (n, 6, 6) of position and velocity; (n, 9, 9) with attitude (rotation
        vector, body), too. SI units squared.
    nis : ndarray or None
        (m,) normalised squared innovations of the estimator's measurements.
    nis_dof : ndarray or None
        (m,) number of dimensions of each.
    converged : bool or None
        False for an optimiser that gave up.
    """

    time_s: np.ndarray
    position_m: np.ndarray
    quaternion: np.ndarray
    velocity_m_s: np.ndarray | None = None
    covariance: np.ndarray | None = None
    nis: np.ndarray | None = None
    nis_dof: np.ndarray | None = None
    converged: bool | None = None


@runtime_checkable
class Estimator(Protocol):
    """A state estimator. ``name`` labels its rows in tables; ``causal``: an estimate at t uses only data up to t."""

    name: str
    causal: bool

    def estimate(self, flight: Flight) -> Estimate:
        """Estimate the trajectory of one flight.

        Parameters
        ----------
        flight : Flight
            Streams in SI. ``flight["mocap"]`` contains only the poses that the protocol gives.

        Returns
        -------
        Estimate
            At times of its choice: a pose of the motion capture is scored if an estimate is within 0.1 s of it.

        Raises
        ------
        Exception
            Any: the flight is then listed under ``failed``. The same happens to times that do not rise, other shapes,
            and poses that are not finite.
        """
        ...


@dataclass(frozen=True)
class Past:
    """All streams over the P rows before the start of n windows, row P - 1 one step before it.

    Attributes
    ----------
    position_m, velocity_m_s : ndarray
        (n, P, 3) m and m/s, world.
    quaternion : ndarray
        (n, P, 4) x, y, z, w, body to world, of the same source as the start.
    rate_rad_s : ndarray
        (n, P, 3) rad/s, body.
    specific_force_m_s2 : ndarray
        (n, P, 3) m/s^2, body; nan without an accelerometer.
    motor : ndarray
        (n, P, 4) PWM ratio.
    battery_V : ndarray
        (n, P) V.
    rows : ndarray
        (n,) number of flown rows; the first of them replaces missing ones.
    """

    position_m: np.ndarray
    velocity_m_s: np.ndarray
    quaternion: np.ndarray
    rate_rad_s: np.ndarray
    specific_force_m_s2: np.ndarray
    motor: np.ndarray
    battery_V: np.ndarray
    rows: np.ndarray


@dataclass(frozen=True)
class Windows:
    """A batch of n prediction windows of H rows. Row 0 is the start, row j is j steps later.

    Attributes
    ----------
    position_m, velocity_m_s : ndarray
        (n, 3) m and m/s, world, at the start.
    quaternion : ndarray
        (n, 4) x, y, z, w, body to world, at the start.
    rate_rad_s : ndarray
        (n, 3) rad/s, body, at the start.
    motor : ndarray
        (n, H, 4) PWM ratio, held over step j to j + 1.
    battery_V : ndarray
        (n, H) V, held in the same way.
    rate_hz : float
        Rows per second.
    motor_past, battery_past : ndarray or None
        (n, P, 4) and (n, P): the same over the P rows before the start. Where there were fewer, the first is repeated.
    past : Past or None
        For predictors with ``information = "past"`` only.
    """

    position_m: np.ndarray
    velocity_m_s: np.ndarray
    quaternion: np.ndarray
    rate_rad_s: np.ndarray
    motor: np.ndarray
    battery_V: np.ndarray
    rate_hz: float = 100.0
    motor_past: np.ndarray | None = None
    battery_past: np.ndarray | None = None
    past: Past | None = None

    def __len__(self) -> int:
        return len(self.position_m)

    @property
    def horizon(self) -> int:
        """Rows of a window, H."""
        return int(self.motor.shape[1])


@dataclass(frozen=True)
class Prediction:
    """Predicted states 1..H steps after the start of n windows.

    Attributes
    ----------
    position_m, velocity_m_s : ndarray
        (n, H, 3) m and m/s, world.
    quaternion : ndarray
        (n, H, 4) x, y, z, w, body to world.
    rate_rad_s : ndarray
        (n, H, 3) rad/s, body.
    """

    position_m: np.ndarray
    velocity_m_s: np.ndarray
    quaternion: np.ndarray
    rate_rad_s: np.ndarray


@runtime_checkable
class Predictor(Protocol):
    """A model that predicts. ``information``: ``state`` (start state and inputs) or ``past`` (also the streams before
    the start)."""

    name: str
    information: str

    def predict(self, windows: Windows) -> Prediction:
        """Predict n windows of H rows.

        Parameters
        ----------
        windows : Windows
            Start states, and the inputs over the windows. ``windows.past`` is None for ``information = "state"``.

        Returns
        -------
        Prediction
            One state per row after the start, (n, H, ...).

        Raises
        ------
        Exception
            Any: the flight is then listed under ``failed``. The same happens to other shapes and values that are not
            finite.
        """
        ...


@dataclass(frozen=True)
class VehicleState:
    """States of n vehicles at one time, as their controllers receive them.

    Attributes
    ----------
    position_m, velocity_m_s : ndarray
        (n, 3) m and m/s, world.
    quaternion : ndarray
        (n, 4) x, y, z, w, body to world.
    rate_rad_s : ndarray
        (n, 3) rad/s, body.
    battery_V : ndarray
        (n,) V under load.
    """

    position_m: np.ndarray
    velocity_m_s: np.ndarray
    quaternion: np.ndarray
    rate_rad_s: np.ndarray
    battery_V: np.ndarray


@dataclass(frozen=True)
class Reference:
    """References of n vehicles now.

    Attributes
    ----------
    position_m : ndarray
        (n, 3) m, world.
    yaw_rad : ndarray
        (n,) rad.
    velocity_m_s, acceleration_m_s2 : ndarray
        (n, 3) m/s and m/s^2, world; zero for a controller that flies ``as flown`` (position setpoints only).
    jerk_m_s3 : ndarray or None
        (n, 3) m/s^3, world; None if unknown.
    yaw_rate_rad_s : ndarray or None
        (n,) rad/s; None if unknown.
    ahead : callable or None
        ``ahead(seconds)``, seconds (k,) >= 0 from now, gives future references with k as the first axis: (k, n, 3) and
        (k, n). None if the future is unknown; a controller that looks ahead then extrapolates.
    """

    position_m: np.ndarray
    yaw_rad: np.ndarray
    velocity_m_s: np.ndarray
    acceleration_m_s2: np.ndarray
    jerk_m_s3: np.ndarray | None = None
    yaw_rate_rad_s: np.ndarray | None = None
    ahead: Callable[[np.ndarray], Reference] | None = None


@runtime_checkable
class Controller(Protocol):
    """A controller that steers n vehicles at once. ``period_s``: seconds between two calls of ``command``.

    ``information`` sets the references that it receives. ``as flown``: position and heading now. ``lead``: the same,
    ``lead_s`` seconds ahead. ``preview``: also derivatives, and the future.
    """

    name: str
    information: str
    period_s: float

    def reset(self, n: int) -> None:
        """Start a new flight.

        Parameters
        ----------
        n : int
            Number of vehicles.
        """
        ...

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """Command the motors until the next call.

        Parameters
        ----------
        time_s : float
            Since the start of the run.
        state : VehicleState
            Of n vehicles.
        reference : Reference
            Of the same vehicles.

        Returns
        -------
        ndarray
            Motor PWM ratios (n, 4), 0..1, in the order of the firmware: front right, back right, back left, front left.

        Raises
        ------
        Exception
            Any; it ends the run. Ratios that are not finite or lie outside 0..1 end it with a line that names time and
            vehicle.
        """
        ...
