"""Units told from the size of numbers alone: what a quantity of a small quadrotor can be.

For quantities that can be compared with the motion capture, ``axis_unit_matching`` shows more. This file has the
others, and the scale of the motion capture itself, on which every comparison relies.
"""

from dataclasses import dataclass

import numpy as np

from ..flight import Stream, mask_of, motors_of
from ..settings import number, setting
from ..units import GRAVITY_M_S2, PWM_FULL_SCALE
from .airborne import airborne_spans
from .column_evidence import noise_by_axis, one_unit
from .context import Context
from .dropouts import alive_until
from .flown_axes import SCALES, tracker_scales
from .known_factors import named_factor
from .quaternion_lengths import STREAMS as QUATERNIONS
from .quaternion_lengths import other_length, scaled_part
from .usable_rows import typical_step_s, usable_streams

FACTOR = number("audit.plausible_ranges.factor")
SLOWEST_STEP_S = number("audit.plausible_ranges.slowest_step_s")
BATTERY_V = setting("audit.plausible_ranges.battery_v")
ROTOR_RAD_S = setting("audit.plausible_ranges.rotor_rad_s")
FLIES_WITH = number("audit.plausible_ranges.flies_with")
LEAST_BELOW = 0.05
"""Of full, and of the rows: commands below zero that are no rounding."""
POSITION = ("px", "py", "pz")
SHAKES = number("audit.plausible_ranges.shakes")
NOISE_WITHIN = number("audit.plausible_ranges.noise_within")


@dataclass(frozen=True)
class WrongUnit:
    """quantities of a stream are ``factor`` times what they should be."""

    stream: str
    quantities: tuple[str, ...]
    factor: float
    evidence: str


def _alive(context: Context, name: str, quantities: tuple[str, ...]) -> np.ndarray | None:
    stream: Stream | None = context.once(usable_streams).get(name)
    if stream is None or not quantities or not all(q in stream.quantities for q in quantities):
        return None
    values = stream[quantities][stream.time_s <= context.once(alive_until)[name]]
    values = values[np.isfinite(values).all(axis=1)]
    return values if len(values) > 20 else None


def odd_axis(context: Context) -> WrongUnit | None:
    """The axis of the tracked position whose noise is of another size than that of the others; one tracker measures all
    three alike. Timestamps play no part."""
    stream = context.flight.streams.get("mocap")
    if stream is None or not all(q in stream.quantities for q in POSITION):
        return None
    position = stream[POSITION]
    if one_unit(position, True):
        return None
    sizes = np.log(noise_by_axis(position, True)[0])
    known = np.flatnonzero(np.isfinite(sizes))
    away = [abs(sizes[k] - np.median(np.delete(sizes[known], i))) for i, k in enumerate(known)]
    axis = int(known[int(np.argmax(away))])
    factor = float(np.exp(sizes[axis] - np.nanmedian(np.delete(sizes, axis))))
    named = named_factor("m", factor, NOISE_WITHIN)
    return WrongUnit("mocap", (POSITION[axis],), named.factor if len(named.known) == 1 else factor,
                     f"the noise of {POSITION[axis]} is {factor:.3g} times that of the other axes{named.reading}")


