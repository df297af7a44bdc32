"""Which column of a stranger's table is what: by the names of an ecosystem (``known``), else by whole words."""

from __future__ import annotations

import functools
import re
import unicodedata
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from .known import Ecosystem, Known, ecosystem, keys
from .units_as_written import unit_as_written

_UNIT = re.compile(r"[\s_]*[\[(]\s*(?!\d+\s*[\])])([^\[\]()]*?)\s*[\])]\s*$")
_ENDS = re.compile(r"^(.*[^_])_(m_s2|m_s\^2|mm_s2|mps2|rad_s|radps|deg_s|degps|dps|m_s|mps|mm_s|ms|us|ns|[mun]sec|s|"
                   r"sec|m|mm|cm|ft|fps|ft_s|rad|deg|V|mV|mv|g|mg|N|kgf|gf|rpm|percent|pct)$")
_TIME_UNIT = re.compile(r"(?i)(time|timestamp)(us|ms|ns)")
_DSHOT = re.compile(r"(?i)(?<![a-z])dshot(?![a-z])")
_AXIS_WANTED = re.compile(r"([xyz]|roll|pitch|yaw)(des|desired|ref|sp|cmd|target|setpoint)")
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_APART = re.compile(r"[^a-z0-9]+")
_ELECTRICAL = re.compile(r"(?i)(?<![a-z])(e[ _]?rpm|electric)")
_VEHICLE = re.compile(r"(cf|uav|drone|quad|robot|agent|mav|rb|rigidbody)\d*|body\d+")

_WANTED = {"sp", "setpoint", "ref", "reference", "des", "desired", "target", "ctrltarget", "cmd", "command",
           "commanded", "goal", "demand", "demanded", "nominal", "waypoint", "traj", "soll", "sollwert", "consigne",
           "consigna"}
_ESTIMATED = {"estimate", "estimated", "est", "ekf", "kalman", "state", "onboard", "odom", "odometry"}
_MEASURED = {"mocap", "vicon", "optitrack", "qualisys", "gt", "truth", "groundtruth", "meas",
             "measured", "actual", "true", "nokov", "ist", "istwert", "mesure", "medido", "medida"}
_ACC = {"acc", "accel", "acceleration", "accelerometer", "a", "beschleunigung", "aceleracion",
        "accelerazione"}
_GYRO = {"gyro", "gyr", "gyroscope", "g", "rate", "rates", "w", "omega", "angvel", "drehrate", "winkelgeschwindigkeit"}
_VELOCITY = {"v", "vel", "velocity", "speed", "geschwindigkeit", "vitesse", "velocidad", "velocita"}
_TURN = {"q", "quat", "quaternion", "orientation", "rot", "rotation", "att", "attitude"}
_PLACE = {"p", "pos", "position", "t", "translation", "trans", "posicion", "posizione"}
_MOTOR, _SPEED = {"m", "motor", "motors", "pwm", "u", "esc", "throttle", "dshot"}, {"rpm", "rotor"}
_BATTERY = {"vbat", "battery", "batt", "bat", "vbatt", "voltage", "batteriespannung", "batterie", "bateria", "batteria"}
_THRUST = {"thrust", "collective", "throttle"}
_PLAIN = {"imu", "sensor", "body", "b", "filtered", "filt", "pose", "world", "global", "local",
          "log", "data", "vehicle", "crazyflie", "quadrotor", "drone", "linear", "lin", "angular", "ang", "pm", "raw",
          "frame", "stamped", "header", "field", "volt", "volts", "v", "out", "output", "msg", "rigid",
          "level", "fixed", "frequency"}
_WORLD = {"world", "global"}
_DIRECTIONS = {"north": "N", "east": "E", "west": "W", "up": "U", "down": "D", **{a: a.upper() for a in "neud"}}
_DIRECTED = re.compile(r"(p|pos|v|vel)([ned])")
NUMBERED = "0123"
"""Parts of a quaternion by number, with ``meaning`` for q0 .. q3. The scalar is the first in some logs and the last in
others."""
_COUNTED = {"012": "xyz", "123": "xyz", "1234": NUMBERED}
_AXES = ("NED", "ENU", "NWU")
_ANGLES = {"rollwinkel": "roll", "nickwinkel": "pitch", "gierwinkel": "yaw", "roulis": "roll", "tangage": "pitch",
           "lacet": "yaw", "alabeo": "roll", "cabeceo": "pitch", "guinada": "yaw", "rollio": "roll",
           "beccheggio": "pitch", "imbardata": "yaw"}
