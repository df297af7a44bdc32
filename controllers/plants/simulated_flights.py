"""Simulated flights of Task 2: a controller, references and an ensemble of plants; ``protocols.simulated`` scores
them.

Every vehicle hovers where its path begins, the path starts HOVER_S later, and SETTLED_S after that scoring begins. The
same plants, air and noise for every controller. Controllers that accept a vehicle get the identified one, never the
single plants. They accept ``model``, or ``vehicle``, ``thrust_scale`` and ``lag_s``.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from nanobench_tools.errors import NanobenchError, UsageError
from nanobench_tools.firmware import onboard
from nanobench_tools.lookup import registry
from nanobench_tools.methods import Controller, Reference
from nanobench_tools.physics import Model
from nanobench_tools.physics.simulator import loads
from nanobench_tools.practice.references import PathSpec
from nanobench_tools.protocols.simulated import (
    HOVER_S,
    SETTLED_S,
    Paths,
    Recovery,
    Runs,
    call_counts,
    recovery,
    sampled,
    score,
)

from ..geometric import slowest_lag_s
from .closed_loop import Flown, fly
from .ensemble import Ensemble, draw
from .kalman_senses import Onboard
from .off_nominal import BELIEVED_RADIO_S, CASES, mismatched
from .plant import share_of_firmware
from .radio_silence import Waiting, heard, silence
from .senses import TICK_S

SHORTEST_AFTER_S = 4.0
GUST_N, GUST_S, GUST_AT_S = 0.2, 0.25, 4.0
"""Sideways, for so long, so long after the start of the path: an impulse of 0.05 N s, 1.2 m/s."""
OUTAGE_S, OUTAGE_AT_S = 0.5, 4.0


def made(name: str, model: Model, radio_s: float = 0.0, gains: Mapping[str, float] | None = None) -> Controller:
    """A controller by name or ``module:Class``, told of the identified vehicle and of its radio if it can be."""
    kind = registry.load("controllers", name)
    if not isinstance(kind, type):
        ready: Controller = kind
        return ready
    known = _settings(kind)
    given: dict[str, Any] = {}
    if "model" in known:
        given["model"] = model
    if "vehicle" in known:
        inertia = model.values_of("inertia").get("inertia_kg_m2", model.vehicle.inertia_kg_m2)
        given["vehicle"] = model.on(inertia_kg_m2=inertia).vehicle
    if "thrust_scale" in known and model.vehicle.input == "pwm":
        given["thrust_scale"] = share_of_firmware(model)
    if "lag_s" in known:
        given["lag_s"] = slowest_lag_s(model)
    if "delay_s" in known and not getattr(kind, "on_board", False):
        named = float(model.values_of("command_delay")["delay_s"]) if "command_delay" in model else 0.0
        given["delay_s"] = named + radio_s
    if gains is not None:
        if not getattr(kind, "tunable", None) or "gains" not in known:
            raise UsageError(f"controller {name} has no gains to set; it flies as it is")
        given["gains"] = dict(gains)
    try:
        found: Controller = kind(**given)
        return found
    except NanobenchError:
        raise
    except Exception as error:  # anybody's code
        raise UsageError(f"controller {name}: making it raised {type(error).__name__}: {error}") from error


def _settings(kind: type) -> set[str]:
    """Names that a class takes when it is made, those it passes on to its bases included."""
    names: set[str] = set()
    for base in kind.__mro__:
        made_by = base.__dict__.get("__init__")
        if made_by is None or base is object:
            continue
        found = inspect.signature(made_by).parameters
        names |= set(found)
        if not any(p.kind is inspect.Parameter.VAR_KEYWORD for p in found.values()):
            break
    return names


def on_board(controller: Controller) -> bool:
    """Whether it runs on the vehicle: the radio then delays its references, otherwise its commands."""
    return isinstance(controller, onboard.Onboard) or bool(getattr(controller, "on_board", False))


class GivenReference:
    """Input of a controller at a tick, by its class of information; one lane per plant, paths one after another."""

    def __init__(self, paths: Paths, ensemble: Ensemble, controller: Controller) -> None:
        self._paths, self._plants = paths, len(ensemble)
        self._information = controller.information
        self._lead = float(getattr(controller, "lead_s", 0.0)) / TICK_S if self._information == "lead" else 0.0
        late = ensemble.radio_s / TICK_S if on_board(controller) else np.zeros(len(ensemble))
        self._groups = [(ticks, np.flatnonzero(late == ticks)) for ticks in np.unique(late)]

    def at(self, tick: int) -> Reference:
        p, v, a, j, yaw, turn = (x[0] for x in self._rows(np.array([tick + self._lead])))
        if self._information != "preview":
            return Reference(p, yaw, np.zeros_like(v), np.zeros_like(a))

        def ahead(seconds: np.ndarray) -> Reference:
            far = self._rows(tick + np.asarray(seconds, float) / TICK_S)
            return Reference(far[0], far[4], far[1], far[2], far[3], far[5])

        return Reference(p, yaw, v, a, j, turn, ahead)

    def _rows(self, at: np.ndarray) -> list[np.ndarray]:
        """All that the paths know at ticks (k,), between ticks linearly: arrays (k, lanes, ...)."""
        last = len(self._paths.time_s) - 1
        found = []
        for late, _ in self._groups:
            when = at - late
            low = np.clip(np.floor(when).astype(int), 0, last)
            share = np.clip(when - low, 0.0, 1.0)
            high = np.minimum(low + 1, last)
            found.append([x[low] + share.reshape(-1, *[1] * (x.ndim - 1)) * (x[high] - x[low])
                          for x in self._paths.all])
        if len(found) == 1:
            return [np.repeat(x, self._plants, axis=1) for x in found[0]]
        lanes = [np.empty((len(at), self._plants * x.shape[1], *x.shape[2:])) for x in found[0]]
        for (_, which), values in zip(self._groups, found, strict=True):
            for out, x in zip(lanes, values, strict=True):
                out.reshape(len(at), x.shape[1], self._plants, *x.shape[2:])[:, :, which] = x[:, :, None]
        return lanes


def flown(controller: Controller, paths: Paths, ensemble: Ensemble, *, gust: bool = False, outage: bool = False,
          silent: float = 0.0) -> Flown:
    """Paths x plants side by side, paths outermost; ``silent``: the share of the time in which the radio takes
    nothing."""
    crowd = ensemble.repeated(len(paths.specs))
    ticks = paths.ticks
    plant = crowd.plant(np.repeat(paths.all[0][0], len(ensemble), axis=0), late=not on_board(controller))
    begin = HOVER_S + OUTAGE_AT_S
    shut = silence(crowd.rngs(4), ticks, silent) if silent else None
    sensing = replace(crowd.sensing(((begin, begin + OUTAGE_S),) if outage else ()), shut=shut)
    senses = Onboard(plant, sensing, crowd.rngs(2))
    air = crowd.air_N(ticks)
    if gust:
        first = round((HOVER_S + GUST_AT_S) / TICK_S)
        air[first:first + round(GUST_S / TICK_S), 1] += GUST_N
    reference: Callable[[int], Reference] = GivenReference(paths, ensemble, controller).at
    if shut is not None and on_board(controller):
        reference = heard(reference, shut)
    elif shut is not None:
        controller = Waiting(controller, shut)
    return fly(plant, senses, controller, reference, ticks, push=lambda t: air[min(int(t / TICK_S + 0.5), ticks - 1)])


def fly_controller(name: str, specs: Sequence[PathSpec], simulator: str, plants: int, seed: int = 0,
                   draws: tuple[tuple[str, ...], list[list[float]]] | None = None, disturbed: bool = True,
                   radio_s: float = 0.0, wind_m_s: float = 0.0, silent: float = 0.0,
                   gains: Mapping[str, float] | None = None) -> Runs:
    """One controller on the ensemble. ``radio_s``: delay of the radio, which controllers know; ``silent``: share of
    the time in which it takes nothing; ``gains``: instead of the controller's defaults; the wind has a separate
    direction at every plant."""
    known = None if draws is None else (tuple(draws[0]), np.array(draws[1], float))
    ensemble = draw(simulator, plants, seed, known, radio_s).in_wind(wind_m_s)
    controller = made(name, loads(simulator), radio_s, gains)
    paths = Paths(tuple(specs))
    found = flown(controller, paths, ensemble, silent=silent)
    runs = score(found, paths, len(ensemble), controller.period_s)
    own = f"{controller.name} tuned" if gains is not None else controller.name
    counts = getattr(controller, "counts", None) or getattr(getattr(controller, "guard", None), "counts", {})
    bends: dict[str, list[Recovery]] = {}
    if disturbed and specs:
        first = Paths(tuple(specs[:1]))
        calm = found.position_m[:, :len(ensemble)]
        for what in ("gust", "outage"):
            bent = flown(controller, first, ensemble, gust=what == "gust", outage=what == "outage",
                         silent=silent)
            begin = HOVER_S + (GUST_AT_S if what == "gust" else OUTAGE_AT_S)
            bends[what] = recovery(bent.position_m, calm[:len(bent.position_m)], bent.time_s, begin)
    return Runs(own, controller.information, runs, sampled(own, found, paths, len(ensemble)), call_counts(found.call_s),
                {key: int(value) for key, value in dict(counts).items()}, bends.get("gust"), bends.get("outage"))


def fly_mismatched(name: str, specs: Sequence[PathSpec], simulator: str, seed: int = 0,
                   gains: Mapping[str, float] | None = None) -> Runs:
    """One controller in every case of ``mismatch``."""
    ensemble = mismatched(simulator, seed)
    controller = made(name, loads(simulator), BELIEVED_RADIO_S, gains)
    paths = Paths(tuple(specs))
    runs = score(flown(controller, paths, ensemble), paths, len(ensemble), controller.period_s)
    own = f"{controller.name} tuned" if gains is not None else controller.name
    return Runs(own, controller.information, runs, cases=list(CASES))


def settled_s(specs: Sequence[PathSpec]) -> float:
    """Shortest stretch that is scored; UsageError when a path is too short."""
    left = min(spec.duration_s for spec in specs) - SETTLED_S
    if left < SHORTEST_AFTER_S:
        raise UsageError(f"a path of {left + SETTLED_S:g} s is too short: {SETTLED_S:g} s settle and at least "
                         f"{SHORTEST_AFTER_S:g} s are scored")
    return left
