"""Differences between flights of one vehicle, as directions through the parameters: a battery further left, a weaker
propeller, a misaligned tracker. Also the rate and the rotors at the start, which are known only roughly."""

from collections.abc import Sequence

from nanobench_tools.physics import Vehicle
from nanobench_tools.physics.model import Values, find_term, neutral
from nanobench_tools.settings import number

from .solve import Nuisance
from .starts import PREFIX


def _motors(*weights: float) -> dict[str, float]:
    return {f"motor_imbalance.g[{i}]": w for i, w in enumerate(weights)}


def _rotors(*weights: float) -> dict[str, float]:
    return {f"start.thrust_{i + 1}": w for i, w in enumerate(weights)}


THRUST_SD = number("greybox.nuisance.thrust_sd")
MOTOR_SD = number("greybox.nuisance.motor_sd")
TILT_SD_RAD = number("greybox.nuisance.tilt_sd_rad")
RATE_SD_RAD_S = number("greybox.nuisance.rate_sd_rad_s")
ROTOR_SD_N = number("greybox.nuisance.rotor_sd_n")
SCALE = Nuisance("thrust", {"thrust_scale.s": 1.0}, THRUST_SD, "1", "thrust over what the map says", "thrust")
TRIMS = (
    Nuisance("trim_roll", _motors(-1.0, -1.0, 1.0, 1.0), MOTOR_SD, "1", "motors left against right", "roll"),
    Nuisance("trim_pitch", _motors(-1.0, 1.0, 1.0, -1.0), MOTOR_SD, "1", "motors at the back against the front",
             "pitch"),
    Nuisance("trim_yaw", _motors(-1.0, 1.0, -1.0, 1.0), MOTOR_SD, "1", "motors of one spin against the others", "yaw"),
)
TILT = (
    Nuisance("tilt_roll", {"frame_tilt.roll_rad": 1.0}, TILT_SD_RAD, "rad", "thrust axis against the attitude, about x",
             "roll"),
    Nuisance("tilt_pitch", {"frame_tilt.pitch_rad": 1.0}, TILT_SD_RAD, "rad",
             "thrust axis against the attitude, about y", "pitch"),
)
STARTS = (
    Nuisance("rate_roll", {"start.rate_x": 1.0}, RATE_SD_RAD_S, "rad/s", "rate at the start, x", "roll"),
    Nuisance("rate_pitch", {"start.rate_y": 1.0}, RATE_SD_RAD_S, "rad/s", "rate at the start, y", "pitch"),
    Nuisance("rate_yaw", {"start.rate_z": 1.0}, RATE_SD_RAD_S, "rad/s", "rate at the start, z", "yaw"),
    Nuisance("rotors_roll", _rotors(-1.0, -1.0, 1.0, 1.0), ROTOR_SD_N, "N",
             "rotors left against right, at the start", "roll"),
    Nuisance("rotors_pitch", _rotors(-1.0, 1.0, 1.0, -1.0), ROTOR_SD_N, "N",
             "rotors at the back against the front, at the start", "pitch"),
    Nuisance("rotors_yaw", _rotors(-1.0, 1.0, -1.0, 1.0), ROTOR_SD_N, "N",
             "rotors of one spin against the others, at the start", "yaw"),
)
"""Spreads: thrust over its map differs by 3 % between flights and a motor by some per cent. Frames differ by about a
degree, rotors by a tenth of their thrust. A gyro row differs by 0.03 rad/s from its smoothed neighbours (NanoBench
flights, which ones is not recorded)."""


def terms_of(nuisances: Sequence[Nuisance], vehicle: Vehicle | None = None) -> dict[str, Values]:
    """The terms a model needs to have these nuisances, where they change nothing."""
    found = {}
    for name in dict.fromkeys(name.partition(".")[0] for n in nuisances for name in n.direction
                              if not name.startswith(PREFIX)):
        rest = neutral(find_term(name), vehicle or Vehicle())
        assert rest is not None  # directions go through terms that can rest
        found[name] = rest
    return found
