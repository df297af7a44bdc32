"""Predictions of left-out flights, before and after, each with per-flight offsets that both share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from nanobench_tools.physics import Model
from nanobench_tools.settings import number

from ..proof import FOLDS, HORIZONS, QUANTITIES, prediction_errors, relative_intervals
from ..space import MAPS
from ..track import ROW_S, Track
from ..tracked_point import centred
from ..wrench import Wrench
from .background import FAST_S, LEVELS, SAMPLE_S, fast_part
from .build import Case
from .sizing import Refined, moved_by, on_map, parts_of, refine
from .thrust_spread import thrust_spread

WINDOW_S = number("posterior.left_out_flights.window_s")
"""Seconds of flight that hold one independent prediction."""
MOST = number("posterior.left_out_flights.most")
"""Nats: most evidence that predictions of one flight give for or against an effect. They start from noisy inputs, which
favour a sluggish vehicle."""
KINDS = (slice(0, 2), slice(2, 4))
"""Of ``proof.QUANTITIES``: the path, and turning."""
GAINS = (0.3, 2.0)
"""Bounds of the gain from logged commands to turning."""
JUDGED, BEFORE_TURNING = slice(1, None), slice(1, 2)
"""Horizons that are judged: 0.1 and 0.5 s; and 0.1 s."""
WITHIN = 2.0
"""Standard deviations between flights: flights of one session may share as large a tilt, lift or trim."""
SLUGGISH = frozenset(("inertia", "angular_damping", "motor_lag", "command_delay", *MAPS, "saturation"))
"""Terms that can make a vehicle answer its commands less."""


@dataclass(frozen=True)
class Improvement:
    """Errors (flights, H, 4) at ``proof.HORIZONS`` of ``proof.QUANTITIES``; ``after`` by sizes that were fitted without
    the flight. ``ci95`` {steps: (lo, hi)}: removed share of the error of the most improved quantity."""

    flights: tuple[str, ...]
    before: np.ndarray
    after: np.ndarray
    ci95: dict[int, tuple[float, float]]
    held_out: bool


class Predictions:
    """Errors of flights that were left out of a fit, cached by the identified effects."""

    def __init__(self, case: Case, names: Sequence[str], seed: int) -> None:
        self.case, self.names, self.seed = case, names, seed
        self._known: dict[tuple[tuple[int, ...], bytes], np.ndarray] = {}

    def of(self, found: Refined) -> np.ndarray:
        """(flights, H, 4): every flight by sizes fitted without it and its fold."""
        key = found.chosen, found.step.tobytes()
        if key not in self._known:
            self._known[key] = self._errors(found)
        return self._known[key]

    def worse(self, found: Refined, without: Refined) -> tuple[float, ...]:
        """Mean logs of the ratio of errors with an effect to those without it: of the path, and of turning. That does
        not count for an effect that can make a vehicle sluggish.

        Evidence of a residual can be large for an effect that only opposes physics without a name. Predictions know
        nothing of such physics.
        """
        before, after = (np.where(e > 0.0, e, np.nan)[:, JUDGED] for e in (self.of(without), self.of(found)))
        sluggish = SLUGGISH & {self.case.effects[i].term for i in {*found.chosen} ^ {*without.chosen}}
        ratios = [np.log(after / before)[..., kind] for kind in (KINDS[:1] if sluggish else KINDS)]
        return tuple(float(part[np.isfinite(part)].mean()) if np.isfinite(part).any() else 0.0 for part in ratios)

    def judge(self, one: Refined, other: Refined) -> float:
        """``likelihood``; 0 where nothing can be left out."""
        return self.likelihood(one, other) if len(self.case.flights) > 1 else 0.0

    def likelihood(self, one: Refined, other: Refined) -> float:
        """Log likelihood of one fit over another.

        Errors of each flight are normal with unknown size, separately for the path and for turning. So only the log of
        the ratio of errors counts. Commands shake between rows, and from such commands a sluggish vehicle predicts
        turning better than a right one. The path follows the predicted turning after half a second, but hardly after a
        tenth. So effects that can make a vehicle sluggish have to improve the path after a tenth. Turning counts for
        the others, but not if set-points are the instruments of the moments.
        """
        case = self.case
        ratio = np.log(np.maximum(self.of(other), 1e-9) / np.maximum(self.of(one), 1e-9))
        slow = {case.effects[i].term for i in (*one.chosen, *other.chosen)} & SLUGGISH
        judged = [(BEFORE_TURNING if slow else JUDGED, KINDS[0])]
        if not slow and not case.rows.set_point_axes:
            judged.append((JUDGED, KINDS[1]))
        told = [ratio[:, horizons, kind].mean(axis=(1, 2)) for horizons, kind in judged]
        each = np.sum([np.where(np.isfinite(part), part, 0.0) for part in told], axis=0)
        return float(np.clip(self.windows * each, -MOST, MOST).sum())

    @cached_property
    def tracks(self) -> Sequence[Track]:
        """Of the centre of mass."""
        return centred(self.case.wrench.tracks, self.case.tracked_m)

    @cached_property
    def windows(self) -> np.ndarray:
        """(flights,) independent predictions in each."""
        track = self.case.wrench.tracks
        judged = [sum(int(t.counts.sum()) for t in track if t.flight == f) * ROW_S for f in self.case.flights]
        return np.array(judged) / WINDOW_S

    def improvement(self, found: Refined) -> Improvement:
        """Before and after."""
        before, after = self.of(refine(self.case, ())), self.of(found)
        ci95 = relative_intervals(before, after, self.seed) if found.chosen else {}
        return Improvement(tuple(self.names[int(n)] for n in self.case.flights), before, after, ci95,
                           len(self.case.flights) > 1)

    def _errors(self, found: Refined) -> np.ndarray:
        case, numbers = self.case, [int(f) for f in self.case.flights]
        errors = np.zeros((len(numbers), len(HORIZONS), 4))
        folds = [numbers[k::FOLDS] for k in range(min(FOLDS, len(numbers)))] if found.chosen else [numbers]
        for left_out in folds:
            step = found.without(case, left_out if len(numbers) > 1 else ())
            model = moved_by(case, found.chosen, step) if found.chosen else case.space.model
            offset = _own_offsets(case, found.chosen, step, model)
            for one in left_out:
                place = numbers.index(one)
                own, thrust_gain = offset[place]
                tracks = [_calmed(t, thrust_gain) for t in self.tracks if t.flight == one]
                errors[place] = prediction_errors(on_map(case, found.chosen, own), tracks, [one])[0]
        return errors


def _calmed(track: Track, gain: float) -> Track:
    """The track with the fast part of its collective command times a gain."""
    mean = track.motor.mean(axis=1, keepdims=True)
    return replace(track, motor=np.maximum(track.motor - (1.0 - gain) * fast_part(mean, FAST_S / ROW_S), 0.0))


def _own_offsets(case: Case, chosen: tuple[int, ...], step: np.ndarray, model: Model) -> list[tuple[Model, float]]:
    """The model once for every flight, with that flight's offsets of tilt, thrust and trim, and its gain of thrust.

    It also has the gain of the flight's logged commands, since a noisy command turns and lifts
    a vehicle less than a true one. An effect that only compensates for these gains does not improve the prediction.
    """
    wrench = case.wrench
    force, torque = wrench.residual(model)
    for i, part in parts_of(case, chosen, step):
        if case.effects[i].map_share:
            force = force - case.effects[i].force @ part
            torque = torque - case.effects[i].torque @ part
    by_force, by_torque = wrench.flight[wrench.force_at], wrench.flight[wrench.torque_at]
    gain = np.array([_gain(wrench.measured[1][by_torque == f], torque[by_torque == f]) for f in case.flights])
    lifts = [_lift_gain(wrench, force, by_force == f) for f in case.flights]
    pushed = np.array([np.median(force[by_force == f], axis=0) for f in case.flights])
    made = wrench.measured[1] - torque
    turned = np.array([np.median(torque[by_torque == f] + (1.0 - g) * made[by_torque == f], axis=0)
                       if len(torque) else np.zeros(3) for f, g in zip(case.flights, gain, strict=True)])
    tilt, lift, *trims = (WITHIN * case.evidence.amplitudes.get(level, 0.0) for level in LEVELS)
    usual = np.array([tilt, tilt, max(lift, thrust_spread(model.vehicle))])
    pushed, turned = _as_sessions_differ(pushed, usual), _as_sessions_differ(turned, np.array(trims) / case.arm)
    found = []
    weight = model.vehicle.gravity_m_s2
    values = model.parameters
    mass = model.values_of("mass").get("m", model.vehicle.mass_kg)
    inertia = np.array(model.values_of("inertia").get("inertia_kg_m2", model.vehicle.inertia_kg_m2))
    for push, turn, mine, lift_gain in zip(pushed, turned, inertia / gain, lifts, strict=True):
        changes = {"thrust_scale.s": values["thrust_scale.s"] * (1.0 + push[2] / weight)}
        if "frame_tilt.pitch_rad" in values:
            changes |= {"frame_tilt.pitch_rad": values["frame_tilt.pitch_rad"] + push[0] / weight,
                        "frame_tilt.roll_rad": values["frame_tilt.roll_rad"] - push[1] / weight}
        if "com_offset.r_m[0]" in values and len(torque):
            lift = mass * weight
            changes |= {"com_offset.r_m[0]": values["com_offset.r_m[0]"] + turn[1] * mine[1] / lift,
                        "com_offset.r_m[1]": values["com_offset.r_m[1]"] - turn[0] * mine[0] / lift}
        if "inertia.inertia_kg_m2[0]" in values:
            changes |= {f"inertia.inertia_kg_m2[{k}]": mine[k] for k in range(3)}
        inside = {n: float(np.clip(v, model.lower[model.index(n)], model.upper[model.index(n)]))
                  for n, v in changes.items()}
        found.append((model.with_parameters(inside), lift_gain))
    return found


def _lift_gain(wrench: Wrench, residual: np.ndarray, mine: np.ndarray) -> float:
    """Gain of the fast thrust of one flight's rows ``mine`` (N,): least squares of the measured on the predicted."""
    track, measured = wrench.track[wrench.force_at], wrench.measured[0][:, 2]
    parts = [np.stack([fast_part(x[here], FAST_S / SAMPLE_S) for x in (measured, measured - residual[:, 2])])
             for one in np.unique(track[mine]) for here in [mine & (track == one)]]
    followed, made = np.concatenate(parts, axis=1) if parts else np.zeros((2, 0))
    return float(np.clip((followed @ made) / max(float(made @ made), 1e-9), *GAINS)) if made.any() else 1.0


def _as_sessions_differ(offsets: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """(flights, 3) offsets, of whose mean only what sessions may differ by, ``usual`` (3,), is left."""
    mean = offsets.mean(0)
    return np.asarray(offsets - (mean - np.clip(mean, -usual, usual)))


def _gain(measured: np.ndarray, left: np.ndarray) -> np.ndarray:
    """(3,) least squares of measured (n, 3) angular accelerations on those that the model predicts from logged
    commands."""
    made = measured - left
    if len(made) < 2:
        return np.ones(3)
    made = made - made.mean(0)
    found = ((measured - measured.mean(0)) * made).sum(0) / np.maximum((made**2).sum(0), 1e-9)
    return np.asarray(np.clip(found, *GAINS))


def row_of(errors: np.ndarray, at: int) -> dict[str, float | None]:
    """Mean errors of all flights at one horizon, as in verdict.json."""
    means = errors.mean(axis=0)[at].tolist()
    return {q: x if np.isfinite(x) else None for q, x in zip(QUANTITIES, means, strict=True)}


__all__ = ["HORIZONS", "Improvement", "Predictions", "row_of"]
