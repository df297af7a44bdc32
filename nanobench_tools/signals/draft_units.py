"""Units of a drafted map that the numbers show, contradictions between columns, and questions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from .. import so3
from ..settings import count, number
from ..sources.column_names import meaning, words_of
from ..sources.tum_layout import NORM_TOLERANCE
from ..units import GRAVITY_M_S2, factor
from . import column_evidence as evidence
from .draft import QUATERNION, Draft, Key
from .draft_motors import judge_motors
from .draft_places import judge_places
from .known_factors import COUNTS_PER_G
from .quaternion_reading import Samples, reading_of
from .tumbling import gyro_scale

VECTORS: tuple[tuple[str, tuple[str, ...]], ...] = tuple(
    (stream, names) for stream, names in (
        ("mocap", ("px", "py", "pz")), ("estimator", ("x", "y", "z")), ("setpoint", ("x", "y", "z")),
        ("mocap", ("vx", "vy", "vz")), ("estimator", ("vx", "vy", "vz")), ("estimator_acc", ("ax", "ay", "az")),
        ("imu", ("acc_x", "acc_y", "acc_z")), ("imu", ("gyro_x", "gyro_y", "gyro_z")),
        ("attitude", ("roll", "pitch", "yaw"))))
"""Quantities that share a unit."""
REST_SHARE = count("audit.draft_units.rest_share")
GRAVITY_WITHIN = number("audit.draft_units.gravity_within")
COUNTS_WITHIN = number("audit.draft_units.counts_within")
OF_ONE_UNIT = number("audit.draft_units.of_one_unit")
LEAST_FORCE = number("audit.draft_units.least_force")
LEAST_TILT_DEG = number("audit.draft_units.least_tilt_deg")
MOST_TURNS = count("audit.draft_units.most_turns")
COUNTS_PER_G_WITHIN = 1.2
"""In flight the median of the specific force exceeds gravity by less."""
MOST_PITCH_DEG = 95.0
"""A pitch is within a right angle by its definition; numbers and filters exceed it by little."""


def judge_units(draft: Draft, values: Mapping[str, np.ndarray], time_s: np.ndarray) -> None:
    """Units that the numbers show, contradictions, and questions."""
    for stream, names in VECTORS:
        keys = draft.columns(stream, names)
        if len(keys) > 1 and stream != "attitude" and not evidence.one_unit(
                draft.si(keys, values), stream in ("imu", "mocap") and not names[0].startswith("v")):
            draft.ask(keys, "their noise differs: are they all in one unit? write the unit of each")
    _battery(draft, values)
    judge_motors(draft, values)
    _gravity(draft, values)
    judge_places(draft, values, time_s)
    for stream in ("mocap", "attitude_qw"):
        _quaternion(draft, stream, values, time_s)
    _angles(draft, values)
    _yaw_wanted(draft, values)
    _gyro(draft, values, time_s)


def _battery(draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    key = ("battery", "vbat")
    if key not in draft.mapped:
        return
    drafted = draft.mapped[key]
    cells = values[drafted.column][np.isfinite(values[drafted.column])]
    if not len(cells):
        return
    middle = float(np.median(cells))
    if drafted.status == "known":
        if not 0.5 * evidence.CELLS_V[0] <= middle * factor(drafted.unit) <= 2.0 * evidence.CELLS_V[1]:
            draft.ask([key], f"{middle:g} {drafted.unit} is not a plausible battery voltage; give its meaning")
        return
    whole, falling = bool(np.all(cells == np.round(cells))), bool(np.all(np.diff(cells) <= 0.0))
    low, high = evidence.CELLS_V
    if cells.min() >= 0.0 and cells.max() <= 1.0:
        draft.unknown[draft.mapped.pop(key).column] = "a battery level as a share (state of charge), no voltage"
    elif cells.max() <= 100.0 and (middle > high or whole) and (falling or middle > 2.0 * high):
        draft.unknown[draft.mapped.pop(key).column] = "a battery level as a percentage, which is no voltage"
    elif low <= middle <= high and not whole:
        draft.mapped[key] = replace(drafted, why=f"{middle:.3g} V is a battery's voltage")
    elif low <= 1e-3 * middle <= high:
        draft.set_unit([key], "mV", f"the median is {middle:.4g}", "assumed" if whole and falling else "shown")
    else:
        draft.ask([key], f"a median of {middle:.3g}: volts or a percentage? write unit = \"V\", or leave it out")


def _gravity(draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    """Specific force has gravity's size; a stream without it is no accelerometer."""
    keys = draft.columns("imu", ("acc_x", "acc_y", "acc_z"))
    if len(keys) < 3:
        if draft.open(keys):
            draft.ask(keys, "an accelerometer with one or two axes: m/s^2 or g? write unit = \"m/s^2\" or \"g\"")
        return
    cells = np.stack([values[draft.mapped[k].column] for k in keys], axis=1)
    norm = float(np.nanmedian(np.linalg.norm(cells, axis=1)))
    if norm > 0.0 and float(np.linalg.norm(np.nanmean(cells, axis=0))) < evidence.LEAST_GRAVITY * norm:
        draft.ask(keys, "no accelerometer: its mean is about 0, without gravity. Is it the acceleration of an "
                  "estimate? write [streams.estimator_acc] ax, ay, az")
        return
    factors = {"m/s^2": 1.0, "g": factor("g"), "mg": factor("mg"), "mm/s^2": factor("mm/s^2")}
    near = (np.log(LEAST_FORCE), np.log(evidence.SAME))
    fits = [u for u, f in factors.items() if norm > 0.0 and near[0] < np.log(norm * f / GRAVITY_M_S2) < near[1]]
    if not draft.open(keys):
        if draft.mapped[keys[2]].unit not in fits:
            draft.ask(keys, f"in {draft.mapped[keys[2]].unit} the median of the specific force is not gravity's "
                      f"({norm:.4g}); which unit is it? write unit = one of {', '.join(factors)}")
    elif fits in (["mg"], ["mm/s^2"]) and not _at_rest(cells, GRAVITY_M_S2 / factor(fits[0])):
        draft.ask(keys, f"the median is {norm:.4g}: {fits[0]}, cm/s^2 or counts of the sensor? write unit = "
                  f"\"{fits[0]}\", or convert it to m/s^2")
    elif fits:
        draft.set_unit(keys, fits[0], f"the median of the specific force is {norm:.4g}, which is gravity")
    elif counts := [c for c in COUNTS_PER_G if abs(np.log(norm / c)) < np.log(COUNTS_PER_G_WITHIN)]:
        draft.ask(keys, f"the median is {norm:.4g}: counts, {counts[0]:g} of them 1 g? Convert them to m/s^2")
    else:
        draft.ask(keys, f"no accelerometer: the median is {norm:.4g}, without gravity. Is it the acceleration of an "
                  "estimate? write [streams.estimator_acc] ax, ay, az")


