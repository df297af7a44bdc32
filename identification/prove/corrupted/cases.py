"""The cases of a group: controls, single wrong beliefs of four sizes, pairs, and shapes outside the vocabulary."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identification.mismatch.recordings import Recordings
from identification.mismatch.track import Track
from identification.prove.truth import TrueEffect, Truth
from nanobench_tools.errors import InputError
from nanobench_tools.physics import Model

from .beliefs import BELIEFS, Belief, Flown, flown_by, truth_of
from .disturbed import DISTURBANCES, Disturbance, disturbed
from .groups import Group
from .kept_results import PHYSICS, code_hash, kept, key_of
from .nominal import as_json
from .outside import OUTSIDE, Outside
from .sizes import RISES, TIMES, errors, rise, smallest_shown, thinned

SEARCHED_S = 10.0
"""Of each flight, for the search of the smallest size."""
PAIRS = 6
PAIR_TIMES = 3.0
"""Size of each of a pair, over the smallest that predictions show."""
OUTSIDE_TIMES = (1.25, 3.0, 8.0)
FAMILIES = (("mass", "thrust_scale"), ("drag_linear", "drag_quadratic", "drag_rotor"),
            ("wind", "force_world", "frame_tilt"), ("motor_lag", "command_delay"), ("", "thrust_voltage"))
"""Terms of one family nearly cancel or replace each other: no pair has two of one."""
UNSHOWN = 0.0
"""Stands for the size of a belief that predictions do not show even at the most that makes sense."""
OURS = (*(f"identification/prove/corrupted/{name}.py" for name in ("beliefs", "sizes", "outside", "disturbed")),
        "identification/mismatch/proof.py")
"""Code that decides a size."""


Wrong = Belief | Outside | Disturbance


@dataclass(frozen=True)
class CorruptedCase:
    """One wrong simulator.

    - name; vehicle, group; kind ``control``, ``single``, ``pair``, ``outside``.
    - beliefs: wrong ones (names of the table); nominal and simulator.
    - truth: its effects and their right values.
    - times: size over the smallest that predictions show, 0 for a control and where they never show it.
    - rise: largest relative rise of a prediction error 0.1 or 0.5 s ahead.
    - recordings: input of a diagnosis, those of the group unless a force of time was added.
    - near: terms that are no false names."""

    name: str
    vehicle: str
    group: int
    kind: str
    beliefs: tuple[str, ...]
    flights: tuple[str, ...]
    nominal: Model
    simulator: Model
    truth: Truth
    times: float
    rise: float
    recordings: Recordings
    near: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """Input of a diagnosis other than the flights."""
        added = (self.beliefs, self.times, self.rise) if self.simulator == self.nominal else ()
        return key_of(as_json(self.simulator), added)


@dataclass(frozen=True)
class Smallest:
    """Of a belief: the size that predictions show, or none up to the most that makes sense."""

    belief: Wrong
    x: float | None


def cases_of(group: Group, seed: int = 0, say: Callable[[str], None] = lambda text: None) -> list[CorruptedCase]:
    """All cases of a group, in a fixed order; sizes are searched once and kept."""
    tracks = group.recordings.tracks
    rng = np.random.default_rng([seed, group.number, sum(map(ord, group.vehicle))])
    flown = flown_by(group.nominal, tracks, rng)
    few = thinned(tracks, SEARCHED_S)
    wrong = [*(b for b in (*BELIEFS, *OUTSIDE) if b.suits(group.nominal)), *DISTURBANCES]
    found = [Smallest(b, _smallest(group, b, flown, few, say)) for b in wrong]
    draft = [_Draft("control", (), group.nominal, 0.0)]
    shown = [s for s in found if s.x is not None and isinstance(s.belief, Belief) and not s.belief.once]
    for s in found:
        times = OUTSIDE_TIMES if not isinstance(s.belief, Belief) else (1.0,) if s.belief.once else TIMES
        draft += _sized(group.nominal, s, times, flown)
    draft += [made for pair in _pairs(shown, rng) if (made := _pair(group.nominal, *pair, flown)) is not None]
    return [_case(group, number, d) for number, d in enumerate(draft)]


@dataclass(frozen=True)
class _Draft:
    kind: str
    beliefs: tuple[Wrong, ...]
    simulator: Model
    times: float
    sizes: tuple[float, ...] = field(default=())


def _simulator(nominal: Model, wrong: Wrong, x: float, flown: Flown) -> Model:
    return nominal if isinstance(wrong, Disturbance) else wrong.believe(nominal, x, flown)


def _tracks(nominal: Model, wrong: Wrong | None, x: float, tracks: Sequence[Track]) -> tuple[Track, ...]:
    return disturbed(tracks, nominal, x, wrong.period_s) if isinstance(wrong, Disturbance) else tuple(tracks)


def _smallest(group: Group, belief: Wrong, flown: Flown, tracks: Sequence[Track],
              say: Callable[[str], None]) -> float | None:
    def make() -> list[float | None]:
        say(f"{group.name}: smallest visible {belief.name}")
        usual = errors(group.nominal, tracks)

        def at(x: float) -> float:
            try:
                return rise(errors(_simulator(group.nominal, belief, x, flown),
                                   _tracks(group.nominal, belief, x, tracks)), usual)
            except InputError:  # beyond the physical bounds
                return -1.0

        if isinstance(belief, Belief) and belief.once:
            return [belief.most if at(belief.most) >= RISES else None]
        return [smallest_shown(at, belief.start, belief.most)]

    key = key_of("size", group.key, belief.name, vars(flown), code_hash((*PHYSICS, *OURS)))
    found: list[float | None] = kept(key, list[float | None], make)
    return found[0]


def _sized(nominal: Model, smallest: Smallest, times: Sequence[float], flown: Flown) -> list[_Draft]:
    """Of one belief; where predictions do not show even the largest, that one alone."""
    belief, x = smallest.belief, smallest.x
    kind = "single" if isinstance(belief, Belief) else "outside"
    sizes = {belief.most: UNSHOWN}
    if x is not None:
        sizes = {}
        for t in times:
            sizes.setdefault(min(t * x, belief.most), t)
    found = []
    for size, t in sizes.items():
        try:
            found.append(_Draft(kind, (belief,), _simulator(nominal, belief, size, flown), t, (size,)))
        except InputError:  # beyond the physical bounds
            continue
    return found


def _pairs(shown: Sequence[Smallest], rng: np.random.Generator) -> list[tuple[Smallest, Smallest]]:
    """Beliefs about terms of different families, drawn."""
    found: list[tuple[Smallest, Smallest]] = []
    order = [shown[i] for i in rng.permutation(len(shown))]
    while len(order) > 1 and len(found) < PAIRS:
        first = order.pop(0)
        second = next((s for s in order if _family(s.belief) != _family(first.belief)), None)
        if second is None:
            break
        order.remove(second)
        found.append((first, second))
    return found


def _family(wrong: Wrong) -> str:
    term = wrong.term if isinstance(wrong, Belief) else wrong.name
    return next((family[0] or family[1] for family in FAMILIES if term in family), term)


def _pair(nominal: Model, first: Smallest, second: Smallest, flown: Flown) -> _Draft | None:
    """None where the two together are beyond physical bounds."""
    model, sizes = nominal, []
    for s in (first, second):
        assert s.x is not None  # only of those that are shown
        sizes.append(min(PAIR_TIMES * s.x, s.belief.most))
        try:
            model = _simulator(model, s.belief, sizes[-1], flown)
        except InputError:
            return None
    return _Draft("pair", (first.belief, second.belief), model, PAIR_TIMES, tuple(sizes))


def _case(group: Group, number: int, draft: _Draft) -> CorruptedCase:
    names = group.recordings.names
    name = f"{group.vehicle}_{group.number}_{number:03d}"
    size = "" if draft.kind == "control" else f"{draft.times:g}"
    near: tuple[str, ...] = ()
    belief = draft.beliefs[0] if draft.beliefs else None
    if belief is not None and not isinstance(belief, Belief):
        near = tuple(belief.near)
        effects: tuple[TrueEffect, ...] = (TrueEffect(belief.name, size, names, foreign=True),)
    else:
        effects = truth_of(group.nominal, draft.simulator, size, names)
    recordings = group.recordings
    if isinstance(belief, Disturbance):
        recordings = replace(recordings, tracks=_tracks(group.nominal, belief, draft.sizes[0], recordings.tracks))
    key = key_of("rise", group.key, as_json(draft.simulator), name, draft.sizes, code_hash((*PHYSICS, *OURS)))
    higher: float = kept(key, float, lambda: rise(errors(draft.simulator, recordings.tracks),
                                                  errors(group.nominal, group.recordings.tracks)))
    return CorruptedCase(name, group.vehicle, group.number, draft.kind, tuple(b.name for b in draft.beliefs), names,
                         group.nominal, draft.simulator, Truth(name, draft.kind, effects), draft.times, higher,
                         recordings, near)


def table_name(case: CorruptedCase) -> str:
    """What the table calls it."""
    return " + ".join(case.beliefs) or case.kind



__all__ = ["CorruptedCase", "cases_of", "table_name"]
