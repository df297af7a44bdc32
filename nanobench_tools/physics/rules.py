"""What makes a vehicle or a list of terms impossible. Each rule yields problems that name the key."""

import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from numbers import Real
from typing import Any, NamedTuple

from .term import Parameter, Stage, Term
from .vehicle import BOUNDS, FEWEST, INPUTS, MOST, UNITS

Terms = Sequence[tuple[Term, Mapping[str, Any]]]


class Problem(NamedTuple):
    """``where``: ("vehicle", key) or (number of the term, key or None)."""

    where: tuple[Any, ...]
    found: str
    advice: str


def is_number(value: Any) -> bool:
    """A finite real number; True and False are none."""
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def nearest(name: str, known: Sequence[str]) -> str:
    """Advice for a name that is not known."""
    close = difflib.get_close_matches(name, known, n=1)
    return f"did you mean {close[0]}?" if close else f"known: {', '.join(known)}"


def _shape(value: Any) -> tuple[Any, ...] | None:
    """() of a number, (n,) or (n, m) of nested lists, None of anything else or ragged."""
    if isinstance(value, (list, tuple)):
        inner = {_shape(v) for v in value}
        only = inner.pop() if len(inner) == 1 else None
        return None if only is None else (len(value), *only)
    return () if isinstance(value, Real) and not isinstance(value, bool) else None


def _flat(value: Any) -> list[Any]:
    return [x for v in value for x in _flat(v)] if isinstance(value, (list, tuple)) else [value]


def _numbers(where: tuple[Any, ...], name: str, value: Any, shape: tuple[Any, ...], bounds: tuple[float, float],
             unit: str) -> Iterator[Problem]:
    if _shape(value) != shape:
        wanted = {0: "one number", 1: f"a list of {shape[0]} numbers" if shape else ""}.get(len(shape)) or \
            f"{shape[0]} lists of {shape[1]} numbers"
        yield Problem(where, f"{name} is {_short(value)}", f"give {wanted} [{unit}]")
        return
    for x in _flat(value):
        if not is_number(x):
            yield Problem(where, f"{name} is not finite", f"give a number [{unit}]")
            return
        if not bounds[0] <= x <= bounds[1]:
            heavy = unit == "kg" and x > bounds[1]
            yield Problem(where, f"{name} = {x:g} {unit} is outside {bounds[0]:g} to {bounds[1]:g}",
                          "is it in grams? give kg" if heavy else "check the value and its unit")
            return


def _short(value: Any) -> str:
    if isinstance(value, str):
        return f"text {value[:30]!r}"
    shape = _shape(value)
    if shape is None:
        return f"a {type(value).__name__} with something else than numbers" if isinstance(value, (list, tuple)) else \
            f"a {type(value).__name__}"
    return "one number" if shape == () else "a list of " + " by ".join(map(str, shape)) + " numbers"


def rotors_of(values: Mapping[str, Any]) -> int | None:
    """How many rotors the keys of a vehicle name, None where that is no vehicle."""
    shape = _shape(values.get("motor_positions_m"))
    return shape[0] if shape is not None and len(shape) == 2 and shape[1] == 2 and FEWEST <= shape[0] <= MOST else None


def vehicle_problems(values: Mapping[str, Any]) -> Iterator[Problem]:
    """Of the keys of a vehicle; all must be there."""
    for key in values:
        if key not in UNITS:
            yield Problem(("vehicle", key), f"unknown key {key}", nearest(key, list(UNITS)))
    for key in UNITS:
        if key not in values:
            yield Problem(("vehicle", None), f"{key} is missing", f"give {key} [{UNITS[key]}]")
    rotors = rotors_of(values)
    shapes = {"inertia_kg_m2": (3,), "motor_positions_m": (rotors, 2)}
    for key, bounds in BOUNDS.items():
        if key == "motor_positions_m" and key in values and rotors is None:
            yield Problem(("vehicle", key), f"{key} is {_short(values[key])}",
                          f"give {FEWEST} to {MOST} lists of 2 numbers [m], one for each motor")
        elif key in values:
            yield from _numbers(("vehicle", key), key, values[key], shapes.get(key, ()), bounds,
                                UNITS[key].split(",")[0])
    if "spin" in values and rotors is not None:
        signs = _shape(values["spin"])
        if signs is None or len(signs) != 1 or any(abs(s) != 1.0 for s in values["spin"]):
            yield Problem(("vehicle", "spin"), f"spin is not {rotors} signs",
                          f"give 1.0 or -1.0 for motors 1..{rotors}")
        elif signs != (rotors,):
            yield Problem(("vehicle", "motor_positions_m"), f"{rotors} motors have positions and {signs[0]} a spin",
                          f"give {signs[0]} lists of 2 numbers [m], or as many signs")
    if "input" in values and values["input"] not in INPUTS:
        yield Problem(("vehicle", "input"), f"input is {_short(values['input'])}",
                      f"give {' or '.join(INPUTS[:2])}, or {INPUTS[2]} for set-points in N")


