"""An effect made of a term's expressions: blind cases of a term without an injector.

Such a case shows whether the search finds the term on flights of an engine that shares nothing else with it. It cannot
show a mistake in the term's equation, which flies and is fitted alike; an ``injector`` written anew can.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from nanobench_tools.errors import UsageError
from nanobench_tools.lookup import registry
from nanobench_tools.physics.ops import NUMPY
from nanobench_tools.physics.term import Parameter, Situation, Stage, Term

from ..airframe import POSITIONS_M, SPIN, Airframe
from .effect import SIZES, Air, Effect, Parameters, near

TIMES = {"small": 0.5, "medium": 1.0, "large": 2.0}
"""Of what is typical, where a term declares no sizes."""
SHARE = 0.01
"""Of its range, where a parameter has nothing typical but its neutral value."""
COMMANDED = (Stage.THRUST_LIMIT, Stage.THRUST_SCALE, Stage.MOTOR_GAIN)
BLOWN = (Stage.INFLOW, Stage.GROUND)
SOLID = (Stage.MASS, Stage.INERTIA, Stage.LAG)
"""Stages that change the airframe."""
FLOWN = (Stage.INPUT_LIMIT, Stage.WIND, Stage.BODY_FORCE, Stage.TORQUE, Stage.WORLD_FORCE, *COMMANDED, *BLOWN, *SOLID)
"""Stages that an engine can fly from the expression alone."""


def effect_of(term: Term) -> type[Effect] | None:
    """The injector a term declares, or one of its expressions; None where some act on internals of an engine (delay,
    thrust map, rotor speeds, tilt), or where it needs a term that no airframe has. Also None where a diagnosis never
    tests it. UsageError for an injector that is no effect."""
    if term.injector:
        found = registry.load("terms", term.injector)
        if not (isinstance(found, type) and issubclass(found, Effect)):
            raise UsageError(f"term {term.name}: injector {term.injector} is no Effect of identification.prove.effects")
        return found
    has = {known.name for known in Airframe().model().terms}
    if term.not_asked or not set(term.acts) <= set(FLOWN) or (term.needs and not has & set(term.needs)):
        return None
    hooks: dict[str, Callable[..., np.ndarray]] = {}
    if Stage.INPUT_LIMIT in term.acts:
        hooks["motor"] = lambda self, motor: self.run((Stage.INPUT_LIMIT,), motor)
    if set(COMMANDED) & set(term.acts):
        hooks["commanded"] = lambda self, thrust_N: self.run(COMMANDED, thrust_N)
    if Stage.WIND in term.acts:
        hooks["wind"] = lambda self: self.run((Stage.WIND,), np.zeros((3, self.many)))
    if set(BLOWN) & set(term.acts):
        hooks["thrust"] = lambda self, thrust_N, air: self.run(BLOWN, thrust_N, air)
    for hook, stage in (("force", Stage.BODY_FORCE), ("moment", Stage.TORQUE), ("push", Stage.WORLD_FORCE)):
        if stage in term.acts:
            hooks[hook] = lambda self, air, stage=stage: self.run((stage,), np.zeros_like(air.rate), air)
    about = {size: str(term.sizes.get(size, f"{TIMES[size]:g} times what is typical")) for size in SIZES}
    return type(f"EffectOf_{term.name}", (_OfTerm,), {"name": term.name, "of": term, "sizes": about, **hooks})


class _OfTerm(Effect):
    """``of``: the term."""

    of: Term
    wants = ("lateral", "vertical", "turning")

    @classmethod
    def draw(cls, size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        if size in cls.of.sizes:
            return {name: _near(rng, value) for name, value in cls.of.sizes[size].items()}
        commanded = [p for p in cls.of.parameters if not p.optional] or [cls.of.parameters[0]]
        factor = near(rng, TIMES[size])
        return {p.name: _sized(p, factor, airframe) for p in commanded}

    @classmethod
    def change(cls, airframe: Airframe, p: Parameters) -> Airframe:
        still, values = Situation(airframe.model().vehicle, 1.0), SimpleNamespace(**_all(cls.of, p))

        def run(stage: Stage, value: Any) -> Any:
            return cls.of.acts[stage](value, values, still, NUMPY) if stage in cls.of.acts else value

        up, down = run(Stage.LAG, (airframe.tau_up_s, airframe.tau_down_s))
        jx, jy, jz = (float(j) for j in run(Stage.INERTIA, list(airframe.inertia_kg_m2)))
        return replace(airframe, mass_kg=float(run(Stage.MASS, airframe.mass_kg)), tau_up_s=float(up),
                       tau_down_s=float(down), inertia_kg_m2=(jx, jy, jz))

    @classmethod
    def arrays(cls, p: Parameters, airframe: Airframe) -> Parameters | None:
        if set(cls.of.acts) <= set(SOLID):
            return None
        return {"mass_kg": airframe.mass_kg, "inertia_kg_m2": airframe.inertia_kg_m2,
                **{f"p.{name}": p[name] for name in _names(cls.of, p)}}

    @classmethod
    def term(cls, p: Parameters, airframe: Airframe) -> Parameters:
        return {name: p[name] for name in _names(cls.of, p)}

    @property
    def many(self) -> int:
        """Vehicles."""
        return int(self.a["mass_kg"].shape[-1])

    def run(self, stages: tuple[Stage, ...], value: np.ndarray, air: Air | None = None) -> np.ndarray:
        """The value (3 or 4, k) after some stages of the term."""
        vehicle = SimpleNamespace(mass_kg=self.a["mass_kg"], inertia_kg_m2=list(self.a["inertia_kg_m2"]), spin=SPIN,
                                  motor_positions_m=POSITIONS_M, rotors=len(SPIN))
        at = Situation(vehicle, 1.0)
        if air is not None:
            at = Situation(vehicle, 1.0, position_m=list(air.position), rate_rad_s=list(air.rate),
                           velocity_b=list(air.velocity_b), air_b=list(air.air_b), thrust_N=list(air.thrust),
                           rotor_rad_s=list(air.rotor), force_b=list(air.force_b),
                           gain=[1.0] * len(SPIN))
        values = SimpleNamespace(**_all(self.of, {
            name.removeprefix("p."): list(array) if array.ndim > 1 else array
            for name, array in self.a.items() if name.startswith("p.")}))
        found: Any = list(value)
        for stage in sorted(set(stages) & set(self.of.acts)):
            found = self.of.acts[stage](found, values, at, NUMPY)
        return np.stack([np.broadcast_to(component, value.shape[1:]) for component in found])


def _names(term: Term, p: Parameters) -> list[str]:
    return [parameter.name for parameter in term.parameters if parameter.name in p]


def _all(term: Term, p: Parameters) -> Parameters:
    """Every parameter by name, None where it is not given."""
    return {parameter.name: p.get(parameter.name) for parameter in term.parameters}


def _near(rng: np.random.Generator, value: Any) -> Any:
    return [near(rng, x) for x in value] if isinstance(value, (list, tuple)) else near(rng, value)


def _sized(parameter: Parameter, factor: float, airframe: Airframe) -> Any:
    """``factor`` times as far from the value without effect as what is typical."""
    many = parameter.length_on(len(SPIN))
    typical = parameter.typical if isinstance(parameter.typical, tuple) else (parameter.typical,) * (many or 1)
    rest = getattr(airframe, parameter.neutral) if isinstance(parameter.neutral, str) else parameter.neutral
    rests = rest if isinstance(rest, tuple) else ((0.0 if rest is None else rest),) * len(typical)

    def moved(usual: float, still: float) -> float:
        away = (usual - still) or SHARE * (parameter.upper - parameter.lower)
        return float(f"{min(max(still + factor * away, parameter.lower), parameter.upper):.4g}")

    values = [parameter.typical if parameter.in_product else moved(t, r) for t, r in zip(typical, rests, strict=True)]
    return values[0] if many == 0 else values
