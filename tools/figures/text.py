"""Marks in the pages, and the text they stand for.

    <!-- table: SOURCE/NAME --> ... <!-- /table -->     a table (tables.py); `settings`: the numbers set by looking at
                                                       data; a `?` behind a name: nothing while nothing is stored
    <!-- holds: KEY < KEY -->                          what a sentence claims: < > or =, a key, number or word

A cell is text with {KEY FORMAT} or {code:MODULE:NAME FORMAT} in braces. FORMAT is a scale and the number of decimals:
`mm.1`, `%.0`, `.3`; a `+` before it shows the sign. Text and counts need none. Two numbers are an interval, `lo .. hi`;
a `,` behind the format makes them a list. Marks in fenced code are code.
"""

import importlib
import math
import re
from functools import partial
from typing import Any

from tools.figures import tables
from tools.figures.store import FigureError, Store

SCALES = {"": 1.0, "mm": 1e3, "cm": 1e2, "ms": 1e3, "%": 1e2, "deg": 180.0 / math.pi, "mN": 1e3, "e-5": 1e5, "e-8": 1e8}
BLOCK = re.compile(r"<!-- table: (\S+) -->\n(.*?)<!-- /table -->", re.DOTALL)
HOLDS = re.compile(r"<!-- holds: (\S+) ([<>=]) (\S+) -->")
FENCE = re.compile(r"(^```.*?^```$)", re.DOTALL | re.MULTILINE)
KEYS = re.compile(r"<!-- (?:table|holds): (\S+)")
FORMAT = re.compile(r"(\+?)([^.+]*)\.(\d)(,?)")


def show(value: Any, form: str | None = None, where: str = "") -> str:
    """A value as text: `show(0.0125, "mm.1")` is "12.5"."""
    if value is None:
        return "–"
    if isinstance(value, list):
        listed = form is None or form.endswith(",")
        return (", " if listed else " .. ").join(show(v, form, where) for v in value) or "–"
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "yes" if value else "no"
    if form is None:
        if isinstance(value, int):
            return f"{value:,d}"
        raise FigureError(f"{where}: {value!r} needs a format such as mm.1")
    match = FORMAT.fullmatch(form)
    if match is None or match[2] not in SCALES:
        raise FigureError(f"{where}: no format {form!r}; scales are {', '.join(s for s in SCALES if s)}")
    return f"{value * SCALES[match[2]]:{match[1]},.{match[3]}f}"


def constant(name: str) -> Any:
    """A constant of the code: `package.module:NAME`, `package.module:NAME.attribute` or `...:TABLE.key`."""
    module, _, path = name.partition(":")
    try:
        here: Any = importlib.import_module(module)
    except ImportError as error:
        raise FigureError(f"{name}: {error}") from None
    for part in path.split("."):
        if isinstance(here, dict) and part in here:
            here = here[part]
        elif hasattr(here, part):
            here = getattr(here, part)
        else:
            raise FigureError(f"{name}: no {part!r}")
    return here


def fill(template: str, store: Store, base: str = "") -> str:
    """A cell with its values; keys without a source begin at `base`.

    [?text with {KEY}] is left out where nothing is stored for a key in it; [KEY? text] is left out where KEY is nothing
    or 0, [KEY! text] where it is more.
    """

    def whole(key: str) -> str:
        return key if "/" in key else f"{base}.{key}" if "/" in base else f"{base}/{key}"

    def stored(match: re.Match[str]) -> str:
        keys = [whole(k.partition(" ")[0]) for k in re.findall(r"\{([^{}]+)\}", match[1])]
        return match[1] if all(store.has(k) and store.node(k) is not None for k in keys) else ""

    def one(match: re.Match[str]) -> str:
        key, _, form = match[1].partition(" ")
        if key.startswith("code:"):
            return show(constant(key[5:]), form or None, key)
        return show(store.value(whole(key)), form or None, key)

    def asked(match: re.Match[str]) -> str:
        key = whole(match[1])
        return match[3] if bool(store.has(key) and store.node(key)) == (match[2] == "?") else ""

    template = re.sub(r"\[\?(.*?)\]", stored, template)
    template = re.sub(r"\[([^][{}?! ]+)([?!]) ?(.*?)\]", asked, template)
    return re.sub(r"\{([^{}]+)\}", one, template).replace("– %", "–").replace(": –", "").replace(" (–)", "")


def render(text: str, store: Store) -> str:
    """The page with every mark filled anew."""
    return "".join(part if k % 2 else _render(part, store) for k, part in enumerate(FENCE.split(text)))


def _render(text: str, store: Store) -> str:
    def block(match: re.Match[str]) -> str:
        key = match[1]
        if key.endswith("?") and key.partition("/")[0] not in store.sources:
            return f"<!-- table: {key} -->\n<!-- /table -->"  # nothing is stored for it yet
        if key == "settings":
            lines = tables.settings()
        else:
            lines = tables.table(key.rstrip("?"), store, partial(fill, store=store))
        return f"<!-- table: {key} -->\n\n{lines}\n\n<!-- /table -->"

    strays = re.search(r"<!--.*?(?:-->|$)", HOLDS.sub("", BLOCK.sub("", text)), re.DOTALL)
    if strays:
        raise FigureError(f"not a mark: {strays[0]}")
    return BLOCK.sub(block, text)


def used(text: str) -> list[str]:
    """Sources that a page quotes, in order, each once."""
    names = (key.partition("/")[0] for key in KEYS.findall(FENCE.sub("", text)))
    return [n for n in dict.fromkeys(names) if n != "settings"]


def broken_claims(text: str, store: Store) -> list[str]:
    """Claims of a page (`holds`) that the stored figures contradict."""
    broken = []
    for left, sign, right in HOLDS.findall(FENCE.sub("", text)):
        a, b = (store.value(k) if "/" in k else k for k in (left, right))
        if sign == "=":
            so = str(a) == str(b)
        else:
            so = None not in (a, b) and (float(a) < float(b) if sign == "<" else float(a) > float(b))
        if not so:
            broken.append(f"{left} {sign} {right}: {a} and {b}")
    return broken