def term_problems(number: int, term: Term, values: Mapping[str, Any], rotors: int) -> Iterator[Problem]:
    """Of the parameters of one term, on a vehicle of so many rotors; all must be there but the optional ones."""
    known = [p.name for p in term.parameters]
    for key in values:
        if key not in known:
            yield Problem((number, key), f"{term.name} has no parameter {key}", nearest(key, known))
    found = False
    for parameter in term.parameters:
        if parameter.name in values:
            for problem in _parameter_problems(number, term.name, parameter, values[parameter.name], rotors):
                found = True
                yield problem
        elif not parameter.optional:
            found = True
            yield Problem((number, None), f"{term.name} lacks {parameter.name}",
                          f"give {parameter.name} [{parameter.unit}]")
    wrong = term.check(values) if term.check and not found else None
    if wrong:
        yield Problem((number, known[0] if known[0] in values else None), f"{term.name}: {wrong[0]}", wrong[1])


def _parameter_problems(number: int, term: str, parameter: Parameter, value: Any,
                        rotors: int) -> Iterator[Problem]:
    length = parameter.length_on(rotors)
    shape: tuple[int, ...] = () if length == 0 else (length or 0,)
    if length is None:
        shape = _shape(value) or ()
        if len(shape) != 1 or shape[0] == 0:
            yield Problem((number, parameter.name), f"{term}.{parameter.name} is {_short(value)}",
                          f"give a list of numbers, [0] the coefficient of power 0 [{parameter.unit}]")
            return
    yield from _numbers((number, parameter.name), f"{term}.{parameter.name}", value, shape,
                        (parameter.lower, parameter.upper), parameter.unit)


def model_problems(kind: str, terms: Terms) -> Iterator[Problem]:
    """Of the terms together: ``kind`` is the vehicle's input, pwm, rpm or thrust."""
    names = [term.name for term, _ in terms]
    for number, (term, values) in enumerate(terms):
        if term.name in names[:number]:
            yield Problem((number, "name"), f"{term.name} stands twice", "leave one of them out")
        if term.needs and not set(term.needs) & set(names):
            yield Problem((number, "name"), f"{term.name} does nothing without {' or '.join(term.needs)}",
                          f"add {term.needs[0]} or leave {term.name} out")
        for parameter in term.parameters:
            if parameter.only_input not in ("", kind) and values.get(parameter.name) is not None:
                others = [p.name for p in term.parameters if p.only_input in ("", kind)]
                yield Problem((number, parameter.name), f"{parameter.name} is for input {parameter.only_input}, "
                              f"but input is {kind}", f"give {' or '.join(others)}" if others else
                              f"leave {term.name} out")
    maps = [n for n, (term, _) in enumerate(terms) if Stage.THRUST_MAP in term.acts]
    wanted = [n for n in maps if terms[n][0].input == ("rpm" if kind == "rpm" else "pwm")]
    for n in maps:
        if kind == "rpm" and n not in wanted:
            yield Problem((n, "name"), f"{names[n]} needs PWM, but input is rpm", "use thrust_rpm")
        if kind == "thrust" and n in wanted:
            yield Problem((n, "name"), f"{names[n]} needs PWM, but input is thrust, in N already", "leave it out")
    if kind == "thrust":
        return
    if not wanted:
        has = f"only {names[maps[0]]} " if maps else "no term "
        yield Problem(("vehicle", "input"), f"input is {kind}, but {has}turns it into thrust",
                      "add thrust_rpm" if kind == "rpm" else "add thrust_voltage or thrust_pwm")
    elif len(wanted) > 1:
        yield Problem((wanted[1], "name"), f"{names[wanted[0]]} and {names[wanted[1]]} both give the thrust",
                      "leave one of them out")
