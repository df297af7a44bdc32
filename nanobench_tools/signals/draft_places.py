"""Units of positions, velocities and accelerations of a drafted map, which the numbers show or leave open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..settings import number
from ..sources.tum_layout import NORM_TOLERANCE
from ..units import factor
from . import column_evidence as evidence
from .draft import QUATERNION, TIME, Draft, Key
from .flown_axes import UPRIGHT, unit_by_tilt

TILT_WITHIN = number("audit.draft_places.tilt_within")
METRIC = ("m", "cm", "mm")
LENGTHS = (*METRIC, "in", "ft")
"""Inches and feet are considered where metres are impossible, or the tilt shows the unit."""
PATHS = (("mocap", ("px", "py", "pz")), ("estimator", ("x", "y", "z")))


def judge_places(draft: Draft, values: Mapping[str, np.ndarray], time_s: np.ndarray) -> None:
    """Units that a path and its rate show, and questions where no vehicle flies so."""
    for stream, names in PATHS:
        _position(draft, stream, names, values, time_s)
        _beyond(draft, stream, ("vx", "vy", "vz"), evidence.FASTEST_M_S, "m/s", values)
    _beyond(draft, "estimator_acc", ("ax", "ay", "az"), evidence.MOST_M_S2, "m/s^2", values)
    _place_wanted(draft, values)


def _position(draft: Draft, stream: str, names: tuple[str, ...], values: Mapping[str, np.ndarray],
              time_s: np.ndarray) -> None:
    keys = draft.columns(stream, names)
    speeds = draft.columns(stream, tuple(f"v{n[-1]}" for n in names))
    if not keys:
        if draft.open(speeds):
            draft.confirm(speeds, "nothing shows it")
        return
    pairs = [(k, s) for k in keys for s in speeds if k[1][-1] == s[1][-1]]
    agree = False
    if pairs:
        rate = evidence.rate_of(time_s, draft.si([k for k, _ in pairs], values))
        found = evidence.ratio(evidence.smooth(draft.si([s for _, s in pairs], values)), rate)
        agree = found.agrees(1.0)
        if agree:
            draft.confirm([*keys, *speeds], "velocity and position agree")
        elif found.known:
            shown = ", ".join(f"{r:.3g}" for r in found.known)
            draft.ask([*keys, *speeds],
                      f"the velocity is {shown} times the rate of the position; write the unit of each")
            return
    still, fast = draft.open(keys), draft.open(speeds)
    both = [*keys, *fast]  # agreement shows the ratio of their units alone
    cells = np.stack([values[draft.mapped[k].column] for k in keys], axis=1)
    each = evidence.spans(cells)
    moving = each[each > 0.0]
    scaled = each * [factor(draft.mapped[k].unit) for k in keys]
    factors = {unit: factor(unit) for unit in METRIC}
    if len(moving) and still:
        by_tilt = _by_tilt(draft, stream, values, time_s) if len(still) == len(keys) == len(names) else []
        fits = by_tilt or evidence.lengths_that_fit(cells, time_s, factors)
        if "m" not in fits and not by_tilt:
            fits = evidence.lengths_that_fit(cells, time_s, {u: factor(u) for u in LENGTHS})
        alone = [evidence.lengths_that_fit(cells[:, [k]], time_s, factors) or list(factors) for k in range(len(keys))]
        if not set.intersection(*map(set, alone)):
            draft.ask(both, "they are not of one size: are they all in one unit? write the unit of each")
        elif by_tilt == ["ft"]:
            draft.ask(both, "ft by the tilt, or m with a time that is wrong by 1.8? write unit = \"ft\", or mend the "
                      "time")
        elif len(fits) > 1:
            rates = f" and \"{fits[-1]}/s\"" if fast else ""
            draft.ask(both, f"{', '.join(fits[:-1])} or {fits[-1]}{', and the same per second' * bool(fast)}? Each is "
                      f"possible; write unit = \"{fits[-1]}\"{rates}, or another, at each")
        elif fits and (by_tilt or fits != ["m"]):
            draft.set_unit(still, fits[0], "the path speeds up as its tilt demands" if by_tilt else
                           f"they span {moving.max():.4g}")
            if by_tilt and not agree and not evidence.alike(cells):
                draft.mapped[keys[2]] = replace(draft.mapped[keys[2]], status="assumed", why="as the other axes")
            if agree:
                draft.set_unit(fast, f"{fits[0]}/s", "velocity and position agree")
            elif fast and fits != ["m"]:
                draft.ask(fast, f"the position is in {fits[0]}; is this in {fits[0]}/s? write the unit of each")
        elif not fits and moving.max() > evidence.SMALLEST_FLIGHT_M:
            draft.ask(both, f"no vehicle flies such a path in m, cm or mm with the time in {draft.mapped[TIME].unit}; "
                      "write the unit of each")
    elif len(moving) and evidence.no_vehicle_flies(draft.si(keys, values), time_s):
        draft.ask([*keys, *speeds] if agree else keys,
                  f"they span {scaled.max():.4g} m, faster than any vehicle; which unit is it? write it at each")
    elif len(moving) and (by_tilt := _by_tilt(draft, stream, values, time_s) if len(keys) == len(names) else []) and \
            by_tilt != [draft.mapped[keys[0]].unit]:
        draft.ask([*keys, *speeds] if agree else keys,
                  f"the path speeds up as its tilt demands in {by_tilt[0]}, not in {draft.mapped[keys[0]].unit}; write "
                  "the unit of each, or mend the time")
    elif len(moving) and _stated_too_small(draft, keys, values):
        draft.ask([*keys, *speeds] if agree else keys,
                  f"whole mm as {draft.mapped[keys[0]].why} has them, or m? They are no whole numbers and span "
                  f"{moving.max():.3g}; write the unit of each")


def _by_tilt(draft: Draft, stream: str, values: Mapping[str, np.ndarray], time_s: np.ndarray) -> list[str]:
    """The unit in which the accelerations of a path are those of its tilt, as a list; empty where nothing shows it."""
    turn = draft.columns("mocap" if stream == "mocap" else "attitude_qw", QUATERNION)
    if len(turn) < len(QUATERNION):
        return []
    position, quaternion = (np.stack([values[draft.mapped[k].column] for k in keys], axis=1)
                            for keys in (draft.columns(stream, dict(PATHS)[stream]), turn))
    rows = np.isfinite(position).all(axis=1) & (np.abs(np.linalg.norm(quaternion, axis=1) - 1.0) < NORM_TOLERANCE)
    rows &= np.isfinite(time_s) & (np.diff(time_s, prepend=-np.inf) > 0.0)
    shown = unit_by_tilt(time_s[rows], position[rows], quaternion[rows], UPRIGHT) if rows.any() else None
    fits = [u for u in LENGTHS if shown and abs(np.log(shown / factor(u))) < np.log(TILT_WITHIN)]
    return fits if len(fits) == 1 else []


def _stated_too_small(draft: Draft, keys: list[Key], values: Mapping[str, np.ndarray]) -> bool:
    """Whether positions that an ecosystem has in whole mm are none: broken numbers, a flight in m and none in mm."""
    cells = np.stack([values[draft.mapped[k].column] for k in keys], axis=1)
    known = cells[np.isfinite(cells).all(axis=1)]
    span = float(np.max(evidence.spans(cells)))
    return bool(all(draft.mapped[k].unit == "mm" and draft.mapped[k].why not in ("", "stated") for k in keys)
                and np.any(known != np.round(known)) and evidence.SMALLEST_FLIGHT_M < span < evidence.LARGEST_FLIGHT_M
                and span * factor("mm") < evidence.SMALLEST_FLIGHT_M)


def _beyond(draft: Draft, stream: str, names: tuple[str, ...], most: float, unit: str,
            values: Mapping[str, np.ndarray]) -> None:
    """A velocity, or an estimated acceleration, that no vehicle has: more than ``most``, in SI."""
    keys = draft.columns(stream, names)
    size = evidence.size_of(draft.si(keys, values)) if keys else 0.0
    if size > most:
        draft.ask(keys, f"{size:.4g} {unit} or more in a tenth of the rows: no flight; which unit is it? write it at "
                  "each")


def _place_wanted(draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    """A set-point that the path follows by another factor than 1 is in another unit."""
    wanted = draft.columns("setpoint", ("x", "y", "z"))
    for stream, names in PATHS:
        pairs = [(k, p) for k in wanted for p in draft.columns(stream, names) if k[1] == p[1][-1]]
        if not pairs:
            continue
        found = evidence.ratio(draft.si([k for k, _ in pairs], values), draft.si([p for _, p in pairs], values))
        if found.known and all(abs(np.log(r)) > np.log(factor("m") / factor("cm")) - np.log(evidence.SAME)
                               for r in found.known):
            shown = ", ".join(f"{r:.3g}" for r in found.known)
            draft.ask(wanted, f"the set-point is {shown} times the position that follows it; write the unit of each")
            return
