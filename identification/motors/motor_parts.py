"""What motors.json holds: one part per question."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from nanobench_tools.results.fitted_values import LeftOut, Value
from nanobench_tools.results.result import INLINE, Result, named

Ends = tuple[float, float]
"""Of a 95 % interval."""


@dataclass(frozen=True, repr=False)
class RotationRow(Result):
    """Rotation predicted from one input.

    - metrics {metric: errors after 1, 10, 50 steps and summed}; ci95: of these by drawing held-out flights.
    - curves {metric: error (50,) per step}."""

    input: str
    words: str
    n_windows: int
    n_flights: int
    metrics: Mapping[str, Mapping[str, float]]
    ci95: Mapping[str, Mapping[str, Ends]]
    curves: Mapping[str, np.ndarray]
    trouble: str


@dataclass(frozen=True, repr=False)
class RotationGain(Result):
    """How much smaller errors after h steps are than from the radio stream, the same flights drawn for both."""

    input: str
    metric: str
    h: int
    less_percent: float
    ci95: Ends | None

    @property
    def ratio(self) -> tuple[float, Ends | None]:
        """Error over that from the radio stream, and its 95 % interval."""
        ends = None if self.ci95 is None else (1.0 - self.ci95[1] / 100.0, 1.0 - self.ci95[0] / 100.0)
        return 1.0 - self.less_percent / 100.0, ends


@dataclass(frozen=True, repr=False)
class LagTimes(Result):
    """Time constants of rotors and what waits before them."""

    tau_up_s: float
    tau_down_s: float
    delay_s: float


@dataclass(frozen=True, repr=False)
class FittedLag(LagTimes):
    """ci95 by the names of the times."""

    ci95: Mapping[str, Ends]


@dataclass(frozen=True, repr=False)
class LagRow(Result):
    """A candidate: error of simulated speed on held-out flights and on those of training."""

    model: str
    rms_rad_s: float
    ci95: Ends | None
    train_rms_rad_s: float
    times: LagTimes = field(metadata=INLINE)
    trouble: str


@dataclass(frozen=True, repr=False)
class FlightLag(Result):
    """One flight alone."""

    flight: str
    times: LagTimes = field(metadata=INLINE)
    trouble: str


@dataclass(frozen=True, repr=False)
class GyroLag(Result):
    """The lag of a model of rotation that was fitted with a separate lag; times [s] by parameter."""

    times_s: Mapping[str, float] = field(metadata=INLINE)
    trouble: str


@dataclass(frozen=True, repr=False)
class CommandLag(Result):
    """How late turning about x and y follows its command, by correlation."""

    flight: str
    x_s: float = field(metadata=named("x"))
    y_s: float = field(metadata=named("y"))


@dataclass(frozen=True, repr=False)
class LagExample(Result):
    """Measured and simulated speed of one motor over a second, (n,) each."""

    flight: str
    motor: int
    time_s: np.ndarray
    measured_rad_s: np.ndarray
    simulated_rad_s: Mapping[str, np.ndarray]


@dataclass(frozen=True, repr=False)
class LagPart(Result):
    """The chosen candidate, with ``gain`` (4,) of each motor; fit: with both constants."""

    best: str
    times: LagTimes = field(metadata=INLINE)
    gain: np.ndarray
    fit: FittedLag
    rows: tuple[LagRow, ...]
    flights: tuple[FlightLag, ...]
    from_gyro_alone: Mapping[str, GyroLag]
    correlation_s: tuple[CommandLag, ...]
    example: LagExample


@dataclass(frozen=True, repr=False)
class SpeedRow(Result):
    """A candidate for speed from PWM and voltage, training flights held out in turn."""

    model: str
    rms_rad_s: float
    equation: str
    trouble: str


@dataclass(frozen=True, repr=False)
class SpeedCurve(Result):
    """Mean speed of the rotors at one voltage over the PWM ratio."""

    voltage_V: float
    pwm: np.ndarray
    speed_rad_s: np.ndarray


@dataclass(frozen=True, repr=False)
class SpeedPart(Result):
    """Speed from PWM and voltage. ``spread_rad_s``: SD of the speeds; ``motor_gain`` (4,); slopes of thrust over motor
    voltage, from changes within a second and from the map."""

    best: str | None
    spread_rad_s: float
    rows: tuple[SpeedRow, ...]
    parameters: Mapping[str, Value]
    motor_gain: np.ndarray | None
    slope_fast_N_per_V: float
    slope_slow_N_per_V: float
    curves: tuple[SpeedCurve, ...]

    @property
    def ranked(self) -> list[SpeedRow]:
        """The smallest error first, those without one last."""
        return sorted(self.rows, key=lambda row: math.inf if math.isnan(row.rms_rad_s) else row.rms_rad_s)


@dataclass(frozen=True, repr=False)
class FlightForce(Result):
    """Thrust per mass and squared speed of one flight, N s^2/rad^2 per kg."""

    flight: str
    k_f_per_kg: float


@dataclass(frozen=True, repr=False)
class ForceRow(Result):
    """Error of the body-z specific force on held-out flights."""

    source: str = field(metadata=named("from"))
    rms_m_s2: float
    ci95: Ends | None
    n_flights: int


@dataclass(frozen=True, repr=False)
class ForcePart(Result):
    """k_f [N s^2/rad^2], or k_f / m alone when nobody gave a mass; ci95 in ``unit``."""

    k_f_per_kg: float
    k_f: float | None
    ci95: Ends | None
    identified: str
    unit: str
    flights: tuple[FlightForce, ...]
    rows: tuple[ForceRow, ...]


@dataclass(frozen=True, repr=False)
class OverFlights(Result):
    """Median of one value per flight; ci95_mean: of the mean."""

    median: float | None
    ci95_mean: Ends | None
    n_flights: int


@dataclass(frozen=True, repr=False)
class PerInertia(Result):
    """1 / J about x and y."""

    x: OverFlights
    y: OverFlights
    unit: str = "1/(kg m^2)"


@dataclass(frozen=True, repr=False)
class FittedRotation(Result):
    """Parameters of a model of rotation."""

    parameters: Mapping[str, Value]
    trouble: str


@dataclass(frozen=True, repr=False)
class MomentPart(Result):
    """Rotation from rotor speed: 1 / J, k_m / J_z, J_r / J_z, explained share of the angular acceleration, delay of the
    gyro.

    fitted: models of rotation by input."""

    inertia_kg_m2: Mapping[str, float]
    identified: str
    per_inertia: PerInertia
    k_m_per_inertia_z: OverFlights
    reaction_per_inertia_z: OverFlights
    assumed_inertia_z: float
    explained: Mapping[str, OverFlights]
    gyro_behind_speed_s: Mapping[str, OverFlights]
    fitted: Mapping[str, FittedRotation]


@dataclass(frozen=True, repr=False)
class Measurement(Result):
    """Rates and steps of what one flight logged."""

    flight: str
    rate_hz: float
    seconds: float
    new_speed_share: float
    new_speed_hz: float
    smallest_step_rpm: float
    revolutions_hz: float
    gaps: int


@dataclass(frozen=True, repr=False)
class Fold(Result):
    """Names of flights."""

    train: tuple[str, ...]
    test: tuple[str, ...]


@dataclass(frozen=True, repr=False)
class MotorResult(Result):
    """motors.json. step_s: of the prediction of rotation; row_s: of the logs; mass_kg: if given; simulator: path of
    simulator.toml, if written."""

    sessions: int | None
    ci_why: str
    rows: tuple[RotationRow, ...]
    gains: tuple[RotationGain, ...]
    lag: LagPart
    speed: SpeedPart
    force: ForcePart
    moments: MomentPart
    measurement: tuple[Measurement, ...]
    step_s: float
    row_s: float
    mass_kg: float | None
    train: tuple[str, ...]
    test: tuple[str, ...]
    folds: tuple[Fold, ...]
    left_out: tuple[LeftOut, ...]
    simulator: str | None = None