"""Names of angles in German, French, Spanish and Italian."""
_GREEK = {"phi": "roll", "theta": "pitch", "psi": "yaw"}
_HAMILTON = {"i": "x", "j": "y", "k": "z", "real": "w"}
_HEIGHTS = ("altitude", "height", "hauteur", "hohe", "hoehe", "altura", "altezza")
"""Words of a third coordinate next to x and y."""
_COMPASS = {"heading", "bearing", "azimuth", "cap"}
_BODY_RATES = {"p": "x", "q": "y", "r": "z"}
_TIME = {"t", "time", "timestamp", "timestamps", "stamp", "ts", "sec", "secs", "seconds", "datetime", "elapsed",
         "boot", "utime", "zeit", "temps", "horodatage", "zeitstempel", "tiempo", "tempo"}
_NO_PLACE = _MOTOR | _SPEED | _BATTERY | _THRUST | _TIME - {"t"} | {"imu", "sensor", "ang", "angular", "lin", "linear",
                                                                    "b"}
"""Words of vectors that are no positions, where they have a direction."""
NAMED_BY_FILES = ("px4", "mavlink")
"""Ecosystems that write one table a topic or message, and its name into that of the file."""
_CHARGE = {"percent", "percentage", "pct", "soc", "charge", "level", "remaining"}


def unit_of(column: str) -> str:
    """The unit that a name states, as a map writes it (as found where no map knows it), or ""."""
    for pattern, place in ((_UNIT, 1), (_ENDS, 2), (_TIME_UNIT, 2)):
        if match := pattern.fullmatch(column) if pattern is _TIME_UNIT else pattern.search(column):
            written = match[place].lower() if pattern is _TIME_UNIT else match[place]
            return unit_as_written(written) or written
    return "dshot" if _DSHOT.search(column) else ""


def words_of(column: str) -> tuple[list[str], str]:
    """The words of a column's name in lower case, and the unit it states, as a map writes it, or "".

    >>> words_of("imu.accX [m/s2]")
    (['imu', 'acc', 'x'], 'm/s^2')
    """
    unit = unit_of(column)
    if match := _UNIT.search(column):
        column = column[:match.start()]
    elif match := _ENDS.match(column) or _TIME_UNIT.fullmatch(column):
        column = match[1]
    words = [_ANGLES.get(w, w) for w in _APART.split(_CAMEL.sub("_", _unaccented(column)).lower()) if w]
    if words and (glued := _AXIS_WANTED.fullmatch(words[-1])):
        words[-1:] = [glued[1], glued[2]]
    if words and (glued := re.fullmatch(r"([a-z]+?)([wxyz]|[0-8])", words[-1])) and glued[1] in (
            _ACC | _GYRO | _VELOCITY | _TURN | _MOTOR | _SPEED | _PLACE):
        words[-1:] = [glued[1], glued[2]]
    return words, unit


def _unaccented(text: str) -> str:
    """Letters without their accents."""
    return "".join(c for c in unicodedata.normalize("NFD", text) if not unicodedata.combining(c))


