"""The engines that the test bed scores: functions that give a verdict on recordings and a simulator."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from identification.mismatch.diagnosis import diagnose
from identification.mismatch.recordings import Recordings
from nanobench_tools.errors import UsageError, did_you_mean
from nanobench_tools.lookup.registry import OURS
from nanobench_tools.lookup.user_folder import load_module
from nanobench_tools.physics import Model

from .kept_results import PHYSICS, READING, code_hash
from .nominal import as_json

MISMATCH = "nanobench_tools/settings/values/mismatch.toml"
Diagnose = Callable[[Recordings, Model, int], Mapping[str, Any]]
"""-> the content of verdict.json. ``corrected``: the corrected simulator as of ``nominal.as_json``, or None."""


@dataclass(frozen=True)
class Engine:
    """name; diagnose; code: hash of what it is made of."""

    name: str
    diagnose: Diagnose
    code: str


def rules(recordings: Recordings, simulator: Model, seed: int) -> Mapping[str, Any]:
    """The verdict of ``identification.mismatch.diagnosis``."""
    verdict = diagnose(recordings, simulator, seed=seed)
    return {**verdict.to_json(), "corrected": None if verdict.corrected is None else as_json(verdict.corrected)}


def engine_of(name: str) -> Engine:
    """``rules``, or ``module:function`` of another engine. UsageError for anything else."""
    if name == "rules":
        return Engine(name, rules, code_hash(("identification/mismatch/*", MISMATCH, *PHYSICS, *READING)))
    module, _, attribute = name.partition(":")
    if not attribute:
        raise UsageError(f"--engine {name} is unknown; {did_you_mean(name, ('rules',))}give rules or module:function")
    try:
        ours = module.partition(".")[0] in OURS
        found = getattr(importlib.import_module(module) if ours else load_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise UsageError(f"--engine {name}: {error}") from error
    return Engine(name, found, code_hash(("identification/mismatch", MISMATCH, *PHYSICS, *READING)))
