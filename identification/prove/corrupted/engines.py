"""The engines that the test bed scores: functions that give a verdict on recordings and a simulator."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from identification.mismatch import diagnosis
from identification.mismatch.posterior import posterior_engine as posterior
from identification.mismatch.recordings import Recordings
from identification.mismatch.verdict import Verdict
from nanobench_tools.errors import UsageError, did_you_mean
from nanobench_tools.lookup.registry import OURS
from nanobench_tools.lookup.user_folder import load_module
from nanobench_tools.physics import Model

from .kept_results import PHYSICS, READING, code_hash
from .nominal import as_json

CODE = ("identification/mismatch/*", "nanobench_tools/settings/values/mismatch.toml", *PHYSICS, *READING)
"""What every engine of this project is made of."""
Diagnose = Callable[[Recordings, Model, int], Mapping[str, Any]]
"""-> the content of verdict.json. ``corrected``: the corrected simulator as of ``nominal.as_json``, or None."""


@dataclass(frozen=True)
class Engine:
    """name; diagnose; code: hash of what it is made of."""

    name: str
    diagnose: Diagnose
    code: str


def _content(verdict: Verdict) -> Mapping[str, Any]:
    return {**verdict.to_json(), "corrected": None if verdict.corrected is None else as_json(verdict.corrected)}


def by_rules(recordings: Recordings, simulator: Model, seed: int) -> Mapping[str, Any]:
    """The verdict of ``identification.mismatch.diagnosis``."""
    return _content(diagnosis.diagnose(recordings, simulator, seed=seed))


def by_posterior(recordings: Recordings, simulator: Model, seed: int) -> Mapping[str, Any]:
    """The verdict of ``identification.mismatch.posterior``."""
    return _content(posterior.diagnose(recordings, simulator, seed=seed))


WITH_POSTERIOR = (*CODE, "identification/mismatch/posterior/*", "nanobench_tools/settings/values/posterior.toml")
OF_THIS_PROJECT: dict[str, tuple[Diagnose, tuple[str, ...]]] = {
    "rules": (by_rules, CODE),
    "posterior": (by_posterior, WITH_POSTERIOR),
}
"""name: engine, and the files it is made of."""


def engine_of(name: str) -> Engine:
    """One of ``OF_THIS_PROJECT``, or ``module:function`` of another engine. UsageError for anything else."""
    if name in OF_THIS_PROJECT:
        found, files = OF_THIS_PROJECT[name]
        return Engine(name, found, code_hash(files))
    module, _, attribute = name.partition(":")
    if not attribute:
        names = ", ".join(OF_THIS_PROJECT)
        raise UsageError(f"--engine {name} is unknown; {did_you_mean(name, tuple(OF_THIS_PROJECT))}"
                         f"give {names} or module:function")
    try:
        ours = module.partition(".")[0] in OURS
        other = getattr(importlib.import_module(module) if ours else load_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise UsageError(f"--engine {name}: {error}") from error
    return Engine(name, other, code_hash(CODE))
