"""Which column of a stranger's table is what, told from its name: the first half of a drafted column map."""

from __future__ import annotations

import re
from collections.abc import Iterable

_UNIT = re.compile(r"[\s_]*[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")
_ENDS = re.compile(r"^(.*[^_])_(m_s2|m_s\^2|mm_s2|rad_s|deg_s|m_s|mm_s|ms|us|ns|s|m|mm|cm|rad|deg|V|mV|g|mg|N|rpm|"
                   r"pwm)$")
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_APART = re.compile(r"[^a-z0-9]+")
UNIT_WORDS = {"m/s2": "m/s^2", "m/s²": "m/s^2", "m_s2": "m/s^2", "m_s^2": "m/s^2", "mm_s2": "mm/s^2", "rad_s": "rad/s",
              "deg_s": "deg/s", "dps": "deg/s", "°/s": "deg/s", "°": "deg", "degrees": "deg", "m_s": "m/s",
              "mm_s": "mm/s", "pwm": "pwm16", "sec": "s", "seconds": "s", "usec": "us", "nsec": "ns", "msec": "ms",
              "volt": "V", "v": "V", "gram": "gram_force"}
"""Spellings of units that a map writes otherwise."""

_WANTED = {"sp", "setpoint", "ref", "reference", "des", "desired", "target", "ctrltarget", "cmd"}
_ESTIMATED = {"estimate", "estimated", "est", "ekf", "kalman", "state", "onboard"}
_MEASURED = {"mocap", "vicon", "optitrack", "qualisys", "gt", "truth", "groundtruth"}
_ACC = {"acc", "accel", "acceleration", "accelerometer", "a"}
_GYRO = {"gyro", "gyr", "g", "rate", "w", "omega", "angular"}
_VELOCITY, _TURN = {"v", "vel", "velocity", "speed"}, {"q", "quat", "quaternion", "orientation", "rot", "att"}
_MOTOR, _SPEED = {"m", "motor", "motors", "pwm", "u"}, {"rpm", "rotor"}
_BATTERY, _THRUST = {"vbat", "battery", "batt", "bat", "vbatt", "voltage"}, {"thrust", "collective"}
NUMBERED = "0123"
"""Parts of a quaternion by number: ``meaning`` says q0 .. q3, since the scalar is the first with some and the last with
others."""
_TIME = {"t", "time", "timestamp", "timestamps", "stamp", "ts", "sec", "secs", "seconds"}


def words_of(column: str) -> tuple[list[str], str]:
    """The words of a column's name in lower case, and the unit it states, as a map writes it, or "".

    >>> words_of("imu.accX [m/s2]")
    (['imu', 'acc', 'x'], 'm/s^2')
    """
    unit = ""
    if match := _UNIT.search(column):
        column, unit = column[:match.start()], match[1]
    elif match := _ENDS.match(column):
        column, unit = match[1], match[2]
    words = [w for w in _APART.split(_CAMEL.sub("_", column).lower()) if w]
    if words and (glued := re.fullmatch(r"([a-z]+?)([wxyz]|[0-8])", words[-1])) and glued[1] in (
            _ACC | _GYRO | _VELOCITY | _TURN | _MOTOR | _SPEED | {"p", "pos", "position"}):
        words[-1:] = [glued[1], glued[2]]
    return words, UNIT_WORDS.get(unit.lower() if unit.lower() in UNIT_WORDS else unit, unit)


def meaning(column: str) -> tuple[str, str] | None:
    """(stream, quantity) of a column by its name, ("", "time") for stamps, or None."""
    words, _ = words_of(column)
    while len(words) > 1 and words[-1] in _WANTED | _ESTIMATED | _MEASURED:  # x_ekf, roll_ref
        words = [words[-1], *words[:-1]]
    if not words:
        return None
    last, before = words[-1], set(words[:-1])
    wanted, estimated = bool(before & _WANTED), bool(before & _ESTIMATED)
    if last in NUMBERED and before & _TURN and not wanted:
        return "attitude_qw" if estimated else "mocap", f"q{last}"
    if last in _TIME:
        return None if before & (_ACC | _GYRO | _MOTOR) else ("", "time")
    if last in _BATTERY or (last == "v" and before & _BATTERY):
        return "battery", "vbat"
    if last in _THRUST:
        return "command", "thrust"
    if last in ("roll", "pitch", "yaw"):
        if before & _GYRO:
            return None
        return ("setpoint", "yaw") if wanted and last == "yaw" else None if wanted else ("attitude", last)
    if last.isdigit() and before & (_SPEED | _MOTOR):
        return ("rpm" if before & _SPEED else "motor", f"m{last}") if "1" <= last <= "8" else None
    if last not in ("w", "x", "y", "z"):
        return None
    if before & _TURN and not before & _ACC:
        return None if wanted else ("attitude_qw" if estimated else "mocap", f"q{last}")
    if last == "w" or (wanted and before & (_ACC | _GYRO | _VELOCITY)):
        return None
    if before & _GYRO:
        return "imu", f"gyro_{last}"
    if before & _ACC:
        return ("estimator_acc", f"a{last}") if estimated else ("imu", f"acc_{last}")
    stream = "setpoint" if wanted else "estimator" if estimated else "mocap"
    if before & _VELOCITY:
        return stream, f"v{last}"
    return stream, last if stream != "mocap" else f"p{last}"


def guessed(columns: Iterable[str]) -> tuple[dict[tuple[str, str], str], dict[str, str]]:
    """{(stream, quantity): column}, and {column: why it was not guessed}."""
    found: dict[tuple[str, str], str] = {}
    why: dict[str, str] = {}
    for column in columns:
        what = meaning(column)
        if what is None:
            why[column] = "the name says nothing that is known"
        elif what in found:
            why[column] = f"{' '.join(filter(None, what))} is {found[what]!r} already"
        else:
            found[what] = column
    return found, why
