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
    """Each group once: ``all`` first, then speeds, families, and pairs, as they come."""
    return sorted(dict.fromkeys(groups), key=lambda g: (g != "all", g not in ("slow", "medium", "fast"), "/" in g,
                                                        ("slow", "medium", "fast").index(g) if g in
                                                        ("slow", "medium", "fast") else 0, g))


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
