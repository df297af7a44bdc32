"""Results of commands -> docs/figures/SOURCE.json, as docs/figures/SOURCE.toml says.

    command = "nanobench run"                # as a reader would type it
    result = "estimate.json"                 # the file it writes, in the folder of results
    run = ["run", "--out", "{results}"]      # arguments of nanobench, or a script and its arguments; {data}: public
                                             # recordings other than NanoBench's
    slow = false                             # true: only `make figures-slow` runs it
    data = "real: public NanoBench recordings"

    [[picks]]
    key = "clean.{clock}"                    # under which it is stored
    each = {clock = ["as-recorded", "retimed"]}
    from = "rows"                            # a list (one item of it) or a dictionary of the result; may hold "{clock}"
    where = {protocol = "clean", clock = "{clock}", group = "all"}     # "start?": items without `start` are meant, too
    take = {ate = "metrics.ate_rmse_m"}      # name -> path in the item: "." the item itself, "a|b" b where there is no
                                             # a, "a?" null where there is none, "a#" how many entries a has
    worst = "metrics.rmse_m"                 # of several items, the one where this is largest
    optional = true                          # may be missing

Several sources may read the result of one command. A pick finds exactly one item, or says what it found.
"""

import itertools
import json
import re
import tomllib
from pathlib import Path
from typing import Any

from tools.figures.store import FOLDER, FigureError

POINT = re.compile(r"(?<!\d)\.|\.(?!\d)")
"""Between the parts of a path; in a number it is none."""
DIGITS = 6  # significant ones that are kept, so that files change only where figures do


def specs(folder: Path = FOLDER) -> dict[str, dict[str, Any]]:
    """Sources that a command can refresh, by name."""
    read = {p.stem: tomllib.loads(p.read_text()) for p in sorted(folder.glob("*.toml"))}
    return {name: spec for name, spec in read.items() if "result" in spec}


def collect(name: str, spec: dict[str, Any], result: dict[str, Any]) -> dict[str, Any]:
    """The stored form of one source, from the result that its command wrote."""
    figures: dict[str, Any] = {}
    for pick in spec.get("picks", []):
        each = pick.get("each", {})
        for values in itertools.product(*each.values()):
            chosen = dict(zip(each, values, strict=True))
            key = _put_in(pick["key"], {n: re.sub(r"[. ]", "_", v) for n, v in chosen.items()})  # dots and spaces part
            from_, where = _put_in(pick["from"], chosen), _put_in(pick.get("where", {}), chosen)
            item = _find(f"{name}/{key}", result, from_, pick, where)
            if item is not None:
                taken = {n: _walk(item, _put_in(p, chosen), f"{name}/{key}") for n, p in pick["take"].items()}
                _store(figures, key, taken)
    manifest = result.get("manifest", {})
    return {
        "command": spec["command"],
        "data": spec["data"],
        "version": result.get("version", "unknown"),
        "date": str(manifest.get("started", "unknown"))[:10],
        "source_sha256": str(manifest.get("source_sha256", "unknown"))[:12],
        "figures": _round(figures),
    }


def save(name: str, stored: dict[str, Any], folder: Path = FOLDER) -> bool:
    """Write docs/figures/NAME.json; whether anything but the date is new."""
    path = folder / f"{name}.json"
    old = json.loads(path.read_text()) if path.exists() else {}
    dated = ("date", "source_sha256")
    if {k: v for k, v in old.items() if k not in dated} == {k: v for k, v in stored.items() if k not in dated}:
        return False
    path.write_text(json.dumps(stored, indent=1, ensure_ascii=False) + "\n")
    return True


def _find(key: str, result: dict[str, Any], from_: str, pick: dict[str, Any], where: dict[str, Any]) -> Any:
    try:
        place = _walk(result, from_, key)
    except FigureError:
        if pick.get("optional"):
            return None
        raise
    if isinstance(place, dict):
        return place
    found = [i for i in place if all(_same(i, k, v) for k, v in where.items())]
    if len(found) > 1 and "worst" in pick:
        found = [max(found, key=lambda item: float(_walk(item, pick["worst"], key)))]
    if len(found) == 1:
        return found[0]
    if not found and pick.get("optional"):
        return None
    raise FigureError(f"{key}: {len(found)} items of {from_!r} have {where}; one is wanted")


def _same(item: Any, path: str, wanted: Any) -> bool:
    got = _get(item, path.rstrip("?"))
    return bool(got == wanted or (got is None and path.endswith("?")))


def _get(item: Any, path: str) -> Any:
    for part in path.split("."):
        item = item.get(part) if isinstance(item, dict) else None
    return item


def _walk(item: Any, path: str, key: str) -> Any:
    """The part of a result at a dotted path."""
    if path.endswith("#"):
        return len(_walk(item, path[:-1], key))
    may_miss = path.endswith("?")
    for choice in path.rstrip("?").split("|"):
        here = item
        for part in [] if choice == "." else POINT.split(choice):
            if isinstance(here, list) and part.isdigit() and int(part) < len(here):
                here = here[int(part)]
            elif isinstance(here, dict) and part in here:
                here = here[part]
            else:
                break
        else:
            return here
    if may_miss:
        return None
    raise FigureError(f"{key}: no {path!r} in the result")


def _put_in(template: Any, chosen: dict[str, str]) -> Any:
    if isinstance(template, dict):
        return {k: _put_in(v, chosen) for k, v in template.items()}
    if isinstance(template, str):
        for name, value in chosen.items():
            template = template.replace(f"{{{name}}}", value)
    return template


def _store(figures: dict[str, Any], key: str, taken: dict[str, Any]) -> None:
    for part in key.split("."):
        figures = figures.setdefault(part, {})
    figures.update(taken)


def _round(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _round(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_round(v) for v in value]
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    return value
