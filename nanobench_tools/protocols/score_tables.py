"""From one dict of scores per flight to the rows of a table: groups, summaries, intervals."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ..metrics.statistics import Labels, Summary, summary_table
from ..sources.labels import OTHER_FAMILIES


def groups_of(family: str, speed: str | None) -> list[str]:
    """The groups a flight counts in: ``all``, its speed, its family, ``speed/family``."""
    return ["all", *([speed] if speed else []), family, *([f"{speed}/{family}"] if speed else [])]


def summaries(scores: Iterable[Mapping[str, float | None]], seed: int = 0,
              sessions: Labels = None) -> dict[str, Summary]:
    """{metric: summary over flights}; ``scores`` one {metric: value} per flight, ``sessions`` the session of each. None
    and nan count as undefined."""
    scores = list(scores)
    names = list(dict.fromkeys(name for score in scores for name in score))
    values = np.array([[_number(score.get(name)) for name in names] for score in scores], float)
    found = summary_table(values.reshape(len(scores), len(names)), seed, sessions)
    return dict(zip(names, found, strict=True))


def group_order(groups: Sequence[str]) -> list[str]:
    """Each group once: ``all``, families that set nothing, the speeds from slow to fast, the families, and pairs."""
    first = ("all", OTHER_FAMILIES, "slow", "medium", "fast")

    def rank(group: str) -> tuple[int, bool, str]:
        known = group.lower() in first
        return first.index(group.lower()) if known else len(first), "/" in group, group

    return sorted(dict.fromkeys(groups), key=rank)


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