def meaning(column: str) -> tuple[str, str] | str:
    """(stream, quantity) of a column by the words of its name, ("", "time") for timestamps, or why it is none of
    them."""
    words, unit = words_of(column)
    while len(words) > 1 and words[-1] in _WANTED | _ESTIMATED | _MEASURED:  # x_ekf, roll_ref
        words = [words[-1], *words[:-1]]
    if not words:
        return "it has no name"
    if _ELECTRICAL.search(column):
        return "an electrical speed: divide it by the pairs of poles, and multiply eRPM/100 by 100"
    last, before = words[-1], set(words[:-1])
    wanted, estimated = bool(before & _WANTED), bool(before & _ESTIMATED)
    known = _WANTED | _ESTIMATED | _MEASURED | _ACC | _GYRO | _VELOCITY | _TURN | _PLACE | _MOTOR | _SPEED | _BATTERY
    if last in _COMPASS:
        return ("a heading, usually clockwise from north: as a yaw, write sign = -1 and offset = 1.5708 (a quarter "
                "turn in rad)")
    if last == "d" and words[-2:-1] and words[-2] in ("x", "y", "z"):
        return "desired, or a derivative? where it is desired, write it in [streams.setpoint]"
    if last in ("rx", "ry", "rz"):
        return "a turn about several axes: Euler angles and a rotation vector look alike; give a quaternion"
    if strange := [w for w in words[:-1] if w not in known | _PLAIN | _THRUST | _TIME and not _VEHICLE.fullmatch(w)]:
        return f"{strange[0]!r} is no word that is known"
    if before & {"ang", "angular"} and before & _ACC:
        return "an angular acceleration, which no task uses"
    if words[0] in ("b", "bias") and before & (_ACC | _GYRO):
        return "a bias, which no task uses"
    if before & _WORLD and before & (_ACC | _GYRO):
        return "of an inertial sensor, in the axes of the world"
    of_turn = bool(before & _TURN and before & (_VELOCITY - {"v"} | {"rate", "rates"}))
    turning = bool(before & {"ang", "angular"} and before & _VELOCITY) or bool(before & _GYRO) or of_turn
    if last in NUMBERED and before & _TURN and not wanted:
        return "attitude_qw" if estimated else "mocap", f"q{last}"
    if last in _TIME and not before & (_ACC | _GYRO | _MOTOR) - {"t"}:
        return "", "time"
    if (last in _CHARGE and before & _BATTERY) or (last in _BATTERY and unit == "%"):
        return "a battery level as a percentage, which is no voltage"
    if last in _BATTERY or (last, unit) == ("tension", "V") or (last in ("v", "volt", "volts") and before & _BATTERY):
        return "battery", "vbat"
    if last in _THRUST:
        return "command", "thrust"
    if last in ("roll", "pitch", "yaw"):
        if before & _GYRO:
            return "a rate of an angle"
        if wanted:
            return ("setpoint", "yaw") if last == "yaw" else "an attitude set-point, which no task uses"
        return "attitude", last
    if last.isdigit() and before & (_SPEED | _MOTOR):
        if before & _BATTERY or (wanted and before & _SPEED):
            return "a voltage, or a commanded speed, of a motor, which no task uses"
        return ("rpm" if before & _SPEED else "motor", f"m{last}") if "0" <= last <= "8" else "no motor has this number"
    if last.isdigit() and unit == "rpm":
        return ("rpm", f"m{last}") if "0" <= last <= "8" else "no rotor has this number"
    if last == "rpm" and (match := re.fullmatch(r"m?(\d)", words[-2] if len(words) > 1 else "")):
        return "rpm", f"m{match[1]}"
    if last not in ("w", "x", "y", "z"):
        return f"{last!r} is no word that is known"
    estimated |= "imu" in before and bool(before & _TURN)
    if before & _TURN and not before & _ACC and not of_turn:
        return "an attitude set-point" if wanted else ("attitude_qw" if estimated else "mocap", f"q{last}")
    if last == "w" or (wanted and (turning or before & (_ACC | _VELOCITY))):
        return "a set-point that no task uses" if wanted else "'w' alone"
    if turning:
        return "imu", f"gyro_{last}"
    if before & _ACC:
        return ("estimator_acc", f"a{last}") if estimated else ("imu", f"acc_{last}")
    stream = "setpoint" if wanted else "estimator" if estimated else "mocap"
    if before & _VELOCITY:
        return (stream, f"v{last}") if not before & {"body", "b"} else "a velocity in the body frame"
    if strange := sorted(before & _NO_PLACE):
        return f"{strange[0]!r} is no position"
    return stream, last if stream != "mocap" else f"p{last}"


def vehicles_of(column: str) -> tuple[str, ...]:
    """Words of a column's name that number a vehicle: cf1, drone2."""
    return tuple(w for w in words_of(column)[0] if _VEHICLE.fullmatch(w))


