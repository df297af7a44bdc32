"""Ratios of the speed benchmarks, as scripts print them and as the kept table holds them.

A ratio is how many times as long the peer, or the plain version, takes as we do in the same run: higher is better.
"""

import csv
import os
import platform
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

TABLE = Path(__file__).with_name("results.csv")
WORSE = 0.75
"""Below this share of the last kept ratio a script got clearly worse; repeats on one quiet machine differ by less."""
LINE = re.compile(r"^ratio \[(?P<name>[^\]]+)\]: (?P<ratio>[0-9.]+) "
                  r"\(n = (?P<n>\d+)(?:, required (?P<required>[0-9.]+))?\)$", re.MULTILINE)


@dataclass(frozen=True)
class Kept:
    """One row of the table; ``n``: repeats, windows or flights, as the script counts them. ``required``: the ratio it
    has to reach, where one was set."""

    script: str
    name: str
    ratio: float
    n: int
    required: float | None
    date: str
    machine: str
    commit: str


def show(name: str, ratio: float, n: int, required: float | None = None) -> None:
    """The line that the runner keeps; ``name`` is peer over ours."""
    print(f"ratio [{name}]: {format(ratio, '.0f' if ratio >= 100.0 else '.3g')} (n = {n}"
          f"{'' if required is None else f', required {required:g}'})", flush=True)


def found_in(text: str) -> list[tuple[str, float, int, float | None]]:
    """(name, ratio, n, required) of every line of ``show`` in what a script printed."""
    return [(m["name"], float(m["ratio"]), int(m["n"]), _number(m["required"])) for m in LINE.finditer(text)]


def _number(cell: str | None) -> float | None:
    return float(cell) if cell else None


def machine() -> str:
    """The kind of machine: ratios are compared with those of the same kind alone."""
    try:
        models = re.findall(r"^model name\s*: (.+)$", Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE)
    except OSError:
        models = []
    return f"{models[0] if models else platform.machine()} x {os.cpu_count()}"


def read(table: Path = TABLE) -> list[Kept]:
    """All rows, oldest first; none without a table."""
    if not table.exists():
        return []
    with table.open(encoding="utf-8", newline="") as rows:
        return [Kept(**{**row, "ratio": float(row["ratio"]), "n": int(row["n"]),
                        "required": _number(row["required"])}) for row in csv.DictReader(rows)]


def add(rows: Iterable[Kept], table: Path = TABLE) -> None:
    """Appends ``rows``."""
    new = not table.exists()
    with table.open("a", encoding="utf-8", newline="") as out:
        writer = csv.DictWriter(out, [f.name for f in fields(Kept)], lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerows(map(asdict, rows))


def worse(rows: Sequence[Kept], before: Sequence[Kept]) -> list[str]:
    """A sentence for each of ``rows`` that lies clearly below the last one kept on this kind of machine."""
    last = {(row.script, row.name, row.machine): row for row in before}
    found = []
    for row in rows:
        old = last.get((row.script, row.name, row.machine))
        if old is not None and row.ratio < WORSE * old.ratio:
            found.append(f"{row.script}, {row.name}: {row.ratio:g}, but {old.ratio:g} on {old.date} ({old.commit})")
    return found


def short_of(rows: Iterable[Kept]) -> list[str]:
    """A sentence for each of ``rows`` that does not reach the ratio it has to."""
    return [f"{row.script}, {row.name}: {row.ratio:g}, required {row.required:g}" for row in rows
            if row.required is not None and row.ratio < row.required]
