"""Write docs/sources.md: which verb can use recordings of which source, and the public data sets.

``python -m tools.source_matrix`` writes the page; with ``--check`` it only compares. Each cell follows from the streams
that recordings of the source usually hold (``sources/contents.py``) and what the verb needs (``verb_needs.py``).
"""

import sys
from pathlib import Path

import numpy as np

from nanobench_tools.auditing.usable import missing
from nanobench_tools.auditing.verb_needs import INERTIAL, VERBS
from nanobench_tools.cli.sources import DATASET_KEYS, GOOD_FOR, datasets
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.sources.contents import CONTENTS, Contents

PAGE = Path(__file__).resolve().parents[1] / "docs/sources.md"
HEAD = """# Sources and verbs

These tables show which verb works with which recordings. A cell follows from the streams that recordings of a source
usually have and those that the verb needs. For your recording, `nanobench audit` reports what it suffices for (`can` in
audit.json). Every source works with `audit`; `nanobench columns` drafts a map for any other table.
`python -m tools.source_matrix` writes this page.

## What each verb can do
"""
LIMITS = """
A uSD log, a ULog or an ArduPilot log may also contain motion capture; `convert --mocap` adds it to a uSD log. A column
map adds motors and commands to a bag. Then the cells are those of a recording with these streams.

## Public data sets

`nanobench audit DATA --verbose` computes such a row from your recordings (`dataset` in audit.json). It has rates,
quantities, flights per trajectory, speeds, voltage, and the clock of the inertial sensor.

Facts come from files and pages that were looked at; "unknown" where these do not state one. The project contains none
of these files, and no command downloads them.
"""
PARTS = {"estimate": (INERTIAL, "only --trajectory-dir")}
"""Verb -> what it needs for all of its methods, and what is left without that."""


def page() -> str:
    """The page as Markdown."""
    heads = ["source", *VERBS]
    rows = [[GOOD_FOR[name][0], *(cell(verb, flight_of(held)) for verb in VERBS)] for name, held in CONTENTS.items()]
    known = [[quoted(entry[key] or "not yet") for key in DATASET_KEYS] for entry in datasets()]
    return HEAD + "\n" + table(heads, rows) + LIMITS + "\n" + table(
        ["data set", "read by", "licence", "size", "where", "good for"], known)


def quoted(text: str) -> str:
    """A cell with digits as code: they are facts of a data set, no figures that are computed here."""
    return f"`{text}`" if any(c.isdigit() for c in text) else text


def cell(verb: str, flight: Flight) -> str:
    """``works``, ``in part: ...`` or ``no: what is missing``."""
    lacks = [missing(flight, needed) for needed in VERBS[verb]]
    if None not in lacks:
        return f"no: {lacks[0]}"
    whole, rest = PARTS.get(verb, (None, ""))
    lack = missing(flight, whole) if whole is not None else None
    return "works" if lack is None else f"in part: {rest} ({lack})"


def flight_of(held: Contents) -> Flight:
    """A flight of two rows with these streams."""
    time_s = np.array([0.0, 0.01])
    streams = {name: make_stream(name, time_s, np.zeros((2, len(names))), names) for name, names in held.items()}
    return Flight("usual", streams, {}, Provenance("", "", ""))


def table(heads: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


if __name__ == "__main__":
    if "--check" in sys.argv[1:]:
        sys.exit(0 if PAGE.read_text(encoding="utf-8") == page() else f"{PAGE}: run python -m tools.source_matrix")
    PAGE.write_text(page(), encoding="utf-8")
