"""Whether two folders of results hold the same numbers: ``python -m tools.same_numbers BEFORE AFTER``.

Every JSON file below either folder is compared key by key, numbers to the last digit. What differs between any two runs
of the same thing (times, places, commits) is not looked at. Prints every key that differs and the largest relative
difference; exits with 1 if there is one.
"""

import json
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

IGNORED = frozenset({"manifest", "commit", "path", "paths", "started", "finished", "elapsed_s", "wall_s", "seconds",
                     "compute_s", "version"})
"""Keys that say when, where and by which code a result was made."""


@dataclass(frozen=True)
class Difference:
    """``where`` is the file and the key; ``relative`` |before - after| / max(|before|, |after|), inf for what is no
    pair of numbers."""

    where: str
    before: str
    after: str
    relative: float

    def __str__(self) -> str:
        size = "" if math.isinf(self.relative) else f" (relative {self.relative:.3g})"
        return f"{self.where}: {self.before} -> {self.after}{size}"


def differences(before: Any, after: Any, where: str) -> Iterator[Difference]:
    """Of two JSON values, in the order of the first; an absent key is a difference."""
    if isinstance(before, dict) and isinstance(after, dict):
        for key in dict.fromkeys((*before, *after)):
            if key in IGNORED:
                continue
            if key not in before or key not in after:
                yield Difference(f"{where}/{key}", _short(before.get(key, "absent")), _short(after.get(key, "absent")),
                                 math.inf)
            else:
                yield from differences(before[key], after[key], f"{where}/{key}")
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for i, (one, other) in enumerate(zip(before, after, strict=True)):
            yield from differences(one, other, f"{where}[{i}]")
    elif _is_number(before) and _is_number(after):
        if before != after and not (before != before and after != after):
            largest = max(abs(before), abs(after))
            relative = abs(before - after) / largest if math.isfinite(largest) else math.inf
            yield Difference(where, repr(before), repr(after), relative)
    elif type(before) is not type(after) or before != after:
        yield Difference(where, _short(before), _short(after), math.inf)


def compare(before: Path, after: Path) -> list[Difference]:
    """All differences of the JSON files below two folders. Raises ValueError where there is nothing to compare."""
    files = [{path.relative_to(folder).as_posix() for path in folder.rglob("*.json")} for folder in (before, after)]
    if not files[0] or not files[1]:
        raise ValueError(f"{before if not files[0] else after}: holds no JSON file; give a folder of results")
    found = []
    for name in sorted(files[0] | files[1]):
        if name not in files[0] or name not in files[1]:
            here, there = ("absent", "there") if name not in files[0] else ("there", "absent")
            found.append(Difference(name, here, there, math.inf))
        else:
            one, other = (json.loads((folder / name).read_text(encoding="utf-8")) for folder in (before, after))
            found += differences(one, other, name)
    return found


def main(arguments: list[str]) -> int:
    if len(arguments) != 2:
        print("usage: python -m tools.same_numbers BEFORE AFTER", file=sys.stderr)
        return 2
    try:
        found = compare(*map(Path, arguments))
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    for difference in found:
        print(difference)
    sizes = [d.relative for d in found if math.isfinite(d.relative)]
    others = len(found) - len(sizes)
    print(f"{len(sizes)} numbers differ, at most by {max(sizes, default=0.0):.3g} of their size; "
          f"{others} other differences")
    return 1 if found else 0


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
