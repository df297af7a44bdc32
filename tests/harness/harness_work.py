"""Small items for the tests of the runner, importable by worker processes; run as a script it is a run to be killed."""

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nanobench_tools import InputError
from nanobench_tools.harness import Item, make_item, run_items

GATED = 8
"""Items before those that wait."""


def score(seed: int, log: str = "", gate: str = "") -> dict:
    """Numbers whose last digit depends on the order of sums, nan and nested types included. Those of seeds from
    ``GATED`` on wait until the file ``gate`` exists."""
    if log:
        with open(log, "a") as file:
            file.write(f"{seed}\n")
    while gate and seed >= GATED and not os.path.exists(gate):
        time.sleep(0.005)
    values = np.random.default_rng(seed).normal(size=20_000)
    return {"mean": values.mean(), "norm": np.linalg.norm(values), "gram": values[:300] @ values[300:600],
            "nan": float("nan"), "n": np.int64(len(values)), "span": (0.0, seed), "by": {seed: values[:3]}}


def fail(path: Path, how: str) -> dict:
    if how == "input":
        raise InputError(str(path), "holds\nno numbers", "give another")
    if how == "type":
        return {"value": object()}
    if how == "exit":
        sys.exit(3)
    if how == "die":
        os._exit(9)
    return {"value": 1 / 0}


def scores(n: int, **kwargs) -> list[Item]:
    return [make_item(score, {"seed": seed, **kwargs}, f"score {seed}") for seed in range(n)]


@dataclass(frozen=True)
class Scored:
    mean_m: float
    by: tuple[int, ...]


def typed(seed: int) -> Scored:
    return Scored(float("nan"), (seed, 1))


if __name__ == "__main__":
    store, log, jobs, gate = sys.argv[1:]
    result = run_items(scores(20, log=log, gate=gate), Path(store), jobs=int(jobs))
    print(result.executed, len(result.values))
