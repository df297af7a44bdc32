"""A blind proof from plan to score: cases are made, their truth is sealed, they are diagnosed, the truth is opened.

Every case is one item of the runner, so that a killed run goes on, on any number of processes or a cluster. The
hash of all truths is known, and kept in ``prove_sealed.json``, before the first case is diagnosed. A diagnosis is given
flights and simulator.toml's model, nothing else; which case it was is compared afterwards by the seal of its truth.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from nanobench_tools.errors import InputError, unknown_name
from nanobench_tools.harness import Item, RunResult, envelope, item_key, manifest, read_json, write_json
from nanobench_tools.results.result import Result

from .case_flights import forget, given, keep, kept
from .case_kinds import CaseSpec
from .make import Case, make_cases
from .plan import QUOTAS, plan_cases
from .score import CaseScore, Verdict, score_case
from .seal import seal
from .summary import Summary, TermPower, power_by_term, summarise
from .truth import Truth

Diagnose = Callable[..., Verdict]
"""(flights, simulator, seed=...) -> verdict.json, see ``identification.mismatch.diagnosis.diagnose_flights``."""
Run = Callable[[Sequence[Item], str], RunResult]
"""(items, title) -> their values, see ``nanobench_tools.harness.run_items``."""

TOGETHER = 16
"""Cases flown in one batch: a sixth of the time of one after the other."""
SEALED, FLOWN = "prove_sealed.json", ".flown"


@dataclass(frozen=True)
class Sealed:
    """specs and truths of the cases that could be made, in the same order; sha256 of all truths together; at: when."""

    specs: tuple[CaseSpec, ...]
    truths: tuple[Truth, ...]
    sha256: str
    at: str


@dataclass(frozen=True, repr=False)
class Diagnosed(Result):
    """A verdict, and the seal of the truth of what was diagnosed."""

    verdict: Verdict
    truth: str


@dataclass(frozen=True, repr=False)
class Seal(Result):
    """Hash of the truths, and when it was written."""

    sha256: str
    at: str
    opened_unchanged: bool = True


@dataclass(frozen=True, repr=False)
class Proof(Result):
    """prove.json of a blind proof."""

    cases: tuple[CaseScore, ...]
    summary: Summary
    power: Mapping[str, TermPower]
    sealed: Seal


def plan(n: int, seed: int, kinds: Sequence[str] = (), engine: str = "practice") -> list[CaseSpec]:
    """``n`` cases of ``kinds`` (all, in their quotas); engine ``both`` gives every other one to the second engine."""
    unknown = [kind for kind in kinds if kind not in QUOTAS]
    if unknown:
        raise unknown_name("kind", unknown[0], QUOTAS)
    whole = n if not kinds else int(2 * n / sum(QUOTAS[k] for k in set(kinds))) + 20
    specs = [s for s in plan_cases(whole, seed) if not kinds or s.kind in kinds][:n]
    return [replace(s, engine=("practice", "rotorpy")[i % 2] if engine == "both" else engine)
            for i, s in enumerate(specs)]


_flown: dict[str, Case] = {}
"""The batch that this process flew last."""


def _fly(batch: Sequence[CaseSpec]) -> list[Case]:
    cases = make_cases(batch)
    _flown.clear()
    _flown.update({case.name: case for case in cases})
    return cases


def truths_item(specs: Sequence[CaseSpec], folder: Path | None = None) -> dict[str, list[Truth]]:
    """The truths of cases that fly together; flights are kept in ``folder``."""
    cases = _fly(specs)
    if folder is not None:
        for case in cases:
            keep(case, folder)
    return {"truths": [case.truth for case in cases]}


def diagnose_item(spec: CaseSpec, batch: Sequence[CaseSpec], seed: int, diagnose: Diagnose,
                  folder: Path | None = None) -> Diagnosed:
    """One case. ``batch``, the cases it flies with, and ``folder``, where its flights may be kept, change nothing but
    the time."""
    case = kept(spec, folder) if folder is not None else None
    if case is None:
        flown = _flown.get(spec.name)
        if flown is None or flown.spec != spec:
            flown = next(c for c in _fly(batch) if c.name == spec.name)
        case = given(flown)
    verdict = diagnose(case.flights, case.simulator, seed=seed)
    if folder is not None:
        forget(spec, folder)
    return Diagnosed(verdict, case.truth)


def seal_cases(specs: Sequence[CaseSpec], run: Run, folder: Path | None = None, seed: int | None = None) -> Sealed:
    """Makes all cases, and writes the hash of their truths into ``folder`` unless it is there already. Cases whose
    batch failed are left out (the runner lists them)."""
    batches = _batches(specs)
    place = folder and folder / FLOWN
    items = [Item(item_key(truths_item, {"specs": batch}), truths_item, {"specs": batch, "folder": place},
                  f"make {batch[0].name} to {batch[-1].name}") for batch in batches]
    values = run(items, "make the cases").values
    made = [(batch, values[item.key]["truths"]) for batch, item in zip(batches, items, strict=True)
            if item.key in values]
    truths = tuple(truth for _, found in made for truth in found)
    sealed = Sealed(tuple(s for batch, _ in made for s in batch), truths, seal(truths),
                    datetime.now(UTC).isoformat(timespec="seconds"))
    return sealed if folder is None else _written(sealed, folder / SEALED, seed)


def _written(sealed: Sealed, path: Path, seed: int | None) -> Sealed:
    """A run that goes on finds its seal; another run in the same folder writes its own."""
    if path.exists():
        before = read_json(path, "prove-sealed")
        if before["sha256"] == sealed.sha256:
            return replace(sealed, at=before["sealed_at"])
    write_json(path, envelope("prove-sealed", {"sha256": sealed.sha256, "cases": len(sealed.truths),
                                               "sealed_at": sealed.at}, True, manifest(seed=seed), []))
    return sealed


def diagnose_cases(sealed: Sealed, run: Run, diagnose: Diagnose, seed: int = 0,
                   folder: Path | None = None) -> dict[str, Diagnosed]:
    """By name of the case; failed ones left out. ``folder``: the one of ``seal_cases``."""
    items = {}
    place = folder and folder / FLOWN
    for batch in _batches(sealed.specs):
        for spec in batch:
            alone = {"spec": spec, "seed": seed, "diagnose": diagnose}
            more = {"batch": batch, "folder": place}
            items[spec.name] = Item(item_key(diagnose_item, alone), diagnose_item, {**alone, **more},
                                    f"diagnose {spec.name}", spec.name)
    values = run(list(items.values()), "diagnose").values
    return {name: values[item.key] for name, item in items.items() if item.key in values}


def open_and_score(sealed: Sealed, verdicts: Mapping[str, Diagnosed], folder: Path | None = None) -> list[CaseScore]:
    """Raises InputError when a truth is not the one of the seal."""
    kept = sealed.sha256 if folder is None else read_json(folder / SEALED, "prove-sealed")["sha256"]
    place = SEALED if folder is None else str(folder / SEALED)
    if seal(sealed.truths) != kept:
        raise InputError(place, "the hash of the truths is not the one written before the run", "run anew")
    cases = []
    for truth in sealed.truths:
        found = verdicts.get(truth.case)
        if found is None:
            continue
        if found.truth != seal([truth]):
            raise InputError(place, f"the case diagnosed as {truth.case} is not the sealed one",
                             "these packages do not make the same numbers twice: use --jobs 1")
        cases.append(score_case(truth, found.verdict))
    return cases


def proof_of(sealed: Sealed, cases: Sequence[CaseScore]) -> Proof:
    """What scored cases come to."""
    return Proof(tuple(cases), summarise(cases), power_by_term(cases), Seal(sealed.sha256, sealed.at))


def _batches(specs: Sequence[CaseSpec]) -> list[list[CaseSpec]]:
    """Cases of one engine, TOGETHER at a time."""
    ordered = sorted(specs, key=lambda s: s.engine)
    groups = [[s for s in ordered if s.engine == engine] for engine in dict.fromkeys(s.engine for s in ordered)]
    return [g[i:i + TOGETHER] for g in groups for i in range(0, len(g), TOGETHER)]
