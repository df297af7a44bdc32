"""Noise of an IMU: one small TOML file for all estimators.

Densities are those of the low frequencies, which add up in an integral. A row interpolated between two packets is
quieter than a packet and adds no information, so the scatter of rows is too small. ``at_rate`` converts a density to a
stream that lost packets. Vibration is faster than any of these rates and folds into them as white noise, of which
fewer packets average less.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.flight import Stream
from nanobench_tools.settings import number

SCHEMA = "nanobench-imu-noise/1"
NOMINAL_HZ = number("imu.imu_noise.nominal_hz")
MAY_BE_ZERO = ("stamp_s_sqrtHz", "vertical_m_s2_sqrtHz", "gyro_walk_rad_s2_sqrtHz", "acc_walk_m_s3_sqrtHz")


@dataclass(frozen=True)
class ImuNoise:
    """One-sided amplitude densities (white noise), walks of the biases, and how far biases may be off at the start.

    Noise densities.

    - gyro [rad/s/sqrt(Hz)], acc [m/s^2/sqrt(Hz)]; walks [rad/s^2/sqrt(Hz)], [m/s^3/sqrt(Hz)].
    - stamp [s/sqrt(Hz)]: the wander of the timestamps, which makes noise in proportion to the slope of a signal. It is
      0 where it is part of the densities.
    - vertical [m/s^2/sqrt(Hz)]: acc along the rotors' axis (0: as acc).
    - rate_hz: the true rate of the packets they were measured at.

    The defaults are a 40 g Crazyflie in flight, its log sent over radio. They are ten times the sensor's at rest, for
    vibration and for timestamps with a varying delay.
    """

    gyro_rad_s_sqrtHz: float = number("imu.imu_noise.imunoise_gyro_rad_s_sqrthz")
    acc_m_s2_sqrtHz: float = number("imu.imu_noise.imunoise_acc_m_s2_sqrthz")
    gyro_walk_rad_s2_sqrtHz: float = number("imu.imu_noise.imunoise_gyro_walk_rad_s2_sqrthz")
    acc_walk_m_s3_sqrtHz: float = number("imu.imu_noise.imunoise_acc_walk_m_s3_sqrthz")
    gyro_bias_sd_rad_s: float = number("imu.imu_noise.imunoise_gyro_bias_sd_rad_s")
    acc_bias_sd_m_s2: float = number("imu.imu_noise.imunoise_acc_bias_sd_m_s2")
    stamp_s_sqrtHz: float = 0.0
    vertical_m_s2_sqrtHz: float = 0.0
    rate_hz: float = NOMINAL_HZ

    @property
    def upright(self) -> float:
        """Of the accelerometer along the rotors' axis."""
        return self.vertical_m_s2_sqrtHz or self.acc_m_s2_sqrtHz

    def at_rate(self, rate_hz: float) -> ImuNoise:
        """The same sensor with ``rate_hz`` packets per second; itself where the rate is not known."""
        if not (math.isfinite(rate_hz) and rate_hz > 0.0):
            return self
        more = math.sqrt(self.rate_hz / rate_hz)
        return replace(self, gyro_rad_s_sqrtHz=self.gyro_rad_s_sqrtHz * more,
                       acc_m_s2_sqrtHz=self.acc_m_s2_sqrtHz * more,
                       vertical_m_s2_sqrtHz=self.vertical_m_s2_sqrtHz * more, rate_hz=rate_hz)

    def to_toml(self, about: str = "") -> str:
        """The file's text; ``about`` goes in front as comments."""
        lines = [f"# {line}" for line in about.splitlines()] + [f'schema = "{SCHEMA}"', "[imu]"]
        return "\n".join(lines + [f"{name} = {value!r}" for name, value in asdict(self).items()]) + "\n"


def packet_rate_hz(stream: Stream) -> float:
    """True packets per second: ``samples`` over the time of the rows, else the rate the stream states, else nan."""
    span = stream.span.duration_s
    if stream.samples and span > 0.0:
        return min(stream.samples, len(stream)) / span
    return stream.rate_hz


def reckon_with(method: Any, noise: ImuNoise) -> None:
    """Gives an estimator that takes one the noise: attribute ``noise`` (smoothers) or ``settings`` (inertial rows)."""
    if hasattr(method, "noise"):
        method.noise = noise
    elif hasattr(method, "settings"):
        method.settings = {**method.settings, "gyro_noise": noise.gyro_rad_s_sqrtHz, "acc_noise": noise.acc_m_s2_sqrtHz,
                           "vertical_noise": noise.upright, "gyro_walk": noise.gyro_walk_rad_s2_sqrtHz,
                           "acc_walk": noise.acc_walk_m_s3_sqrtHz, "stamp": noise.stamp_s_sqrtHz}
    else:
        raise UsageError(f"estimator {getattr(method, 'name', method)!r} takes no noise of an IMU")


def read_imu_noise(path: Path) -> ImuNoise:
    """The file; keys that are left out keep their defaults. InputError for what is no such file or cannot be."""
    place = str(path)
    try:
        found = tomllib.loads(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(place, f"cannot be read: {error}") from error
    if found.get("schema") != SCHEMA:
        raise InputError(place, f"schema {found.get('schema')!r}", f"this reads {SCHEMA!r}; nanobench noise writes it")
    table = found.get("imu")
    if not isinstance(table, dict):
        raise InputError(place, "has no table [imu]")
    known = {field.name for field in fields(ImuNoise)}
    for name, value in table.items():
        if name not in known:
            raise InputError(f"{place}: [imu] {name}", "unknown key", f"known: {', '.join(sorted(known))}")
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not 0.0 <= value < 1e4 or (value == 0.0 and name not in MAY_BE_ZERO):
            raise InputError(f"{place}: [imu] {name}", f"{value!r}", "a positive number is needed")
    return ImuNoise(**{name: float(value) for name, value in table.items()})
