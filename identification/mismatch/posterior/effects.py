"""Effect of each term of the vocabulary on the residual: columns of force and torque, per unit of a direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nanobench_tools.physics import Model
from nanobench_tools.settings import setting

from ..diagnosis import ANOTHER
from ..space import LEVEL, MAPS, Space, fixed_mean, scales, space_of_other_map
from ..track import joined
from ..wrench import Wrench
from .thrust_exponent import Curve

STARTS: dict[str, tuple[float, ...]] = setting("posterior.effects.starts")
"""Of parameters that act far from linearly: sizes at which an effect is tried, in the parameter's unit."""
QUANTILES: tuple[float, ...] = setting("posterior.effects.quantiles")
"""Of the inputs: limits that are tried."""
FARTHEST = 3.0
"""Multiple of such a size: a secant is not valid beyond, nor on the other side."""
HALF = 0.5
"""Of such a size: step by which one parameter moves against the others."""
STEP = 1e-3
"""Fraction of a parameter's usual size: step for the slope of nearly linear parameters."""
DISTINCT = 3e-3
"""Relative singular value of a list of parameters, below which a direction does not differ from the others."""


@dataclass(frozen=True)
class Effect:
    """One reading of a term: k directions in which its parameters may move, from the simulator's values. ``force`` (N,
    3, k) m/s^2 and ``torque`` (M, 3, k) rad/s^2 per unit of a direction; ``moves`` {flat name: (k,)}: change of the
    parameter per unit; ``lower``, ``upper`` (k,) bounds of a direction. ``map_share``: the direction is the share of
    another thrust map. ``far``: it acts far from linearly, and its columns are exact after one unit of the first
    direction."""

    term: str
    force: np.ndarray
    torque: np.ndarray
    moves: dict[str, np.ndarray]
    lower: np.ndarray
    upper: np.ndarray
    map_share: bool = False
    far: bool = False

    @property
    def width(self) -> int:
        """Number of directions."""
        return int(self.force.shape[2])


Pair = tuple[np.ndarray, np.ndarray]
AMPLIFIES = frozenset(("inertia", "yaw_torque", *LEVEL, *MAPS))
"""Terms that multiply the moment of the motors."""


def _less(a: Pair, b: Pair, by: float = 1.0) -> Pair:
    return (a[0] - b[0]) / by, (a[1] - b[1]) / by


def _moved(model: Model, index: int, by: float) -> np.ndarray:
    values = model.values.copy()
    values[index] += by
    return values


def within_reach(wrench: Wrench, space: Space) -> Space:
    """The space with limits that no flight reaches lowered to the highest input.

    This changes no prediction, but far above the inputs a limit has no slope that leads to one that acts.
    """
    model = space.model
    changes = {name: reached for name in model.names if name.startswith("saturation.")
               if (reached := float(_reached(wrench, model, model.index(name)).max())) < model.parameters[name]}
    return replace(space, model=model.with_parameters(changes))


def without_limits(model: Model) -> Model:
    """The model with its limits at the highest values they may have."""
    limits = [i for i, name in enumerate(model.names) if name.startswith("saturation.")]
    return model.with_parameters({model.names[i]: float(model.upper[i]) for i in limits})


def effects_of(wrench: Wrench, space: Space, simulator: Model) -> list[Effect]:
    """All readings of all terms around ``space.model``: one of a nearly linear term, several of others."""
    model = space.model
    here, sizes = wrench.model(model), scales(model)
    found: list[Effect] = []

    def secant(index: int, by: float) -> Pair:
        return _less(wrench.model(model, _moved(model, index, by)), here, by)

    for term in space.terms:
        free = space.free(term)
        names = [model.names[i] for i in free]
        if term in MAPS:
            whole = secant(model.index("thrust_scale.s"), STEP)
            pairs = [secant(int(i), STEP * sizes[i]) for i in free]
            found += _of_map(term, pairs, names, whole, Curve.of(wrench, model, term))
        elif any(_place(n) in STARTS for n in names) or any(n.startswith("saturation.") for n in names):
            found += _far(wrench, model, term, free, here, term in space.believed)
        elif any(fixed_mean(model)[i] for i in free):
            found.append(_of_list(term, [secant(int(i), STEP) for i in free], names, model, free))
        else:
            keep = [int(i) for i in free if not _untold(model.names[i])]
            pairs = [secant(i, _step(model, i, STEP * sizes[i])) for i in keep]
            if pairs:
                lower, upper = _bounds(model)
                found.append(Effect(term, *_stacked(pairs), _own([model.names[i] for i in keep]),
                                    lower[keep] - model.values[keep], upper[keep] - model.values[keep]))
    other = space_of_other_map(simulator, wrench.battery_V, space.unasked)
    if other is not None:
        found.append(_other_map(wrench, model, other.model, here))
    found = [replace(e, torque=balanced(wrench, e.term, e.torque)) for e in found]
    return [e for e in (_seen(effect) for effect in found) if e is not None]


