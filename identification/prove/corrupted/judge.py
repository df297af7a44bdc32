"""Diagnoses the cases of the test bed, on several processes if asked."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nanobench_tools.errors import NanobenchError
from nanobench_tools.harness.items import Item
from nanobench_tools.harness.runner import RunResult, run_items
from nanobench_tools.harness.store import user_store
from nanobench_tools.results.result import Result, to_json

from .cases import CorruptedCase
from .engines import Engine
from .groups import Group
from .kept_results import key_of
from .nominal import from_values
from .sizes import VISIBLE, errors

BODY = ("outcome", "paragraph", "findings", "unknown", "power", "rejected", "corrected")
"""What of verdict.json is kept."""


@dataclass(frozen=True, repr=False)
class Diagnosed(Result):
    """One verdict.

    - share: the share of the rise of a prediction error that the corrected simulator removes, over that of the nominal
      one. It is None where nothing rises or is corrected.
    - cpu_s; error: reason for a missing verdict."""

    verdict: Mapping[str, Any]
    share: float | None
    cpu_s: float
    error: str = ""


@dataclass(frozen=True)
class Judge:
    """An engine on the cases of groups."""

    engine: Engine
    groups: Sequence[Group]
    seed: int = 0

    def item(self, case: CorruptedCase) -> Item:
        """The work on one case; the same code gives the same key."""
        group = next(g for g in self.groups if (g.vehicle, g.number) == (case.vehicle, case.group))
        key = key_of("diagnosed", self.engine.name, self.engine.code, group.key, case.key, self.seed)
        return Item(key, diagnosed, {"engine": self.engine, "group": group, "case": case, "seed": self.seed},
                    f"diagnose {case.name}")


def diagnosed(engine: Engine, group: Group, case: CorruptedCase, seed: int) -> Diagnosed:
    """One case; ``Diagnosed.error`` has the reason where the engine fails."""
    start = time.process_time()
    try:
        verdict = to_json(engine.diagnose(case.recordings, case.simulator, seed))
    except Exception as error:  # an engine that is being written may fail in any way; the other cases go on
        why = str(error) if isinstance(error, NanobenchError) else f"{type(error).__name__}: {error}"
        return Diagnosed({"outcome": "error", "findings": []}, None, time.process_time() - start, why)
    spent = time.process_time() - start
    return Diagnosed({k: verdict[k] for k in BODY if k in verdict}, _share(group, case, verdict), spent)


def _share(group: Group, case: CorruptedCase, verdict: Mapping[str, Any]) -> float | None:
    """Of the error that the wrong belief raises most."""
    if case.simulator == case.nominal:  # a control, or flights that differ: no simulator can do better
        return None
    if verdict.get("corrected") is None:
        return 0.0
    usual, wrong, mended = (errors(simulator, group.recordings.tracks) for simulator in (
        group.nominal, case.simulator, from_values(verdict["corrected"])))
    worst = np.unravel_index(np.nanargmax(wrong / np.maximum(usual, 1e-12)), wrong.shape)
    raised = float(wrong[worst] - usual[worst])
    return float(wrong[worst] - mended[worst]) / raised if raised > 0.0 else None


def drawn(cases: Sequence[CorruptedCase], n: int | None, seed: int) -> list[CorruptedCase]:
    """All controls, then cases in an order drawn once, at most ``n``. They come in turn from every belief, visible
    ones first, so that any number of the first ones spreads over beliefs and groups."""
    rng = np.random.default_rng([seed, 47])
    controls = [c for c in cases if c.kind == "control"]
    others = [c for c in cases if c.kind != "control"]
    turn: dict[str, int] = {}
    ranked = []
    order = sorted(rng.permutation(len(others)), key=lambda i: others[i].rise < VISIBLE)
    for i in order:
        name = others[i].kind if others[i].kind == "pair" else others[i].beliefs[0]
        turn[name] = turn.get(name, -1) + 1
        ranked.append((turn[name], i))
    return [*controls, *(others[i] for _, i in sorted(ranked, key=lambda r: r[0]))][:n]


def here(items: Sequence[Item], title: str) -> RunResult:
    """In this process; kept in the cache folder of the user."""
    return run_items(items, user_store(), title=title)


def run(judge: Judge, cases: Sequence[CorruptedCase],
        work: Callable[[Sequence[Item], str], RunResult] = here) -> dict[str, Diagnosed]:
    """{name of the case: verdict}. A killed run goes on where it was. ``work``: runs items, as ``run_items`` does."""
    items = {case.name: judge.item(case) for case in cases}
    done = work(list(items.values()), "diagnose")
    lost = {entry["item"]: entry["error"] for entry in done.failed}
    return {name: done.values[item.key] if item.key in done.values else
            Diagnosed({"outcome": "error", "findings": []}, None, 0.0, lost.get(item.label, "no result"))
            for name, item in items.items()}