FRACTIONS = {"nano": "ns", "n": "ns", "micro": "us", "u": "us", "milli": "ms", "m": "ms"}


def rest_of_seconds(column: str, columns: Iterable[str]) -> tuple[str, str]:
    """The column of ``columns`` with the fraction of the whole seconds of ``column``, by its name, and its unit.

    Both are "" without one.

    >>> rest_of_seconds("header.stamp.secs", ["header.stamp.nsecs", "x"])
    ('header.stamp.nsecs', 'ns')
    """
    whole = re.fullmatch(r"(.*?)sec(?:s|onds)?", column, re.IGNORECASE)
    for other in columns if whole else ():
        part = re.fullmatch(r"(.*?)(nano|micro|milli|n|u|m)sec(?:s|onds)?", other, re.IGNORECASE)
        if whole and part and part[1].lower() == whole[1].lower():
            return other, FRACTIONS[part[2].lower()]
    return "", ""


def is_wanted(column: str) -> bool:
    """Whether the name says that this was commanded, not measured."""
    return bool(set(words_of(column)[0]) & _WANTED)


def bare(column: str) -> str:
    """A name without the unit in brackets behind it and without ``field.`` before it, with the points of its
    ecosystem: ``stateEstimate_pitch`` is ``stateEstimate.pitch``."""
    name = _UNIT.sub("", column).strip().removeprefix("field.") or column
    return _pointed().get(name.replace("/", "_"), name)


@functools.cache
def _pointed() -> dict[str, str]:
    """Names of which only one ecosystem has them, by their spelling without points."""
    return {k.name.replace(".", "_"): k.name for key in keys() for k in ecosystem(key).names
            if "." in k.name and not k.plain}


def topic_in(stem: str) -> str:
    """The topic of PX4 that a file of ``ulog2csv`` names (``LOG_TOPIC_INSTANCE``), or the message of MAVLink, or "".
    Further words may follow it.

    >>> topic_in("log_trajectory_setpoint_0"), topic_in("SET_POSITION_TARGET_LOCAL_NED")
    ('trajectory_setpoint', 'POSITION_TARGET_LOCAL_NED')
    """
    name = re.sub(r"_\d+$", "", stem)
    topics = sorted({k.topic for key in NAMED_BY_FILES for k in ecosystem(key).names if k.topic}, key=len, reverse=True)
    return next((t for t in topics if f"_{t}_" in f"_{name.replace('-', '_')}_"), "")


def recognised(columns: Sequence[str], topic: str) -> list[Ecosystem]:
    """Ecosystems whose names these columns are: one that only it has, or most of all columns spelled alike.

    ``topic``: of PX4, whose names are common words, or of MAVLink."""
    there = {bare(c) for c in columns}
    found = []
    for key in keys():
        system = ecosystem(key)
        if system.timeless:
            continue
        of_topic = key in NAMED_BY_FILES and topic in {k.topic for k in system.names}
        if key == "px4":
            names = tuple(k for k in system.names if k.topic in ("", topic)) if of_topic else tuple(
                k for k in system.names if not k.topic or not k.plain)
            system = Ecosystem(key, f"{system.title} {topic}".strip(), system.origin, names)
        own = {k.name for k in system.names if not k.plain}
        all_names = {k.name for k in system.names}
        stated = of_topic and topic and there & {k.name for k in system.names if k.topic == topic}
        alike = 2 * len(there & all_names) >= len(there) and len(there & all_names) > 2
        if stated or there & own or (alike and not system.shown_by_own):
            found.append(_of_messages(system, there, topic) if key == "mavlink" else system)
    return found


def _of_messages(system: Ecosystem, there: Container[str], topic: str) -> Ecosystem:
    """The names of the messages that ``topic`` or a column that only they have shows, before those of others."""
    shown = {k.topic for k in system.names if k.topic and (k.topic == topic or (not k.plain and k.name in there))}
    claimed = {k.name for k in system.names if k.topic in shown}
    names = tuple(k for k in system.names if not k.topic or k.topic in shown or k.name not in claimed)
    return replace(system, names=names)