def _at_rest(cells: np.ndarray, gravity: float) -> bool:
    """Whether the first rows of (n, 3) specific forces have this size: a vehicle rests before it takes off."""
    first = cells[: max(len(cells) // REST_SHARE, evidence.WINDOW)]
    return bool(abs(float(np.linalg.norm(np.nanmean(first, axis=0))) / gravity - 1.0) < GRAVITY_WITHIN)


def _quaternion(draft: Draft, stream: str, values: Mapping[str, np.ndarray], time_s: np.ndarray) -> None:
    """Reads a quaternion as the path and the gyro show it: its scalar in another place, or inverted."""
    keys = draft.columns(stream, QUATERNION)
    if len(keys) < len(QUATERNION) or stream in draft.frames:
        return
    rising = np.isfinite(time_s) & (np.diff(time_s, prepend=-np.inf) > 0.0)

    def samples(keys: list[Key]) -> Samples | None:
        there = rising & np.isfinite(draft.si(keys, values)).all(axis=1) if len(keys) >= 3 else rising & False
        return (time_s[there], draft.si(keys, values)[there]) if there.sum() > 20 else None

    attitude = samples(keys)
    if attitude is None:
        return
    unit = np.abs(np.linalg.norm(attitude[1], axis=1) - 1.0) < NORM_TOLERANCE
    path = samples(draft.columns("mocap", ("px", "py", "pz"))) if stream == "mocap" else None
    gyro = None if "imu" in draft.frames else samples(draft.columns("imu", ("gyro_x", "gyro_y", "gyro_z")))
    if unit.sum() < 20:
        return
    reading, why = reading_of((attitude[0][unit], attitude[1][unit]), path, gyro)
    if reading.as_stored:
        return
    stored = [draft.mapped[key] for key in keys]
    for key, place in zip(keys, reading.places, strict=True):
        sign = -1 if reading.inverted and key[1] != "qw" else 1
        draft.mapped[key] = replace(stored[place], sign=sign * stored[place].sign, status="shown", why="the flight")
    draft.notes.append(f"{', '.join(d.column for d in stored)}: {reading.meaning}, read so, since {why}")


def _angles(draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    keys = draft.columns("attitude", ("roll", "pitch", "yaw"))
    if _of_several_units(draft, keys, values):
        draft.ask(keys, "they turn by amounts of different size: are they all in one unit? write the unit of each")
        return
    still = draft.open(keys)
    if keys and not still and float(np.nanquantile(np.abs(draft.si(keys, values)), 0.999)) > 4.0 * np.pi:
        draft.ask(keys, "angles of more than two turns; which unit is it? write the unit of each")
    if not still:
        return
    cells = np.stack([values[draft.mapped[k].column] for k in keys], axis=1)
    top = float(np.nanquantile(np.abs(cells), 0.999))
    tilts = [k for k, key in enumerate(keys) if key[1] != "yaw"]
    tilt = float(np.nanquantile(np.abs(cells[:, tilts]), 0.999)) if tilts else 0.0
    steep = [key for key in still if key[1] == "pitch" and float(np.nanquantile(np.abs(
        (values[draft.mapped[key].column] + 180.0) % 360.0 - 180.0), 0.99)) > MOST_PITCH_DEG]
    if steep:
        draft.ask(still, f"{draft.mapped[steep[0]].column} exceeds a right angle in deg: which unit is it? write the "
                  "unit of each, or convert them to deg")
    elif tilt > 2.0 * np.pi or top > 2.0 * np.pi * MOST_TURNS:
        draft.set_unit(still, "deg", f"they reach {top:.3g}")
    elif top > 0.5 * np.pi:
        draft.ask(still, f"they reach {top:.3g}: rad or deg? write unit = \"rad\" or \"deg\" at each")


def _of_several_units(draft: Draft, keys: list[Key], values: Mapping[str, np.ndarray]) -> bool:
    """Whether steps of roll, pitch and yaw from row to row, or rates about x, y and z, differ by more than a flight
    explains. About z a vehicle turns by less, down to nothing, but not by far more."""
    if len(keys) < 2 or not draft.open(keys):
        return False
    si = draft.si(keys, values)
    steps = np.diff(so3.wrap_angle(si) if keys[0][0] == "attitude" and (np.nanmax(np.abs(si)) < 2.0 * np.pi) else si,
                    axis=0)
    if not np.isfinite(steps).any(axis=0).all():
        return False
    size = np.sqrt(np.nanmean(steps**2, axis=0))
    about = {key[1][-1] if key[0] == "imu" else {"roll": "x", "pitch": "y", "yaw": "z"}[key[1]]: float(v)
             for key, v in zip(keys, size, strict=True)}
    across = [about[a] for a in "xy" if about.get(a, 0.0) > 0.0]
    if len(across) == 2 and max(across) > OF_ONE_UNIT * min(across):
        return True
    return bool(across) and about.get("z", 0.0) > OF_ONE_UNIT * max(across) and (keys[0][0] == "imu" or _tilts_little(
        draft, keys, values))


def _tilts_little(draft: Draft, keys: list[Key], values: Mapping[str, np.ndarray]) -> bool:
    """Whether roll and pitch, in the unit of a yaw of several turns, stay below what a vehicle flies with."""
    yaw, tilts = [[k for k in keys if (k[1] == "yaw") == turning] for turning in (True, False)]
    return bool(np.nanmax(np.abs(draft.si(yaw, values))) > 2.0 * np.pi * MOST_TURNS
                and np.nanmax(np.abs(draft.si(tilts, values))) < LEAST_TILT_DEG)


def _yaw_wanted(draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    """The unit of a yaw set-point is that in which it is the yaw of the attitude. It stays assumed where the vehicle
    does not follow it, or where it turns too little to show the unit."""
    key = ("setpoint", "yaw")
    flown = _yaw(draft, values)
    if key not in draft.mapped or not draft.open([key]) or flown is None:
        return
    cells = values[draft.mapped[key].column]
    known = np.isfinite(cells) & np.isfinite(flown)
    if known.sum() < evidence.WINDOW:
        return
    apart, turned = {}, {}
    for unit in ("rad", "deg"):
        wanted = cells[known] * factor(unit)
        apart[unit] = float(np.mean(np.abs(so3.wrap_angle(wanted - flown[known]))))
        turned[unit] = float(np.ptp(np.quantile(wanted, (0.05, 0.95))))
    unit, other = sorted(apart, key=apart.__getitem__)
    if apart[unit] < evidence.YAW_FOLLOWED_RAD and apart[other] > evidence.YAW_MISSED_RAD and (
            turned[unit] > evidence.YAW_MISSED_RAD):
        draft.set_unit([key], unit, f"in {unit} it is within {np.degrees(apart[unit]):.2g} deg of the attitude's yaw, "
                       f"in {other} {np.degrees(apart[other]):.2g} deg away")


def _yaw(draft: Draft, values: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """(n,) rad: yaw of an attitude of the table whose unit is not merely assumed."""
    keys = draft.columns("attitude", ("yaw",))
    if keys and not draft.open(keys):
        return draft.si(keys, values)[:, 0]
    for stream in ("attitude_qw", "mocap"):
        if len(keys := draft.columns(stream, QUATERNION)) == len(QUATERNION):
            return np.asarray(so3.euler_zyx(draft.si(keys, values))[:, 2])
    return None


def _turning(draft: Draft, values: Mapping[str, np.ndarray], time_s: np.ndarray) -> np.ndarray | None:
    """(n, 3) body rate of an attitude of the table, rad/s."""
    for stream in ("attitude_qw", "mocap"):
        if len(keys := draft.columns(stream, QUATERNION)) == len(QUATERNION):
            q = so3.make_continuous(draft.si(keys, values))
            step = evidence.rate_of(time_s, q)
            return 2.0 * so3.multiply(so3.conjugate(q), step)[:, :3]
    keys = draft.columns("attitude", ("roll", "pitch", "yaw"))
    if len(keys) == 3:
        return evidence.rate_of(time_s, np.unwrap(draft.si(keys, values), axis=0))
    return None


def _gyro(draft: Draft, values: Mapping[str, np.ndarray], time_s: np.ndarray) -> None:
    keys = draft.columns("imu", ("gyro_x", "gyro_y", "gyro_z"))
    if not keys:
        return
    if _of_several_units(draft, keys, values):
        draft.ask(keys, "they turn at rates of different size: are they all in one unit? write the unit of each")
        return
    factors = {"rad/s": 1.0, "deg/s": factor("deg/s"), "mrad/s": factor("mrad/s"),
               "mdeg/s": factor("mdeg/s")}
    cells = np.stack([values[draft.mapped[k].column] for k in keys], axis=1)
    turning = _turning(draft, values, time_s)
    unit = draft.mapped[keys[0]].unit
    if turning is not None:
        axes = ["xyz".index(k[1][-1]) for k in keys]
        found = evidence.ratio_of_means(evidence.smooth(draft.si(keys, values)), turning[:, axes],
                                        float(np.median(np.diff(time_s))))
        if found.known:
            fits = [u for u, f in factors.items() if found.agrees(factor(unit) / f) and (
                u != "mrad/s" or u == unit or all(
                    abs(np.log(r * f / factor(unit))) < np.log(COUNTS_WITHIN) for r in found.known))]
            if not fits or (fits[0] != unit and not draft.open(keys)):
                shown = ", ".join(f"{r:.3g}" for r in found.known)
                draft.ask([*keys, *draft.columns("attitude", ("roll", "pitch", "yaw"))],
                          f"the gyro turns {shown} times as fast as the attitude; write the unit of each")
            elif draft.open(keys):
                draft.set_unit(keys, fits[0], "it turns as fast as the attitude")
            _frd(draft, found, values)
            return
    if _accelerates(draft, keys, values, time_s, factors) or _tumbles(draft, keys, values, time_s, factors):
        return
    fits = evidence.rates_that_fit(cells, factors)
    if draft.open(keys):
        if named := draft.mapped[draft.open(keys)[0]].why:
            if len(fits) > 1:
                draft.confirm(keys, f"as in {named}; {' or '.join(fits)} is possible")
            elif fits:
                draft.set_unit(draft.open(keys), fits[0], f"it reaches {np.nanmax(np.abs(cells)):.3g}")
        elif len(fits) > 1 and "rad/s" in fits:
            draft.ask(keys, f"{' or '.join(fits)}? both are possible; write unit = \"rad/s\" or \"deg/s\" at each")
        elif fits == ["deg/s"]:
            draft.set_unit(keys, fits[0], f"it reaches {np.nanmax(np.abs(cells)):.3g}")
        elif fits and fits != ["rad/s"]:
            draft.ask(keys, f"it reaches {np.nanmax(np.abs(cells)):.3g}: {', '.join(fits)} or counts of the sensor? "
                      f"write unit = \"{fits[0]}\" at each, or convert counts to rad/s")
    elif float(np.nanquantile(np.abs(cells), 0.999)) * factor(unit) > 2.0 * evidence.FASTEST_RAD_S:
        draft.ask(keys, f"in {unit} it reaches more than any gyro measures; which unit is it?")


def _tumbles(draft: Draft, keys: list[Key], values: Mapping[str, np.ndarray], time_s: np.ndarray,
             factors: Mapping[str, float]) -> bool:
    """Whether the specific force shows that the gyro is in another unit; sets an assumed one, or asks."""
    force = draft.columns("imu", ("acc_x", "acc_y", "acc_z"))
    if len(keys) < 3 or len(force) < 3:
        return False
    found = gyro_scale(time_s, draft.si(keys, values), draft.si(force, values))
    if found is None:
        return False
    unit = draft.mapped[keys[0]].unit
    fits = [u for u, f in factors.items() if abs(np.log(found.factor * f / factor(unit))) < np.log(COUNTS_WITHIN)]
    why = f"in {unit} the vehicle would {'turn head over heels' if found.factor > 1.0 else 'hardly turn'}"
    if fits and len(draft.open(keys)) == len(keys):
        draft.set_unit(keys, fits[0], why)
    else:
        draft.ask(keys, f"{why}{found.reading}; write the unit of each")
    return True


def _accelerates(draft: Draft, keys: list[Key], values: Mapping[str, np.ndarray], time_s: np.ndarray,
                 factors: Mapping[str, float]) -> bool:
    """Whether an angular acceleration of the table, in rad/s^2, shows that an assumed unit is wrong; sets or asks for
    the unit. Agreement shows nothing: both may be in degrees."""
    of_axis: dict[str, str] = {}
    for column in values:
        what, (words, unit) = meaning(column), words_of(column)
        if isinstance(what, str) and what.startswith("an angular acceleration") and unit in ("", "rad/s^2"):
            of_axis.setdefault(words[-1], column)
    keys = [k for k in draft.open(keys) if k[1][-1] in of_axis]
    if not keys:
        return False
    rising = np.stack([values[of_axis[k[1][-1]]] for k in keys], axis=1)
    found = evidence.ratio(evidence.rate_of(time_s, draft.si(keys, values)), evidence.smooth(rising))
    if not found.known or found.agrees(1.0):
        return False
    keys = draft.open(draft.columns("imu", ("gyro_x", "gyro_y", "gyro_z")))
    fits = [u for u, f in factors.items() if found.agrees(factor(draft.mapped[keys[0]].unit) / f)]
    shown = ", ".join(f"{r:.3g}" for r in found.known)
    if fits:
        draft.set_unit(keys, fits[0], f"its rate is {shown} times the angular acceleration in rad/s^2")
    else:
        draft.ask(keys, f"its rate is {shown} times the angular acceleration; write the unit of each")
    return True


def _frd(draft: Draft, turns: evidence.Ratio, values: Mapping[str, np.ndarray]) -> None:
    """Turns the IMU where gravity lies along -z and the gyro turns against the attitude about y and z alone."""
    up = ("imu", "acc_z")
    if turns.sign[1:] == (-1, -1) and turns.sign[0] >= 0 and up in draft.mapped and "imu" not in draft.frames \
            and float(np.nanmedian(values[draft.mapped[up].column])) < 0.0:
        draft.frames["imu"] = "FRD"
        draft.notes.append("imu: forward, right, down (FRD), since gravity lies along -z and the gyro turns against "
                           "the attitude about y and z")
