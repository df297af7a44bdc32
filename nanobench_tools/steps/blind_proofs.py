"""Blind proof of the diagnosis on made-up cases: what ``nanobench prove`` and ``nb.prove`` share."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..errors import InputError, MissingExtraError
from .diagnosing import ENGINES, check_installed, engine_of_flights
from .options import Options

if TYPE_CHECKING:
    from identification.prove.blind_proof import Proof


def blind_proof(options: Options, n: int, kinds: Sequence[str], engine: str, diagnosed_by: str = ENGINES[0]) -> Proof:
    """Flies n SYNTHETIC cases, seals their truths, diagnoses them, and opens the truths afterwards.

    kinds: empty for all in fixed shares.

    engine: ``practice``, ``rotorpy`` or ``both``; diagnosed_by: one of ``diagnosing.ENGINES``. Raises InputError where
    no case could be made.
    """
    check_installed()
    if engine == "rotorpy" and importlib.util.find_spec("rotorpy") is None:
        raise MissingExtraError("rotorpy", "rotorpy")
    from identification.prove.blind_proof import diagnose_cases, open_and_score, plan, proof_of, seal_cases

    specs = plan(n, options.seed, kinds, engine)
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
    sealed = seal_cases(specs, options.run, options.out, options.seed)
    if not sealed.truths:
        raise InputError("prove", f"no case could be made: {options.failed[0]['error']}")
    options.say(f"{len(sealed.truths)} SYNTHETIC cases, truth sealed {sealed.at}: SHA-256 {sealed.sha256}")
    verdicts = diagnose_cases(sealed, options.run, engine_of_flights(diagnosed_by), options.seed, options.out)
    found = proof_of(sealed, open_and_score(sealed, verdicts, options.out))
    options.detail(f"The truths opened after the verdicts have the hash that was sealed: {sealed.sha256}")
    return found


def proof_sentence(right: int, cases: int, false_names: int) -> str:
    """How often a diagnosis was right, and how often it named what was not there."""
    return f"{right} of {cases} cases right, false names in {false_names}"
