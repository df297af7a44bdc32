"""Which cases there are: quotas of kinds, a grid of effects and sizes, flights that let them show. All from a seed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from nanobench_tools.auditing.faults.kind import Blind
from nanobench_tools.auditing.faults.kinds import those
from nanobench_tools.physics.vocabulary import added
from nanobench_tools.practice.inject import INJECTIONS

from .airframe import LIFT, Airframe, draw_airframe
from .case_kinds import CaseSpec, DataFault, FlightSpec, Hidden, Nuisance
from .effects import EFFECTS, FOREIGN, KNOWN, SIZES
from .effects.motor_effects import CHARGES
from .routes import draw_flights

QUOTAS = {"null": 0.30, "single": 0.24, "twin": 0.12, "pair": 0.10, "fault": 0.07, "change": 0.02, "foreign": 0.15}
"""Share of each kind of case."""
SIZE_SHARES = {"single": (0.34, 0.33, 0.33), "twin": (0.0, 0.5, 0.5), "pair": (0.0, 0.5, 0.5),
               "change": (0.0, 0.5, 0.5), "foreign": (0.2, 0.4, 0.4)}
"""Of small, medium and large; an effect that has to be separated from a twin or from a partner is not small."""
TWINS: tuple[tuple[str, ...], ...] = (
         ("mass", "thrust_scale"), ("motor_lag", "command_delay"), ("wind", "force_world", "frame_tilt"),
         ("drag_linear", "drag_quadratic", "drag_rotor"), ("motor_imbalance", "com_offset"),
         ("ground_effect", "thrust_scale"), ("inflow", "drag_linear"), ("thrust_voltage", "thrust_scale"))
"""Groups that are confused with each other; every member is concealed on flights that all of them want."""
LEAST_LIFT = 1.06
"""So many times must full command lift the weight with the effect. Large losses of thrust are therefore rarer than
gains: the onboard controllers command at most 0.12 N of a motor, 18 % above hover."""
CHANGES: tuple[str, ...] = ("mass", "motor_imbalance", "thrust_scale", "com_offset", "wind")
"""What may happen between two flights of a day."""
ADDED = {name: term for name, term in added().items() if name in EFFECTS}
"""Terms from other packages. Each is in single cases and pairs, against the terms it is confused with, and between
flights where it declares that it changes."""
TWINS += tuple((name, *others) for name, term in ADDED.items()
               if (others := tuple(n for n in term.confused_with if n in EFFECTS)))
CHANGES += tuple(name for name, term in ADDED.items() if term.changes)
ALONE = ("rotor_gyro", "saturation")
"""Never one of a pair: the first is too small to show with anything else; with the second few partners leave enough
thrust."""
INNOCENT = ("plain", "falling voltage", "low flights", "big tilts", "turning", "rich simulator", "slow", "restless air")
KNOWN_IN_RICH = ("motor_imbalance", "com_offset", "inflow", "ground_effect", "wind", "force_world", "drag_quadratic",
                 "angular_damping", "command_delay", "frame_tilt")
"""Effects with their own hooks, which a simulator may have right."""


def plan_cases(n: int, seed: int = 0) -> list[CaseSpec]:
    """n cases, the same for the same arguments. Names say nothing: ``case_000`` ... in an order that is shuffled."""
    rng = np.random.default_rng([seed, 101])
    kinds = _kinds(n, rng)
    decks: dict[str, list[Any]] = {}
    specs = []
    for index, kind in enumerate(kinds):
        case_rng = np.random.default_rng([seed, 102, index])
        specs.append(_case(f"case_{index:03d}", kind, seed, index, case_rng, decks, rng))
    return specs


def _kinds(n: int, rng: np.random.Generator) -> list[str]:
    """Quotas by largest remainder, shuffled."""
    exact = {kind: share * n for kind, share in QUOTAS.items()}
    count = {kind: int(x) for kind, x in exact.items()}
    for kind in sorted(exact, key=lambda k: count[k] - exact[k])[:n - sum(count.values())]:
        count[kind] += 1
    kinds = [kind for kind, many in count.items() for _ in range(many)]
    return [kinds[i] for i in rng.permutation(len(kinds))]


def _deal(decks: dict[str, list[Any]], name: str, cards: Callable[[], Sequence[Any]], rng: np.random.Generator) -> Any:
    """The next card of a shuffled deck, which is made anew when it is empty: everything comes before anything twice."""
    if not decks.get(name):
        fresh = list(cards())
        decks[name] = [fresh[i] for i in rng.permutation(len(fresh))]
    return decks[name].pop()


def _nuisance(rng: np.random.Generator, restless: bool = False) -> Nuisance:
    """Air and flicker differ between cases; the telemetry clock wanders in half, an IMU is tilted in a fifth.

    With this flicker, the true simulator predicts as well as the best fit does on real recordings. That is 0.011 rad
    after 0.1 s, 0.22 m/s after 0.5 s.
    """
    wanders = bool(rng.uniform() < 0.5)
    tilt = np.zeros(3)
    if rng.uniform() < 0.2:
        way = rng.standard_normal(3)
        tilt = np.radians(rng.uniform(0.3, 1.2)) * way / np.linalg.norm(way)
    high = float(rng.uniform(0.01, 0.2))
    return Nuisance(
        disturbance_m_s2=float(f"{0.09 if restless else rng.uniform(0.02, 0.06):.3g}"),
        thrust_noise=float(f"{rng.uniform(0.002, 0.005):.3g}"),
        clock_wander_s=float(f"{rng.uniform(0.008, 0.03):.3g}") if wanders else 0.0,
        clock_offset_s=float(f"{rng.uniform(-0.01, 0.03):.3g}") if wanders else 0.0,
        loss=(0.3 * high, high), lost_frames=float(rng.integers(0, 5)),
        imu_tilt_rad=(float(tilt[0]), float(tilt[1]), float(tilt[2])))


def _hidden(name: str, size: str, rng: np.random.Generator, airframe: Airframe,
            flights: tuple[int, ...] | None = None) -> Hidden:
    return Hidden(name, size, EFFECTS[name].draw(size, rng, airframe), flights)


def _lifting(hidden: Hidden, rng: np.random.Generator, airframe: Airframe, least: float) -> Hidden:
    """The same effect, resampled until full command lifts the weight ``least`` times. A vehicle that is too heavy for
    its controller falls, and one close to that lands on a low flight."""
    for _ in range(50):
        changed = EFFECTS[hidden.effect].change(airframe, hidden.parameters)
        if changed.lift() * (1.0 - hidden.parameters.get("loss", 0.0) * (hidden.effect == "heating")) >= least:
            break
        hidden = replace(_hidden(hidden.effect, hidden.size, rng, airframe), flights=hidden.flights)
    return hidden


def _size(kind: str, rng: np.random.Generator) -> str:
    return SIZES[int(rng.choice(3, p=SIZE_SHARES[kind]))]


def _case(name: str, kind: str, seed: int, index: int, rng: np.random.Generator, decks: dict[str, list[Any]],
          deal_rng: np.random.Generator) -> CaseSpec:
    airframe = draw_airframe(rng)
    wants: list[str] = []
    charges = None
    concealed: tuple[Hidden, ...] = ()
    known: tuple[Hidden, ...] = ()
    faults: tuple[DataFault, ...] = ()
    note = ""
    if kind == "null":
        note = _deal(decks, kind, lambda: INNOCENT, deal_rng)
        wants = {"low flights": ["low", "vertical"], "big tilts": ["fast"], "turning": ["turning", "spinning"],
                 "falling voltage": ["charges", "lateral"], "slow": ["slow"],
                 "rich simulator": ["turning", "vertical", "low"]}.get(note, [])
        charges = (0.36, 1.0) if note == "falling voltage" else None
        if note == "rich simulator":
            names = rng.choice(KNOWN_IN_RICH, size=3, replace=False)
            known = tuple(_hidden(str(x), ("medium", "large")[int(rng.integers(2))], rng, airframe) for x in names)
    elif kind == "single":
        effect, size = _deal(decks, kind, lambda: [(e, s) for e in KNOWN for s in SIZES], deal_rng)
        concealed = (_hidden(effect, size, rng, airframe),)
    elif kind == "twin":
        group, effect = _deal(decks, kind, lambda: [(g, e) for g in TWINS for e in g], deal_rng)
        wants = [w for e in group for w in EFFECTS[e].wants]
        note = "told from " + ", ".join(e for e in group if e != effect)
        concealed = (_hidden(effect, _size(kind, rng), rng, airframe),)
    elif kind == "pair":
        first = _deal(decks, kind, lambda: [e for e in KNOWN if e not in ALONE], deal_rng)
        others = [e for e in KNOWN if e not in (first, *ALONE) and not any({e, first} <= set(g) for g in TWINS)
                  and e not in EFFECTS[first].twins]
        concealed = tuple(_hidden(e, _size(kind, rng), rng, airframe) for e in (first, str(rng.choice(others))))
    elif kind == "foreign":
        effect = _deal(decks, kind, lambda: FOREIGN, deal_rng)
        concealed = (_hidden(effect, _size(kind, rng), rng, airframe),)
    elif kind == "change":
        effect = _deal(decks, kind, lambda: CHANGES, deal_rng)
    for hidden in concealed:
        wants += [w for w in EFFECTS[hidden.effect].wants if w not in wants]
        if hidden.effect == "thrust_voltage":
            charges = CHARGES[hidden.size]
    if "full" in wants and "charges" in wants:  # effects that only full batteries show are visible there
        wants.remove("full")
    concealed = tuple(_lifting(hidden, rng, airframe, LIFT if "low" in wants else LEAST_LIFT) for hidden in concealed)
    count = int(rng.integers(5, 7)) if len(concealed) > 1 or kind in ("twin", "change") else None
    flights = draw_flights(rng, wants, count=count, **({} if charges is None else {"charges": charges}))
    if kind == "change":
        late = tuple(range(int(rng.integers(len(flights) - 2, len(flights))), len(flights)))
        concealed = (_lifting(_hidden(effect, _size(kind, rng), rng, airframe, late), rng, airframe, LEAST_LIFT),)
        note = "from one flight on"
    if kind == "fault":
        faults = (_fault(_deal(decks, kind, _faults, deal_rng), rng, flights),)
    nuisance = _nuisance(rng, note == "restless air")
    if any(f.kind in those(lambda kind: kind.corrected) for f in faults):
        nuisance = Nuisance(nuisance.disturbance_m_s2, nuisance.thrust_noise)
    return CaseSpec(name, kind, seed, index, airframe, flights, concealed, known, faults, nuisance, note=note)


def _faults() -> list[tuple[str, Blind]]:
    """Every card of every kind of fault, in the order of the deck."""
    cards = [(name, card) for name, injection in INJECTIONS.items() for card in injection.blind]
    return sorted(cards, key=lambda one: one[1].place)


def _fault(card: tuple[str, Blind], rng: np.random.Generator, flights: Sequence[FlightSpec]) -> DataFault:
    kind, blind = card
    some = tuple(range(len(flights))) if blind.everywhere else (int(rng.integers(len(flights))),)
    return DataFault(kind, blind.size, blind.options, some)
