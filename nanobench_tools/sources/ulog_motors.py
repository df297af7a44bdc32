"""Motor commands and rotor speeds of a ULog, in the vehicle's order of rotors and then in ours.

Ours counts clockwise from front right (front right, back right, back left, front left); PX4's quadrotor X is front
right, back left, front left, back right. Where the log holds the geometry (CA_ROTORi_PX and _PY), that decides.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..flight import STREAM_QUANTITIES, Fault, Stream
from ..units import to_si
from .base import text_fault
from .ulog_topics import MOTORS, PX4, Topic, stream_of, topics_of

TOPICS = topics_of(*MOTORS)
PX4_QUAD_X = tuple(int(re.sub(r"\D", "", known.name)) for known in PX4.topics["actuator_motors"])
"""Our motor 1..4 -> PX4's rotor, counted from 0, as the table of PX4's names has it."""

SUPPORTED = sum(bool(re.fullmatch(r"m\d+", q)) for q in STREAM_QUANTITIES["motor"])
"""Rotors a motor stream can hold."""

FIRST_MOTOR_FUNCTION = 101
"""Output function of motor 1 (parameters and esc_status)."""

FEWEST_ROTORS = 3
"""Of a multirotor."""
OUTPUT_GROUPS = ("PWM_MAIN", "PWM_AUX", "UAVCAN_EC", "HIL_ACT", "SIM_GZ_EC")
"""Groups of outputs whose functions the parameters GROUP_FUNC1 .. name."""

Found = tuple[Topic, list[str], np.ndarray]
"""Topic, fields, values (n, k)."""


@dataclass(frozen=True)
class Motors:
    """``streams``: motor, rpm, or for more rotors than they hold, ``extra_motor`` and ``extra_rpm``."""

    streams: dict[str, Stream]
    findings: tuple[Fault, ...]
    notes: tuple[str, ...]


def motors(topics: Mapping[str, Sequence[Topic]], parameters: Mapping[str, float], unread: list[str]) -> Motors:
    """What the log says about motors; ``topics`` holds all instances by name. ``unread`` gets topics in a layout that
    nobody foresaw."""
    streams: dict[str, Stream] = {}
    findings: list[Fault] = []
    notes: list[str] = []
    makers: dict[str, Callable[[], Found | None]] = {"motor": lambda: _commands(topics, parameters, notes),
                                                     "rpm": lambda: _speeds(topics)}
    for name, make in makers.items():
        try:
            found = make()
        except (ValueError, IndexError, KeyError, TypeError, ArithmeticError) as error:
            unread.append(f"of {name} cannot be read ({type(error).__name__}: {' '.join(str(error).split())[:80]})")
            continue
        if found is None:
            continue
        topic, fields, values = found
        count = len(fields)
        if count > SUPPORTED:
            stream = _extra(topic, fields, values)
            streams[f"extra_{name}"] = stream
            findings.append(
                text_fault(
                    "extra_column",
                    name,
                    stream.columns,
                    f"{count} rotors in {topic.name}, a {name} stream holds {SUPPORTED}: all are kept as extra_{name}, "
                    "and what needs motor commands is not judged",
                    (float(stream.time_s[0]), float(stream.time_s[-1])),
                    float(count),
                    "columns",
                )
            )
            continue
        order = _order(count, parameters, notes)
        made = stream_of(name, topic, [f"m{i + 1}" for i in range(count)], [fields[i] for i in order],
                         values[:, list(order)])
        if made is not None:
            streams[name] = made
    return Motors(streams, tuple(findings), tuple(dict.fromkeys(notes)))


def _extra(topic: Topic, fields: Sequence[str], values: np.ndarray) -> Stream:
    time_s = 1e-6 * topic.time_us
    names = tuple(f"{topic.name}.{f}" for f in fields)
    duration = float(time_s[-1] - time_s[0])
    rate = (len(time_s) - 1) / duration if duration > 0.0 else float("nan")
    return Stream(time_s, values, names, names, ("1",) * len(names), "motor", rate, len(time_s))


def _order(count: int, parameters: Mapping[str, float], notes: list[str]) -> tuple[int, ...]:
    """Our motor -> PX4's rotor."""
    if count != 4:
        notes.append(f"{count} rotors, in the order of the log")
        return tuple(range(count))
    where = [(parameters.get(f"CA_ROTOR{i}_PX"), parameters.get(f"CA_ROTOR{i}_PY")) for i in range(4)]
    if any(x is None or y is None for x, y in where):
        notes.append("the log holds no rotor geometry: motors are taken to be PX4's quadrotor X")
        return PX4_QUAD_X
    corners = {(x > 0, y > 0): i for i, (x, y) in enumerate(where) if x and y}  # x forward, y to the right
    if len(corners) != 4:
        notes.append("the rotors do not form an X: motors are in the order of the log")
        return tuple(range(4))
    return tuple(corners[c] for c in ((True, True), (False, True), (False, False), (True, False)))


