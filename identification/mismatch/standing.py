"""Reasons to reject an effect that explains much: a residual where it acts, or another cause that it replaces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nanobench_tools.physics import Model
from nanobench_tools.settings import number

from .fitting import Fit, Slopes, fit, force_left
from .leftover import Structure, structures
from .moments import Moments
from .naming import Hypothesis, Named, free_of, rested
from .space import LEVEL, MAPS, Space
from .wrench import CHANNELS

PLAIN = number("mismatch.standing.plain")
UNEXPLAINED = number("mismatch.standing.unexplained")
PREVAILS = number("mismatch.standing.prevails")
FOREIGN = number("mismatch.standing.foreign")
IN_BURSTS = number("mismatch.standing.in_bursts")
AGAINST = number("mismatch.standing.against")
ACTS = number("mismatch.standing.acts")
OVERSHADOWED = number("mismatch.standing.overshadowed")
LEAST_LEFT = number("mismatch.standing.least_left")
LEAST_FORCE_M_S2 = number("mismatch.standing.least_force_m_s2")
UPRIGHT = number("mismatch.standing.upright")
ABOUT_Z = number("mismatch.standing.about_z")
ACTS_SHARE = number("mismatch.standing.acts_share")
MOSTLY = number("mismatch.standing.mostly")
ALONG = number("mismatch.standing.along")


def excess(moments: Moments, left: np.ndarray) -> np.ndarray:
    """(6,) squared length of each channel's projection above that of a right simulator."""
    owner = moments.owner
    return np.array([max(moments.channels[c].spread * float(left[owner == c] @ left[owner == c])
                         - PLAIN * np.sum(owner == c), 0.0) for c in range(6)])


def hollow(moments: Moments, known: Slopes, named: Named, h: Hypothesis, after: np.ndarray, home: Space,
            found: Sequence[Structure]) -> str:
    """Why a hypothesis does not explain the residual; empty if it does."""
    without = _level_only(known, named, h, home) if h.term in MAPS else left_without(known, named, h, named.fit, home)
    taken = np.maximum(excess(moments, without) - excess(moments, named.fit.left), 0.0)
    here = taken > ACTS_SHARE * taken.sum()
    pushes = taken[:3].sum() > MOSTLY * taken.sum()  # an unmodelled force does not contradict a rotation
    acting = {CHANNELS[c].split()[1] for c in np.flatnonzero(here[:3])} if pushes else set()
    left = float(after[here].sum())
    if left > max(LEAST_LEFT, UNEXPLAINED * float(taken[here].sum())):
        where = ", ".join(np.array(CHANNELS)[here])
        return f"{h.term} explains {taken[here].sum():.0f} but leaves {left:.0f} in {where}"
    wrench = moments.wrench
    moved = wrench.model(named.fit.model)[0] - wrench.model(rested_in(named, [h.term], home))[0]
    acts = float(np.sqrt(np.mean(np.sum(moved**2, axis=1))))
    there = [s for s in found if acting & {a.removeprefix("force ") for a in s.axes}]
    if h.term == "force_world" and not h.own and _upright(named.fit.model):
        return f"{h.term} would be along world z alone, where mass, thrust and a cable that is lifted pull alike"
    if h.term == "inertia" and any(g.term == "yaw_torque" for g in named.accepted) and \
            taken[5] > ABOUT_Z * taken.sum():
        return "about z only the ratio of yaw_torque and inertia is seen: both at once weaken what else turns about z"
    uneven = [s for s in there if s.kind == "place"] if h.term == "force_world" else []
    if uneven:
        return f"{h.term} is the same everywhere, and there is {uneven[0].hint}"
    beside = [s for s in there if s.kind != "motion" and s.rms_m_s2 > FOREIGN * acts]
    if beside and not h.own:
        return f"{h.term} would explain a part only: there is {beside[0].hint}, too"
    strange = [s for s in there if s.gain > UNEXPLAINED * float(taken.sum())]
    return f"{h.term} would explain a part only: {strange[0].hint} is as large" if strange else ""


def _upright(model: Model) -> bool:
    x, y, z = np.abs(np.asarray(model.values_of("force_world")["f_N"], float))
    return bool(z > UPRIGHT * np.hypot(x, y))