def known_names(columns: Iterable[str], systems: Iterable[Ecosystem]) -> dict[str, tuple[Known, str]]:
    """Column -> what its ecosystem says it is, and the title of that; a quantity goes to the best column for it."""
    of_bare = {bare(c): c for c in columns}
    found: dict[str, tuple[Known, str]] = {}
    for system in systems:
        for quantities in system.assign(of_bare).values():
            for known in quantities.values():
                found.setdefault(of_bare[known.name], (known, system.title))
        for known in system.names:
            if (not known.stream or known.what) and known.name in of_bare:
                found.setdefault(of_bare[known.name], (known, system.title))
            elif known.name in of_bare and of_bare[known.name] not in found:
                again = Known(known.name, what=f"{known.stream} {known.quantity} once more")
                found[of_bare[known.name]] = (again, system.title)
    return found


def directed(columns: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Columns whose names are whole sets: directions, numbers, Greek angles, or the body rates p, q, r. Column -> the
    name with x, y, z, and the axes.

    >>> directed(["pos_north", "pos_east", "pos_down"])["pos_down"]
    ('pos_z', 'NED')
    """
    found = {}
    for before, there in _by_last_word(columns).items():
        of_direction = {_DIRECTIONS[word]: column for word, column in there.items() if word in _DIRECTIONS}
        for axes in _AXES:
            if set(axes) == set(of_direction):
                found.update({of_direction[letter]: ("_".join([*before, axis]), axes)
                              for axis, letter in zip("xyz", axes, strict=True)})
        if {"x", "y"} <= set(there) and "z" not in there and (height := next((h for h in _HEIGHTS if h in there), "")):
            found[there[height]] = ("_".join([*before, "z"]), "")
        numbers = sorted(word for word in there if word.isdigit())
        letters = _COUNTED.get("".join(numbers), "")
        vector = any(len(word) > 1 for word in set(before) & (_PLACE | _VELOCITY | _ACC | _GYRO))
        names = dict(zip(numbers, letters, strict=False)) if vector == (letters == "xyz") and (
            vector or set(before) & _TURN) else {}
        names |= {word: name for word, name in _GREEK.items() if set(_GREEK) <= set(there)}
        names |= {word: name for word, name in _HAMILTON.items() if set(before) & _TURN and set(_HAMILTON) <= set(
            there)}
        names |= {word: f"gyro_{axis}" for word, axis in _BODY_RATES.items() if not before and set(_BODY_RATES) <= set(
            there)}
        found.update({there[word]: ("_".join([*before, name]), "") for word, name in names.items()})
    return found


def _by_last_word(columns: Iterable[str]) -> dict[tuple[str, ...], dict[str, str]]:
    """Words of names before the last one -> last word -> column."""
    groups: dict[tuple[str, ...], dict[str, str]] = {}
    for column in columns:
        words = words_of(column)[0]
        if words and (glued := _DIRECTED.fullmatch(words[-1])):
            words = [*words[:-1], glued[1], glued[2]]
        if words:
            groups.setdefault(tuple(words[:-1]), {})[words[-1]] = column
    return groups


def guessed(columns: Iterable[str], taken: Container[tuple[str, str]] = (),
            called: Mapping[str, str] = MappingProxyType({})) -> tuple[dict[tuple[str, str], str], dict[str, str]]:
    """{(stream, quantity): column} by words, and {column: why it was not guessed}; ``taken``: what others are;
    ``called``: other names of columns, to be used instead."""
    columns = tuple(columns)
    found: dict[tuple[str, str], str] = {}
    why: dict[str, str] = {}
    matrices = {tuple(words[:-1]) for words in (words_of(c)[0] for c in columns) if words[-1:] == ["8"]}
    for column in columns:
        what = meaning(called.get(column, column))
        if isinstance(what, str):
            why[column] = what
        elif re.fullmatch(r"q\d", what[1]) and tuple(words_of(column)[0][:-1]) in matrices:
            why[column] = "of a rotation matrix, which maps do not read: give a quaternion"
        elif what in found or what in taken:
            why[column] = f"{' '.join(filter(None, what))} is {found.get(what, 'another column')!r} already"
        else:
            found[what] = column
    return found, why
