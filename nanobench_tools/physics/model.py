"""A model is a vehicle and a list of terms; its parameters are one flat vector with names, units and bounds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields, replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, UsageError
from ..lookup import registry
from . import rules
from .term import Parameter, Term
from .vehicle import Vehicle

POSITION, VELOCITY, QUATERNION, RATE, ROTOR = slice(0, 3), slice(3, 6), slice(6, 10), slice(10, 13), slice(13, None)
RIGID = 13
"""States without the rotors."""


def state_names(rotors: int) -> tuple[str, ...]:
    """Names of the 13 + rotors states. Position m and velocity m/s in the world, quaternion body to world, body rate
    rad/s, lagged thrust of each rotor N."""
    return (*(f"{name}_{axis}" for name in ("position", "velocity") for axis in "xyz"),
            *(f"quaternion_{axis}" for axis in "xyzw"), *(f"rate_{axis}" for axis in "xyz"),
            *(f"thrust_{motor}" for motor in range(1, rotors + 1)))


STATE = state_names(4)
"""Of a quadrotor."""

Values = dict[str, Any]
"""What a term holds: by parameter a float, or a tuple of its elements; which of both, its ``Parameter.length`` says."""


class Slot(NamedTuple):
    """One number of the flat vector: which term, parameter and element."""

    term: Term
    parameter: Parameter
    element: int

    @property
    def name(self) -> str:
        return f"{self.term.name}.{self.parameter.element_name(self.element)}"


def find_term(name: str) -> Term:
    """The registered term; raises UsageError for a name nobody registered."""
    found = registry.load("terms", name)
    if not isinstance(found, Term):
        raise UsageError(f"{name} is a {type(found).__name__} and no Term")
    return found


def _plain(value: Any) -> Any:
    """Arrays and lists -> tuples of floats, numbers -> float; anything else as it is, for the rules to refuse."""
    value = value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value
    if isinstance(value, (list, tuple)):
        return tuple(_plain(v) for v in value)
    return float(value) if rules.is_number(value) else value


class Model:
    """Immutable. ``terms`` maps a term's name to its parameters, such as {"yaw_torque": {"k_m": 0.006}}; the order is
    kept, but evaluation follows the stages.

    Attributes: vehicle; terms (tuple of Term); values, lower, upper (P,) floats and names, units (P,) of the flat
    parameter vector. Raises InputError for impossible values and lists of terms.
    """

    def __init__(self, vehicle: Vehicle, terms: Mapping[str, Mapping[str, Any]]) -> None:
        self.vehicle = replace(vehicle, **{f.name: _plain(getattr(vehicle, f.name)) for f in fields(vehicle)})
        given = [(find_term(name), {k: _plain(v) for k, v in values.items()}) for name, values in terms.items()]
        for problem in _problems(self.vehicle, given):
            place, key = problem.where
            term = f"term {given[place][0].name}" if isinstance(place, int) else place
            raise InputError(f"model: {term}" + (f", {key}" if key else ""), problem.found, problem.advice)
        self.terms = tuple(term for term, _ in given)
        self.slots = tuple(Slot(term, p, i) for term, values in given for p in term.parameters if p.name in values
                           for i in range(1 if p.length == 0 else len(values[p.name])))
        numbers = [x for term, values in given for p in term.parameters if p.name in values
                   for x in ((values[p.name],) if p.length == 0 else values[p.name])]
        self.values = np.array(numbers, float)
        self._fix()

    def _fix(self) -> None:
        self.values.flags.writeable = False
        self.names = tuple(slot.name for slot in self.slots)
        self.units = tuple(slot.parameter.unit_of(slot.element) for slot in self.slots)
        self.lower = np.array([slot.parameter.lower for slot in self.slots])
        self.upper = np.array([slot.parameter.upper for slot in self.slots])

    def __contains__(self, name: str) -> bool:
        return any(term.name == name for term in self.terms)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)

    def __repr__(self) -> str:
        return f"Model({', '.join(f'{n}={v:.6g}' for n, v in zip(self.names, self.values, strict=True))})"

    @property
    def structure(self) -> tuple[Any, ...]:
        """All that shapes the equations and is not in the flat vector; equal structures share compiled functions."""
        return (self.vehicle, self.names)

    @property
    def key(self) -> tuple[Any, ...]:
        return (*self.structure, self.values.tobytes())

    @property
    def parameters(self) -> dict[str, float]:
        """Value by flat name."""
        return dict(zip(self.names, self.values.tolist(), strict=True))

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of one row of inputs; a model with command_delay also needs the row before and the shift in rows."""
        unit = {"pwm": "ratio", "rpm": "rad_s", "thrust": "N"}[self.vehicle.input]
        motors = range(1, self.rotors + 1)
        now = (*(f"motor_{unit}_{i}" for i in motors), "battery_V")
        before = (*(f"before_{unit}_{i}" for i in motors), "whole_rows") if "command_delay" in self else ()
        return now + before

    @property
    def rotors(self) -> int:
        return self.vehicle.rotors

    @property
    def state(self) -> tuple[str, ...]:
        """Names of the states, see ``state_names``."""
        return state_names(self.rotors)

    def index(self, name: str) -> int:
        """Place of a flat name; raises KeyError."""
        try:
            return self.names.index(name)
        except ValueError:
            raise KeyError(f"no parameter {name}; {rules.nearest(name, self.names)}") from None

    def values_of(self, term: str) -> Values:
        """Of one term."""
        found: dict[str, tuple[float, ...]] = {}
        scalars = {slot.parameter.name for slot in self.slots if slot.term.name == term and slot.parameter.length == 0}
        for slot, value in zip(self.slots, self.values.tolist(), strict=True):
            if slot.term.name == term:
                found[slot.parameter.name] = (*found.get(slot.parameter.name, ()), value)
        return {name: value[0] if name in scalars else value for name, value in found.items()}

    def as_dict(self) -> dict[str, Values]:
        """In the order of the terms."""
        return {term.name: self.values_of(term.name) for term in self.terms}

    def with_values(self, values: Sequence[float] | np.ndarray) -> Model:
        """The same structure at another flat vector (P,). Bounds are not checked: a fit may look beyond them."""
        vector = np.array(values, float)
        if vector.shape != self.values.shape:
            raise ValueError(f"{len(self.names)} parameters, got an array of shape {vector.shape}")
        other = object.__new__(Model)
        other.vehicle, other.terms, other.slots, other.values = self.vehicle, self.terms, self.slots, vector
        other._fix()
        return other

    def with_parameters(self, changes: Mapping[str, float]) -> Model:
        """Some parameters changed, by flat name; raises KeyError for a name it does not have."""
        vector = self.values.copy()
        for name, value in changes.items():
            vector[self.index(name)] = value
        return self.with_values(vector)

    def with_term(self, name: str, **values: Any) -> Model:
        """One term added or replaced."""
        return Model(self.vehicle, {**self.as_dict(), name: values})

    def without(self, *names: str) -> Model:
        """Some terms left out."""
        return Model(self.vehicle, {name: values for name, values in self.as_dict().items() if name not in names})

    def on(self, **changes: Any) -> Model:
        """The same terms on a vehicle with some fields changed."""
        return Model(replace(self.vehicle, **changes), self.as_dict())

    def check(self) -> None:
        """Raises InputError if a value has left its physical bounds (``with_values`` does not look)."""
        Model(self.vehicle, self.as_dict())

    def bind(self, vector: Iterable[Any]) -> dict[str, SimpleNamespace]:
        """Components of the flat vector (floats, arrays, symbols) -> {term: its parameters by attribute}."""
        bound = {term.name: SimpleNamespace(**{p.name: None for p in term.parameters}) for term in self.terms}
        for slot, component in zip(self.slots, vector, strict=True):
            place = bound[slot.term.name]
            if slot.parameter.length == 0:
                setattr(place, slot.parameter.name, component)
            else:
                setattr(place, slot.parameter.name, [*(getattr(place, slot.parameter.name) or []), component])
        return bound


def typical(term: Term, rotors: int) -> Values:
    """Where a fit of a term starts: its typical values, but for optional parameters."""
    found: Values = {}
    for parameter in term.parameters:
        if not parameter.optional:
            many = parameter.length_on(rotors) or 0
            found[parameter.name] = parameter.typical if not many or isinstance(parameter.typical, tuple) else (
                parameter.typical,) * many
    return found


def neutral(term: Term, vehicle: Vehicle) -> Values | None:
    """Values at which the term has no effect, or None without any (a thrust map). Optional parameters are given too."""
    found: Values = {}
    for parameter in term.parameters:
        value = parameter.neutral
        if value is None:
            return None
        if isinstance(value, str):
            found[parameter.name] = getattr(vehicle, value)
        else:
            many = parameter.length_on(vehicle.rotors)
            found[parameter.name] = value if many == 0 else (value,) * (many or 1)
    return found


def _problems(vehicle: Vehicle, terms: rules.Terms) -> Iterable[rules.Problem]:
    yield from rules.vehicle_problems(asdict(vehicle))
    for number, (term, values) in enumerate(terms):
        yield from rules.term_problems(number, term, values, vehicle.rotors)
    yield from rules.model_problems(vehicle.input, terms)
