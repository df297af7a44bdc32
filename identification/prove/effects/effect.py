"""What an effect is: a cause with sizes, what it does to vehicles in the air, and how a simulator would say it.

Hooks are called by the engine only where a class has its own. They act on k vehicles at once; ``self.a`` holds the
parameters as arrays whose last axis runs over these vehicles. Nothing here, nor in the files of the effects, uses the
equations of ``nanobench_tools.physics.terms``: they are what is to be judged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from nanobench_tools.physics.model import Model

from ..airframe import Airframe

SIZES = ("small", "medium", "large")
HOOKS = ("motor", "commanded", "wind", "thrust", "force", "push", "moment", "advance")
Parameters = Mapping[str, Any]
"""Numbers, lists of numbers and words by name, as in the JSON of a case's sealed truth."""


@dataclass
class Air:
    """What k vehicles feel at one evaluation. Body axes unless stated.

    - velocity_b over ground, air_b against the air (3, k) m/s, rate (3, k) rad/s;
    - rotor (4, k) rad/s, thrust (4, k) N: the present thrust of the rotors;
    - force_b (3, k) N with thrust;
    - position, velocity in the world (3, k)."""

    position: np.ndarray
    velocity: np.ndarray
    velocity_b: np.ndarray
    air_b: np.ndarray
    rate: np.ndarray
    rotor: np.ndarray
    thrust: np.ndarray
    force_b: np.ndarray


class Effect:
    """One cause. Class attributes say what it is; an instance acts on the vehicles whose parameters it holds."""

    name: ClassVar[str]
    """The term of the vocabulary, or a new name when ``foreign``."""
    parameters: ClassVar[tuple[str, ...]] = ()
    """What of ``draw`` the term has, and the hooks take."""
    foreign: ClassVar[bool] = False
    sizes: ClassVar[Mapping[str, str]]
    """small, medium, large -> what that means physically."""
    wants: ClassVar[tuple[str, ...]] = ()
    """Flights in which it shows, see ``routes.WANTS``."""
    twins: ClassVar[tuple[str, ...]] = ()
    """Terms that cannot be distinguished from it in any free flight."""

    def __init__(self, arrays: Mapping[str, np.ndarray]) -> None:
        self.a = dict(arrays)

    # --- what it is ---------------------------------------------------------------------------------------------

    @staticmethod
    def draw(size: str, rng: np.random.Generator, airframe: Airframe) -> Parameters:
        """Parameters (floats, lists) of an effect of this size on this airframe."""
        raise NotImplementedError

    @staticmethod
    def change(airframe: Airframe, p: Parameters) -> Airframe:
        """The airframe that really flies, where the simulator believes in ``airframe``."""
        return airframe

    @classmethod
    def arrays(cls, p: Parameters, airframe: Airframe) -> Parameters | None:
        """Numbers or lists per vehicle for the hooks; None when the effect is a change of the airframe alone."""
        return {name: p[name] for name in cls.parameters} if any(map(cls.has, HOOKS)) else None

    @classmethod
    def term(cls, p: Parameters, airframe: Airframe) -> Parameters | None:
        """Values of the term ``name`` in a simulator that knows; None for what no term says."""
        return {name: p[name] for name in cls.parameters} or None

    @classmethod
    def informed(cls, model: Model, p: Parameters, airframe: Airframe) -> Model:
        """The simulator that knows of the effect; ``airframe`` is the one before the change."""
        values = cls.term(p, airframe)
        return model if values is None else model.with_term(cls.name, **values)

    @classmethod
    def concealed(cls, model: Model, p: Parameters, mean_V: float) -> Model:
        """An uninformed simulator without what it must not have: a term that is to be ``absent``.

        mean_V: battery voltage in the air over all flights."""
        return model.without(cls.name) if p.get("absent") else model

    @classmethod
    def acting(cls, parts: Sequence[tuple[Mapping[str, Any], int]]) -> Effect:
        """One instance for several cases: (arrays per vehicle, number of vehicles) each."""
        names = parts[0][0]
        made = {name: np.concatenate([np.repeat(np.asarray(a[name], float)[..., None], n, axis=-1)
                                      for a, n in parts], axis=-1) for name in names}
        return cls(made)

    # --- what it does -------------------------------------------------------------------------------------------

    def motor(self, motor: np.ndarray) -> np.ndarray:
        """PWM ratios sent (4, k) -> those that act. Called every 2 ms."""
        return motor

    def commanded(self, thrust_N: np.ndarray) -> np.ndarray:
        """Thrust the curve gives (4, k) -> thrust the rotors tend to. Called every 2 ms."""
        return thrust_N

    def wind(self) -> np.ndarray:
        """Velocity of the air in the world (3, k) m/s."""
        raise NotImplementedError

    def thrust(self, thrust_N: np.ndarray, air: Air) -> np.ndarray:
        """Thrust of the rotors (4, k) -> thrust that acts on the body."""
        return thrust_N

    def force(self, air: Air) -> np.ndarray:
        """Force in the body (3, k) N to be added."""
        raise NotImplementedError

    def push(self, air: Air) -> np.ndarray:
        """Force in the world (3, k) N to be added."""
        raise NotImplementedError

    def moment(self, air: Air) -> np.ndarray:
        """Moment in the body (3, k) N m to be added."""
        raise NotImplementedError

    def advance(self, dt_s: float, motor: np.ndarray) -> None:
        """Time goes on; ``motor`` (4, k) are the PWM ratios of this step."""

    @classmethod
    def has(cls, hook: str) -> bool:
        return getattr(cls, hook) is not getattr(Effect, hook)


def turned(rng: np.random.Generator, length: float, tilt: float = 0.0) -> list[float]:
    """A vector of this length, of any horizontal direction; up or down by at most ``tilt`` rad."""
    way, up = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-tilt, tilt)
    return [float(length * np.cos(up) * np.cos(way)), float(length * np.cos(up) * np.sin(way)),
            float(length * np.sin(up))]


def either(rng: np.random.Generator) -> float:
    """1 or -1."""
    return 1.0 if rng.uniform() < 0.5 else -1.0


def near(rng: np.random.Generator, value: float) -> float:
    """Within 10 % of the value, so that no two cases are alike."""
    return float(f"{value * rng.uniform(0.9, 1.1):.4g}")
