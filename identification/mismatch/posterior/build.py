"""From recordings and a simulator to the evidence: residual, effects, background, whitened Gram matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from nanobench_tools.physics import Model
from nanobench_tools.physics.model import Slot

from ..space import MAPS, Space
from ..wrench import Wrench
from .arm_unit import arms
from .background import MOMENTS, SHAKE, SWUNG, TRACKED, Background, background_of, reach_of, rms, turning_size
from .effects import Effect, effects_of, within_reach, without_limits
from .gain_error import gain_error
from .rows import Products, Rows, Seen, rows_of
from .set_evidence import MEANS, Evidence
from .thrust_spread import thrust_spread

LEAST_SEEN = 0.01
"""Of a column that the instruments do not see at all, which has no weight in the evidence."""


@dataclass(frozen=True)
class Case:
    """Data on which sets of effects are judged: the wrench, the space around the simulator, and its columns."""

    wrench: Wrench
    space: Space
    simulator: Model
    effects: Sequence[Effect]
    background: Background
    rows: Rows
    beside_all: Seen
    evidence: Evidence
    flights: np.ndarray
    grams: Products
    arm: np.ndarray
    _factors: dict[tuple[int, ...], np.ndarray] = field(default_factory=dict, repr=False)

    def across(self, asked: Seen) -> Products:
        """Inner products of the k columns ``asked`` with the nuisance columns (term errors, background) and with
        themselves."""
        return self.rows.products((self.beside_all, asked), asked)

    def beside(self, across: Products, chosen: tuple[int, ...], without: Sequence[int] = ()) -> np.ndarray:
        """(k, k) inner products of the columns of ``across``, with the nuisance columns integrated out; ``without``
        some flights."""
        lifted = self.evidence.takes_lift(chosen)
        keep, key = ~np.isin(self.flights, list(without)), (lifted, *sorted(without))
        if key not in self._factors:
            self._factors[key] = self.evidence.factor_beside(self.grams.of(keep)[:-1, :-1], lifted)
        mine, many = across.of(keep), self.beside_all.many
        return self.evidence.beside(self._factors[key], mine[:many], mine[many:], lifted)

    @cached_property
    def tracked_m(self) -> np.ndarray:
        """(3,) m: from the centre of mass to the tracked point, body, without any effect."""
        return np.asarray(self._tracked_unit_m * self.evidence.everything(())[self._swung])

    @property
    def tracked_sd_m(self) -> np.ndarray:
        """(3,) m: its standard deviation by noise alone; groups of flights of one vehicle differ by a millimetre."""
        return np.asarray(self._tracked_unit_m * self.evidence.sds(self._swung))

    @property
    def _tracked_unit_m(self) -> float:
        return TRACKED * reach_of(self.space.model)

    @property
    def _swung(self) -> np.ndarray:
        return np.concatenate([np.zeros(self.evidence.P, bool), self.background.group == SWUNG])

    def give_up(self, terms: set[str]) -> None:
        """As ``Evidence.give_up``."""
        self.evidence.give_up(terms)
        self._factors.clear()


def build(wrench: Wrench, space: Space, simulator: Model) -> Case:
    """Compute everything that does not depend on the set of effects."""
    space = within_reach(wrench, space)
    arm = arms(simulator)
    effects = effects_of(wrench, space, simulator)
    background = background_of(wrench, space, effects, arm)
    owner = np.repeat(np.arange(len(effects)), [e.width for e in effects])
    force = np.concatenate([e.force for e in effects], 2)
    torque = np.concatenate([e.torque for e in effects], 2)
    pushes, turns = rms(force), turning_size(torque, arm)
    unit = np.hypot(pushes, turns)
    force, torque = force / unit, torque / unit
    lower, upper = (np.concatenate([getattr(e, side) for e in effects]) for side in ("lower", "upper"))
    residual = wrench.residual(space.model)
    prior = np.concatenate([np.minimum(1.0, np.maximum(np.abs(lower), np.abs(upper)) * unit),
                            [MEANS.get(g, 1.0) for g in background.group.tolist()]])
    forces, torques = np.concatenate([force, background.force], 2), np.concatenate([torque, background.torque], 2)
    shaking = residual, forces, torques
    if "saturation" in space.believed:  # a limit that acts hides how logged commands shake; so does less of that limit
        lifting = np.append([effects[i].term == "saturation" for i in owner], np.zeros(len(background.group), bool))
        shaking = wrench.residual(without_limits(space.model)), forces * ~lifting, torques * ~lifting
    rows = rows_of(wrench, *shaking, prior)
    beside, left = rows.of(forces, torques), rows.of(residual[0][..., None], residual[1][..., None])
    numbers = np.unique(wrench.flight[wrench.force_at])
    whole = beside + left
    grams = rows.products((whole,), whole)
    work = np.stack([part[:, k].T @ part[:, k] / max(len(part), 1)
                     for part in (force, torque * arm[None, :, None]) for k in range(3)])
    evidence = Evidence(effects, background, grams.of(np.ones(len(numbers), bool)), owner, unit, lower * unit,
                        upper * unit, _believed(wrench, space, effects, unit, arm), work, _varying(wrench, torque),
                        _seen(wrench, rows, torque, background), arm, len(numbers),
                        _gain_errors(wrench, residual[1], rows, work[3:]), thrust_spread(simulator.vehicle))
    return Case(wrench, space, simulator, effects, background, rows, beside, evidence, numbers, grams, arm)


def _varying(wrench: Wrench, torque: np.ndarray) -> np.ndarray:
    """(6, P) share of the columns that no per-flight constant explains. It is 1 for forces: a tilt makes them vary."""
    flight = wrench.flight[wrench.torque_at]
    constant = sum(((flight == f).sum() * torque[flight == f].mean(0) ** 2 for f in np.unique(flight)),
                   np.zeros(torque.shape[1:]))
    varying = 1.0 - constant / np.maximum((torque**2).sum(0), 1e-12)
    return np.concatenate([np.ones(torque.shape[1:]), np.clip(varying, 0.0, 1.0)])


def _seen(wrench: Wrench, rows: Rows, torque: np.ndarray, background: Background) -> np.ndarray:
    """(6, P) share of the varying part of the columns that the instruments see, over that of a discrepancy.

    From LEAST_SEEN to 1; 1 of forces.

    To imitate a discrepancy, the error of a column that they hardly see has to be larger by the root of this.
    """
    flight = wrench.flight[wrench.torque_at]
    mine = np.isin(background.group, MOMENTS)
    both = np.concatenate([torque, background.torque[..., mine]], 2)
    varies = both - sum(((flight == f)[:, None, None] * both[flight == f].mean(0) for f in np.unique(flight)),
                        np.zeros_like(both))
    seen, whole = rows.seen_of(varies)
    many = torque.shape[2]
    usual = seen[:, many:].sum(1) / np.maximum(whole[:, many:].sum(1), 1e-12)
    share = seen[:, :many] / np.maximum(whole[:, :many], 1e-12) / np.maximum(usual, 1e-12)[:, None]
    share[whole[:, :many] <= 0.0] = 1.0
    return np.concatenate([np.ones(share.shape), np.clip(share, LEAST_SEEN, 1.0)])


def _gain_errors(wrench: Wrench, residual: np.ndarray, rows: Rows, work: np.ndarray) -> np.ndarray:
    """(P,) share by which a gain from command to moment may be off, by column; work (3, P, P): of its moments.

    Set-points are instruments: about their axes, gains are as certain as logging allows. About the others commands are
    as reliable as the vehicle follows them.
    """
    flight, measured = wrench.flight[wrench.torque_at], wrench.measured[1]
    by_axis = np.full(3, SHAKE)
    for axis in set(range(3)) - rows.set_point_axes if len(measured) else ():
        by_axis[axis] = max(SHAKE, gain_error((measured - residual)[:, axis], measured[:, axis], flight))
    size = work.diagonal(axis1=1, axis2=2)
    return np.asarray(np.sqrt(by_axis**2 @ size / np.maximum(size.sum(0), 1e-12)))


def _believed(wrench: Wrench, space: Space, effects: Sequence[Effect], unit: np.ndarray,
              arm: np.ndarray) -> np.ndarray:
    """(P,) m/s^2 of the simulator's own terms along each direction, relative to the value where they have no effect.

    0 for terms that the simulator does not have, and for thrust maps, which cause everything. For an inertia: the
    moment that turns the vehicle.
    """
    model = space.model
    slots = {slot.name: slot for slot in model.slots}
    here, found, done = wrench.model(model), list[float](), dict[tuple[float, ...], float]()
    for effect in effects:
        for k in range(effect.width):
            moved = [n for n, way in effect.moves.items() if way[k]]
            size = 0.0
            if effect.term == "inertia":
                whole = sum(model.parameters[n] * float(effect.moves[n][k]) for n in moved)
                size = float(unit[len(found)]) * abs(whole)
            elif effect.term in space.believed and effect.term not in MAPS and moved:
                rest = {n: rest_of(slots[n], model) for n in moved}
                values = model.values.copy()
                values[[model.index(n) for n in moved]] = list(rest.values())
                key = tuple(values)
                if key not in done:
                    there = wrench.model(model, values)
                    done[key] = float(np.hypot(rms(there[0] - here[0]), turning_size(there[1] - here[1], arm)))
                size = done[key]
            found.append(size)
    return np.array(found)


def rest_of(slot: Slot, model: Model) -> float:
    """Value of a parameter without effect."""
    neutral = slot.parameter.neutral
    if isinstance(neutral, str):
        value = getattr(model.vehicle, neutral)
        return float(value[slot.element] if isinstance(value, tuple) else value)
    return float(neutral or 0.0)