def _commands(topics: Mapping[str, Sequence[Topic]], parameters: Mapping[str, float],
              notes: list[str]) -> Found | None:
    """The motors, in 0..1."""
    for topic in topics.get("actuator_motors", ()):
        fields = _rotors(topic, "control", parameters)
        values = topic.array(*fields)
        if values is not None:
            notes.append("motor commands are PX4's control of each motor before its thrust curve, 0..1")
            return topic, fields, np.where(np.isfinite(values), values, 0.0)  # not a number: motor stopped
    groups = topics.get("actuator_outputs", ())
    low, high = _pulse_range(parameters)
    found = [(topic, fields, topic.array(*fields)) for topic in groups for fields in _outputs(topic, parameters, low)]
    driven = [(topic, fields, values) for topic, fields, values in found
              if values is not None and np.ptp(np.nan_to_num(values), axis=0).any()]
    if not driven:
        if groups or topics.get("actuator_motors"):
            notes.append("no output ever drives a motor: the motors never started, and are not read")
        return None
    topic, fields, values = max(driven, key=lambda group: len(group[1]))
    if len(groups) > 1:
        notes.append(f"of {len(groups)} groups of outputs the one with {len(fields)} motors is read")
    highest = float(np.nanmax(values))
    if highest <= 1.0:
        return topic, fields, np.clip(np.nan_to_num(values), 0.0, 1.0)
    if not low < highest <= 1.2 * high or float(np.nanmin(values[values > 0.0])) < 0.5 * low:
        notes.append(f"{topic.name} holds neither pulses in microseconds nor 0..1: motor commands are not read")
        return None
    notes.append(f"motor commands are pulses, {low:g} us as 0 and {high:g} us as 1")
    return topic, fields, np.clip((np.nan_to_num(values) - low) / (high - low), 0.0, 1.0)


def _rotors(topic: Topic, field: str, parameters: Mapping[str, float]) -> list[str]:
    """Fields of the rotors there are: as many as the parameters say, else up to the last that ever ran."""
    names = [f"{field}[{i}]" for i in range(16) if f"{field}[{i}]" in topic.fields]
    stated = parameters.get("CA_ROTOR_COUNT")
    if stated is not None and 0 < stated <= len(names):
        return names[: int(stated)]
    ran = [i for i, n in enumerate(names) if np.nan_to_num(topic.fields[n]).any()]
    return names[: ran[-1] + 1] if ran else []


def _outputs(topic: Topic, parameters: Mapping[str, float], low: float) -> list[list[str]]:
    """Fields of one group of actuator_outputs that may drive the motors, in their order. First choice: the functions
    that the parameters give the outputs of a group. Second: outputs that move and are off for a while, which a servo
    never is. Else all that move."""
    found = []
    for group in OUTPUT_GROUPS:
        functions = {i: parameters.get(f"{group}_FUNC{i + 1}", 0) - FIRST_MOTOR_FUNCTION for i in range(16)}
        by_motor = [f"output[{i}]" for _, i in sorted((int(m), i) for i, m in functions.items() if 0 <= m < 12)]
        if by_motor:
            found.append([name for name in by_motor if name in topic.fields])
    if found:
        return found
    names = [f"output[{i}]" for i in range(16) if f"output[{i}]" in topic.fields]
    moving = [n for n in names if np.ptp(np.nan_to_num(topic.fields[n])) > 0.0]
    off = [n for n in moving if np.nan_to_num(topic.fields[n]).min() <= low]
    return [off if len(off) >= FEWEST_ROTORS else moving]


def _pulse_range(parameters: Mapping[str, float]) -> tuple[float, float]:
    low = next((parameters[n] for n in ("PWM_MAIN_MIN1", "PWM_MAIN_MIN", "PWM_MIN") if n in parameters), 1000.0)
    high = next((parameters[n] for n in ("PWM_MAIN_MAX1", "PWM_MAIN_MAX", "PWM_MAX") if n in parameters), 2000.0)
    return (float(low), float(high)) if 0.0 < low < high else (1000.0, 2000.0)


def _speeds(topics: Mapping[str, Sequence[Topic]]) -> Found | None:
    """Rotor speeds [rad/s] of esc_status, in PX4's order of rotors."""
    for topic in topics.get("esc_status", ()):
        found = []
        for i in range(8):
            rpm, function = topic.fields.get(f"esc[{i}].esc_rpm"), topic.fields.get(f"esc[{i}].actuator_function")
            if rpm is not None and rpm.any():
                stated = int(function[-1]) if function is not None else 0
                found.append((stated - FIRST_MOTOR_FUNCTION if stated >= FIRST_MOTOR_FUNCTION else i, i))
        fields = [f"esc[{i}].esc_rpm" for _, i in sorted(found)]
        values = topic.array(*fields)
        if values is not None:
            return topic, fields, np.abs(to_si(values, "rpm"))
    return None
