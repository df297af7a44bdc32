"""From one dict of scores per flight to the rows of a table: groups, summaries, intervals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..metrics.statistics import summary


def groups_of(family: str, speed: str | None) -> list[str]:
    """The groups a flight counts in: ``all``, its speed, its family, ``speed/family``."""
    return ["all", *([speed] if speed else []), family, *([f"{speed}/{family}"] if speed else [])]


def summaries(scores: Iterable[Mapping[str, float | None]], seed: int = 0) -> dict[str, dict[str, Any]]:
    """{metric: summary over flights}; ``scores`` one {metric: value} per flight. None and nan count as undefined."""
    scores = list(scores)
    names = dict.fromkeys(name for score in scores for name in score)
    return {name: summary([_number(score.get(name)) for score in scores], seed) for name in names}


def group_order(groups: Sequence[str]) -> list[str]:
    """Each group once: ``all``, the speeds from slow to fast, the families, and pairs of both."""
    first = ("all", "slow", "medium", "fast")

    def rank(group: str) -> tuple[int, bool, str]:
        known = group.lower() in first
        return first.index(group.lower()) if known else len(first), "/" in group, group

    return sorted(dict.fromkeys(groups), key=rank)


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