def _vain(moments: Moments, known: Slopes, named: Named, h: Hypothesis, home: Space) -> str:
    """Why an effect is rejected after others that explained a part were removed."""
    after = excess(moments, named.fit.left)
    taken = np.maximum(excess(moments, left_without(known, named, h, named.fit, home)) - after, 0.0)
    turns = taken[3:].sum() > MOSTLY * taken.sum()
    here = taken > ACTS_SHARE * taken.sum()
    left, mine = float(after[here].sum()), float(taken[here].sum())
    if left <= max(LEAST_LEFT, (UNEXPLAINED if turns else PREVAILS) * mine):
        return ""
    return f"{h.term} explains {mine:.0f} and leaves {left:.0f} where it acts, without the rejected effects"


def in_vain(moments: Moments, known: Slopes, named: Named, home: Space) -> list[tuple[str, str]]:
    """(term, reason) of effects that explain less than they leave, among those kept after others were rejected."""
    return [(h.term, why) for h in named.accepted if (why := _vain(moments, known, named, h, home))]


def passing(moments: Moments, named: Named, h: Hypothesis, home: Space, bursts: Structure | None) -> str:
    """Why an effect that turns the vehicle only replaces another cause; empty if it does not. Either another effect
    turns the vehicle back, or the explained rotation (its inner product with the residual without it) lies in short
    losses."""
    wrench = moments.wrench

    def turned(other: Hypothesis) -> np.ndarray:
        return np.asarray(wrench.model(named.fit.model)[1] - wrench.model(rested_in(named, [other.term], home))[1])

    mine = turned(h)
    size = np.linalg.norm(mine)
    for other in named.accepted:
        against = turned(other)
        if other is not h and np.linalg.norm(mine + against) < AGAINST * min(size, np.linalg.norm(against)):
            return f"{h.term} turns the vehicle one way and {other.term} the other, as far"
    if bursts is None or bursts.rows is None:
        return ""
    inside = bursts.rows[wrench.torque_at]
    each = np.sum(mine * (wrench.measured[1] - wrench.model(rested_in(named, [h.term], home))[1]), axis=1)
    if not (each.sum() > 0.0 and size > ACTS * np.linalg.norm(wrench.residual(named.fit.model)[1])):
        return ""
    share = (each[inside].sum() / each.sum() - inside.mean()) / max(1.0 - inside.mean(), 1e-9)
    return f"most of what {h.term} turns is in {bursts.hint}" if share > IN_BURSTS else ""


def overshadowed(moments: Moments, known: Slopes, named: Named, home: Space) -> list[tuple[str, str]]:
    """(term, reason) of masked effects, among those kept after others were rejected.

    A masked effect acts along the axes of a force of place, time or period that is more than half as large.
    """
    found = [s for s in structures(moments, force_left(known, named.fit)) if s.kind in ("place", "time", "period")]
    gone = []
    for h in (h for h in named.accepted if not h.own) if found else ():
        moved = moments.wrench.model(named.fit.model)[0] - moments.wrench.model(rested_in(named, [h.term], home))[0]
        along = dict(zip("xyz", np.sqrt(np.mean(moved**2, axis=0)), strict=True))
        size = float(np.sqrt(sum(v**2 for v in along.values())))
        mine = {axis for axis, v in along.items() if v > ALONG * size} if size > LEAST_FORCE_M_S2 else set()
        beside = [s for s in found if mine & set(s.axes) and s.rms_m_s2 > OVERSHADOWED * size]
        if beside:
            gone.append((h.term, f"{h.term} would explain a part only: {beside[0].hint} is as large"))
    return gone


def _level_only(known: Slopes, named: Named, h: Hypothesis, home: Space) -> np.ndarray:
    """(K,) residual when only the level of the simulator's thrust curve may change: another curve has to explain
    more."""
    model = rested_in(named, [h.term], home)
    here = named.space if h.term in home.terms else home
    own = free_of(here, [g.term for g in named.accepted if g.own])
    fits = [fit(known, model, here.free(t), own=own) for t in LEVEL if t in here.terms]
    return min(fits, key=lambda f: f.loss).left if fits else left_without(known, named, h, named.fit, home)


def left_without(known: Slopes, named: Named, h: Hypothesis, fitted: Fit, home: Space) -> np.ndarray:
    """(K,) residual of a fit with a hypothesis at rest; per-flight values are unchanged."""
    here = named.space if h.term in fitted.model else home
    model = rested(fitted.model, [h.term], here, home)
    if h.own:
        return fit(known, model, [], own=named.own(h.term)).left
    return np.asarray(known.left(model) - fitted.beside)


def rested_in(named: Named, terms: Sequence[str], home: Space) -> Model:
    return rested(named.fit.model, terms, named.space, home)