def wrong_ranges(context: Context) -> list[WrongUnit]:
    """Everything whose size alone gives it away."""
    found = []
    for name in ("mocap", "imu"):
        stream = context.once(usable_streams).get(name)
        step = typical_step_s(stream.time_s) if stream is not None and len(stream) > 100 else 0.0
        if step > SLOWEST_STEP_S:
            evidence = f"the rows of {name} are stamped {step:.3g} s apart: milliseconds or microseconds"
            found.append(WrongUnit("", ("t",), 1000.0 if step < 1e3 * SLOWEST_STEP_S else 1e6, evidence))
            break
    if (odd := odd_axis(context)) is not None:
        found.append(odd)
    elif (scales := context.once(tracker_scales)) != (1.0,):
        found.append(WrongUnit("mocap", POSITION, scales[-1], "the tracked position spans more than a room: "
                               + " or ".join(SCALES[scale] for scale in reversed(scales))
                               + ", and nothing shows which" * (len(scales) > 1)))
    for name, turn in QUATERNIONS.items():
        turned = context.flight.streams.get(name)
        if turned is None or not all(q in turned.quantities for q in turn):
            continue
        part, length = scaled_part(turned[turn]), other_length(turned[turn])
        if part is not None and abs(np.log(part[1])) > np.log(FACTOR):
            found.append(WrongUnit(name, (turn[part[0]],), part[1],
                                   f"{turn[part[0]]} of {name} is {part[1]:.3g} times what gives the quaternions "
                                   "length 1"))
        elif length is not None:
            found.append(WrongUnit(name, turn, length, f"the quaternions of {name} have length {length:.3g}, not 1: an "
                                                       "element is in another unit"))
    acc = _alive(context, "imu", ("acc_x", "acc_y", "acc_z"))
    if acc is not None:
        norm = float(np.median(np.linalg.norm(acc, axis=1)))
        ratio = norm / GRAVITY_M_S2
        if norm > 0.0 and abs(np.log(ratio)) > np.log(FACTOR):
            named = named_factor("m/s^2", ratio, SHAKES)
            found.append(WrongUnit("imu", ("acc_x", "acc_y", "acc_z"), named.factor,
                                   f"the median of the specific force is {norm:.4g} m/s^2, gravity is 9.81"
                                   f"{named.reading}"))
    volts = _alive(context, "battery", ("vbat",))
    if volts is not None:
        median = float(np.median(volts))
        if median > 0.0 and not BATTERY_V[0] <= median <= BATTERY_V[1]:
            factor = 1000.0 if median > BATTERY_V[1] else 1e-3
            found.append(WrongUnit("battery", ("vbat",), factor, f"the median of the battery is {median:.4g} V"))
    for name, quantities in (
        *((name, motors_of(context.flight[name])) for name in ("motor", "motor_request") if name in context.flight),
        ("pid", ("cmd_thrust",)),
    ):
        found += _commands(context, name, quantities)
    found += _rotor_speeds(context)
    for name, angles in (("attitude", ("roll", "pitch", "yaw")), ("setpoint", ("yaw",)),
                         ("pid", ("roll", "pitch", "yaw"))):
        angle = _alive(context, name, angles)
        if angle is not None and float(np.quantile(np.abs(angle), 0.99)) > 4.0 * np.pi:
            found.append(
                WrongUnit(name, angles, 180.0 / np.pi, f"angles of {name} reach {np.abs(angle).max():.3g} rad")
            )
    return found


def _commands(context: Context, name: str, quantities: tuple[str, ...]) -> list[WrongUnit]:
    """Commands beyond full or next to nothing, and single motors that are far from the others."""
    command = _alive(context, name, quantities)
    if command is None:
        return []
    tops = np.quantile(command, 0.99, axis=0)
    usual = float(np.median(tops))
    odd = [i for i, top in enumerate(tops) if top > 0.0 < usual and abs(np.log(top / usual)) > np.log(FACTOR)]
    found = [WrongUnit(name, (quantities[i],), tops[i] / usual,
                       f"{quantities[i]} reaches {tops[i]:.3g}, and the others {usual:.3g}") for i in odd]
    alike = [i for i in range(len(quantities)) if i not in odd]
    names, top = tuple(quantities[i] for i in alike), float(tops[alike].max())
    if top > 2.0:
        factor = PWM_FULL_SCALE if top > 256.0 else 100.0
        found.append(WrongUnit(name, names, factor, f"{', '.join(names)} reach {top:.4g} where 1 is full"))
    elif 0.0 < top < (FLIES_WITH if context.once(airborne_spans) else 1e-3):
        found.append(WrongUnit(name, names, 1.0 / PWM_FULL_SCALE, f"{', '.join(names)} never exceed {top:.2g} of full"))
    low = float(np.quantile(command[:, alike], LEAST_BELOW)) if name != "pid" else 0.0
    if low < -LEAST_BELOW and 0.0 < top <= 2.0:
        found.append(WrongUnit(name, names, 2.0, f"{', '.join(names)} go down to {low:.3g}, and a command is 0 to "
                                                 "1: they are -1 to 1, or rotors turn both ways"))
    return found


def _rotor_speeds(context: Context) -> list[WrongUnit]:
    """Rotors that turn more slowly or faster in flight than those of any vehicle."""
    stream, air = context.once(usable_streams).get("rpm"), context.once(airborne_spans)
    if stream is None or not air or not (names := motors_of(stream)):
        return []
    there = np.abs(stream[names][mask_of(air, stream.time_s)])
    there = there[np.isfinite(there).all(axis=1) & there.any(axis=1)]
    speed = float(np.median(there)) if len(there) else 0.0
    if not speed > 0.0 or ROTOR_RAD_S[0] <= speed <= ROTOR_RAD_S[1]:
        return []
    factor = 1.0 / 60.0 if speed < ROTOR_RAD_S[0] else 6.0
    what = "revolutions per second, or thousands" if factor < 1.0 else "an electrical speed"
    return [WrongUnit("rpm", names, factor, f"rotors turn at {speed:.3g} rad/s ({speed * 30.0 / np.pi:.3g} rpm) in "
                                            f"flight: {what}")]