def balanced(wrench: Wrench, term: str, torque: np.ndarray) -> np.ndarray:
    """(M, ...) rad/s^2 of a term, without the constant of each flight if the term multiplies the moment.

    The true moment has a mean near zero, or the vehicle would spin up. A simulator with a wrong trim has another mean,
    and a term that multiplies it could only hide that.
    """
    if term not in AMPLIFIES or not len(torque):
        return torque
    flight, found = wrench.flight[wrench.torque_at], torque.copy()
    for one in np.unique(flight):
        found[flight == one] -= torque[flight == one].mean(0)
    return found


def _bounds(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """(P,) lower and upper bounds for a vehicle of this mass and these arms.

    A term's bounds of a fit are used if it states any, such as all mass at the motors, otherwise the physical ones.
    Those of weight and thrust exclude another vehicle. The simulator's value is always inside.
    """
    lower, upper = model.lower.copy(), model.upper.copy()
    for i, slot in enumerate(model.slots):
        if callable(slot.parameter.fitted):
            lower[i], upper[i] = slot.parameter.fitted(model.vehicle)[slot.element]
        if slot.term.name in LEVEL:
            lower[i], upper[i] = model.values[i] / ANOTHER, model.values[i] * ANOTHER
    return np.minimum(lower, model.values), np.maximum(upper, model.values)


def _place(name: str) -> str:
    return name.partition("[")[0]


def _step(model: Model, index: int, by: float) -> float:
    return by if model.values[index] + by <= model.upper[index] else -by


def _untold(name: str) -> bool:
    """Whether no flight can show this parameter.

    A steady vertical push is a mass or a thrust. Of the inertia about z, only its ratio to the moment of the rotors
    acts.
    """
    return name in ("force_world.f_N[2]", "wind.w_m_s[2]", "inertia.inertia_kg_m2[2]")


def _own(names: Sequence[str]) -> dict[str, np.ndarray]:
    return dict(zip(names, np.eye(len(names)), strict=True))


def _stacked(pairs: Sequence[Pair]) -> Pair:
    return np.stack([p[0] for p in pairs], -1), np.stack([p[1] for p in pairs], -1)


def _far(wrench: Wrench, model: Model, term: str, free: np.ndarray, here: Pair,
         believed: bool) -> list[Effect]:
    """One reading for every size at which the term is tried: the secant from the simulator's value to that size.

    If the simulator has the term already, the secants lead to zero and to its value plus each size. A factor moves
    with the quantity that it multiplies. Several parameters move together, and each against the others. Thrust that
    falls more slowly than it rises is too high wherever commands shake. So a wrong ratio of two time constants shows in
    the level of the thrust.
    """
    found = []
    asked = [int(i) for i in free if _place(model.names[i]) in STARTS or model.names[i].startswith("saturation.")]
    if term == "saturation":
        groups = [([index], np.array([size])) for index in asked for size in _limits(wrench, model, index)]
    else:
        sizes = np.array([STARTS[_place(model.names[i])] for i in asked]).T
        more = [0.0 * sizes[0], *(model.values[asked] + sizes)]
        idle = [i for i, slot in enumerate(model.slots)  # nothing acts while its factor is 0
                if slot.term.name == term and slot.parameter.in_product and model.values[i] == 0.0]
        usual = [float(np.atleast_1d(model.slots[i].parameter.typical)[0]) for i in idle]
        groups = [([*asked, *idle], np.array([*size, *usual])) for size in (more if believed else sizes)]
    for indices, to in groups:
        by = np.clip(to, model.lower[indices], model.upper[indices]) - model.values[indices]
        if np.allclose(by, 0.0, rtol=0.0, atol=1e-9):
            continue
        each = np.arange(len(indices))
        ways = [HALF * by * np.where(each == k, 1.0, -1.0) * (each < len(asked))
                for k in range(min(len(asked), len(indices)) - 1)]
        room = [(float(bound[i]) - float(model.values[i])) / change for i, change in zip(indices, by, strict=True)
                if change for bound in (model.lower, model.upper)]
        whole = _less(wrench.model(model, _with(model, indices, by)), here)
        pairs = [whole, *(_across(wrench, model, indices, by, way) for way in ways)]
        wide = np.full(len(ways), 1.0 / HALF)
        found.append(Effect(term, *_stacked(pairs),
                            {model.names[i]: np.array([by[k], *(way[k] for way in ways)])
                             for k, i in enumerate(indices)},
                            np.array([0.0, *-wide]), np.array([min([FARTHEST, *(r for r in room if r > 0.0)]), *wide]),
                            far=True))
    return found


def _with(model: Model, indices: Sequence[int], by: np.ndarray) -> np.ndarray:
    values = model.values.copy()
    values[indices] += by
    return values


def _across(wrench: Wrench, model: Model, indices: Sequence[int], by: np.ndarray, way: np.ndarray) -> Pair:
    """Effect of moving parameters by ``way`` (k,), from the middle of a secant ``by`` (k,)."""
    up, down = (wrench.model(model, _with(model, indices, 0.5 * (by + sign * way))) for sign in (1.0, -1.0))
    return _less(up, down)


def _limits(wrench: Wrench, model: Model, index: int) -> list[float]:
    """Values of a limit that is tried: some that flights reach, and one that they never reach where they do now."""
    most, reached = float(model.values[index]), _reached(wrench, model, index)
    sizes = [min(float(np.quantile(reached, q)), 0.99 * most) for q in QUANTILES]
    return list(dict.fromkeys(sizes)) + ([float(reached.max())] if most < float(reached.max()) else [])


def _reached(wrench: Wrench, model: Model, index: int) -> np.ndarray:
    """Inputs or thrusts that a limit would be compared with, calculated without the limit."""
    values = model.values.copy()
    values[index] = model.upper[index]
    judged = np.concatenate([t.counts for t in wrench.tracks])
    return np.asarray(joined(wrench.tracks, "motor")[judged].ravel() if model.names[index].endswith("u_max")
                      else wrench.thrust(model, values)[1][:, judged].ravel())


def _of_list(term: str, pairs: Sequence[Pair], names: Sequence[str], model: Model, free: np.ndarray) -> Effect:
    """Direction that disturbs only yaw, of a list whose mean is fixed by definition, such as the gains of motors.

    Along the other directions unequal motors turn a vehicle as its centre of mass does, and com_offset covers them.
    """
    spin = np.array(model.vehicle.spin)
    way = spin - spin.mean()
    way = (way / max(float(np.abs(way).max()), 1e-9))[:, None]
    force, torque = _stacked(pairs)
    room = float(np.min(np.minimum(model.upper[free] - model.values[free], model.values[free] - model.lower[free])))
    wide = np.array([max(room, 1e-3)])
    return Effect(term, force @ way, torque @ way, dict(zip(names, way, strict=True)), -wide, wide)


def _of_map(term: str, pairs: Sequence[Pair], names: Sequence[str], whole: Pair, curve: Curve) -> list[Effect]:
    """The shape of a thrust map: independent directions of its coefficients, without thrust as a whole (``whole``).
    None where a limit hides the map at all times."""
    force, torque = _stacked(pairs)
    flat, level = force.reshape(-1, force.shape[2]), whole[0].ravel()
    share = (level @ flat) / max(float(level @ level), 1e-30)
    _, size, right = np.linalg.svd(flat - np.outer(level, share), full_matrices=False)
    keep = size > max(DISTINCT * float(size[0]), 1e-12)
    if not keep.any():
        return []
    ways = right[keep].T / (size[keep] / np.sqrt(len(force)))
    lower, upper = np.array([curve.room(way) for way in ways.T]).T
    force, torque = (part @ ways - all_of_it[..., None] * (share @ ways)
                     for part, all_of_it in zip((force, torque), whole, strict=True))
    return [Effect(term, force, torque, dict(zip(names, ways, strict=True)), lower, upper)]


def _other_map(wrench: Wrench, model: Model, other: Model, here: Pair) -> Effect:
    """Thrust that follows the battery where the simulator's does not, or the reverse."""
    values = dict(zip(model.names, model.values, strict=True))
    there = other.with_parameters({n: values[n] for n in other.names
                                   if n in values and n.partition(".")[0] not in MAPS})
    name = next(t.name for t in other.terms if t.name in MAPS and t.name not in model)
    force, torque = _less(wrench.model(there), here)
    return Effect(name, force[..., None], torque[..., None], {}, np.array([-1.0]), np.array([2.0]), map_share=True)


def _seen(effect: Effect) -> Effect | None:
    """The effect without directions that do nothing in these flights; None if no direction remains."""
    size = np.sqrt((effect.force**2).sum(1).mean(0))
    if effect.torque.size:
        size = size + np.sqrt((effect.torque**2).sum(1).mean(0))
    span = np.minimum(effect.upper - effect.lower, 1e3)
    keep = np.isfinite(size) & (size * span > 1e-6)
    if not keep.any():
        return None
    return Effect(effect.term, effect.force[..., keep], effect.torque[..., keep],
                  {n: way[keep] for n, way in effect.moves.items()}, effect.lower[keep], effect.upper[keep],
                  effect.map_share, effect.far)
