"""Proof on real folders: flights of one vehicle, a folder per thing done to it, diagnosed blind against the normal one.

The diagnosis gets trims under neutral names, in an order drawn from the seed. The folder names and the labels are put
next to the verdicts when all verdicts exist. Each normal flight is judged by the other normal ones as if it were a
folder; an identified effect is a false alarm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.mismatch.steady.comparison import compare, normal_flights
from identification.mismatch.steady.known import NOTHING, Known
from identification.mismatch.steady.trim_inputs import body_of, renamed, trim_item, trims_in
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight
from nanobench_tools.harness import Item, RunResult, make_item
from nanobench_tools.physics import Model

from .score import Verdict

Run = Callable[[Sequence[Item], str], RunResult]
Values = Mapping[str, Mapping[str, Any]]
"""{flight: value of ``trim_item``}"""
LEAVE_ONE_OUT = "normal, left out: "


@dataclass(frozen=True)
class Judged:
    """verdicts by folder, and by normal flight that was left out; normal: names of the flights that were normal."""

    verdicts: Mapping[str, Verdict]
    alarms: Mapping[str, Verdict]
    normal: tuple[str, ...]


def folder_item(flights: Values, normal: Values, simulator: Model | None, mass_kg: float | None, least: int,
                known: Known = NOTHING) -> Verdict:
    """The verdict on ``flights`` against ``normal``."""
    usual, usual_swings, lost = trims_in(normal)
    body = body_of(usual, mass_kg, simulator, known)
    trims, swings, left_out = trims_in(flights)
    verdict = compare(trims, normal_flights(usual, body, known), body, left_out=left_out,
                      swings=(swings, usual_swings), least=least)
    return {**verdict, "normal_without_trim": lost}


def judge(folders: Mapping[str, Sequence[Flight]], normal: Sequence[Flight], run: Run, seed: int,
          simulator: Model | None = None, mass_kg: float | None = None,
          copies: Mapping[str, str] | None = None, known: Known = NOTHING) -> Judged:
    """Verdicts on every folder and on every normal flight.

    - copies {flight: why}: recordings that are left out.
    - known: of all folders."""
    every = [*normal, *(f for flights in folders.values() for f in flights)]
    values = _values(every, run, copies or {})
    usual = {f"normal_{k}": renamed(values[f.name], f"normal_{k}") for k, f in enumerate(normal) if f.name in values}
    if sum("trim" in v for v in usual.values()) < 2:
        reasons = "; ".join(dict.fromkeys(str(v.get("why")) for v in usual.values() if "why" in v))
        raise InputError("normal flights", f"{sum('trim' in v for v in usual.values())} of {len(normal)} have a trim"
                         + (f" ({reasons})" if reasons else ""), "two are needed: one has no spread")
    rng = np.random.default_rng([seed, 211])
    names = list(folders)
    order = [names[i] for i in rng.permutation(len(names))]
    items, back = {}, {}
    for k, name in enumerate(order):
        given = {f"case_{k}_flight_{j}": values[f.name] for j, f in enumerate(folders[name]) if f.name in values}
        back[name] = {f"case_{k}_flight_{j}": f.name for j, f in enumerate(folders[name])} | {
            f"normal_{j}": f.name for j, f in enumerate(normal)}
        items[name] = make_item(folder_item, {
            "flights": {n: renamed(v, n) for n, v in given.items()}, "normal": usual, "simulator": simulator,
            "mass_kg": mass_kg, "least": 2, "known": known}, f"diagnose case {k}", file=f"case {k}")
    alarms = {}
    with_trim = [n for n, v in usual.items() if "trim" in v]
    if len(with_trim) > 2:
        for n in with_trim:
            alarms[n] = make_item(folder_item, {
                "flights": {n: usual[n]}, "normal": {o: v for o, v in usual.items() if o != n}, "simulator": simulator,
                "mass_kg": mass_kg, "least": 1, "known": known}, f"diagnose {n}", file=n)
    found = run([*items.values(), *alarms.values()], "diagnose").values
    own = {f"normal_{j}": f.name for j, f in enumerate(normal)}
    return Judged({name: _named(found[items[name].key], back[name]) for name in names if items[name].key in found},
                  {own[n]: _named(found[item.key], own) for n, item in alarms.items() if item.key in found},
                  tuple(f.name for f in normal))


def _values(flights: Sequence[Flight], run: Run, copies: Mapping[str, str]) -> dict[str, Mapping[str, Any]]:
    items = {f.name: make_item(trim_item, {"flight": f}, f"trim of {f.name}") for f in flights if f.name not in copies}
    found = run(list(items.values()), "steady trims").values
    return {**{name: found[item.key] for name, item in items.items() if item.key in found},
            **{name: {"why": why} for name, why in copies.items()}}


def _named(value: Any, names: Mapping[str, str]) -> Any:
    """``value`` with the neutral names of flights, also within texts, turned back."""
    if isinstance(value, Mapping):
        return {_named(k, names): _named(v, names) for k, v in value.items()}
    if isinstance(value, list):
        return [_named(v, names) for v in value]
    if isinstance(value, str) and ("flight_" in value or "normal_" in value):
        for neutral in sorted(names, key=len, reverse=True):
            value = value.replace(neutral, names[neutral])
    return value
