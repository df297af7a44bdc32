"""Damaged copies of a text table, and the check that none of them is read as other numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from nanobench_tools import Flight
from nanobench_tools.sources import load_recordings

SEEDS = (4, pytest.param(12, marks=pytest.mark.slow))
"""For a quick test, and for 108 damaged files of a format."""


@dataclass(frozen=True)
class Damaged:
    """``rows`` (numbers of data rows) may be lost or changed; all others have to be as they were, if it is read."""

    kind: str
    data: bytes
    rows: frozenset[int]
    readable: bool = True
    """Whether it has to be read: damage to single rows must not cost the recording."""


def mutations(data: bytes, seeds: int, delimiter: bytes = b",") -> Iterator[Damaged]:
    """Nine kinds of damage, ``seeds`` of each."""
    header, *rows = data.rstrip(b"\n").split(b"\n")
    n = len(rows)

    def joined(lines: list[bytes], head: bytes = header, end: bytes = b"\n") -> bytes:
        return end.join([head, *lines]) + end

    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        some = sorted(rng.choice(np.arange(1, n - 1), 3, replace=False).tolist())
        at = int(rng.integers(len(header) + len(rows[0]) + 3, len(data)))
        whole = data[:at].count(b"\n") - 1
        yield Damaged("truncated", data[:at], frozenset(range(whole, n)))
        names = header.split(delimiter)
        names[int(rng.integers(0, len(names)))] = b"other"
        yield Damaged("wrong header", joined(rows, delimiter.join(names)), frozenset(), False)
        kept = [delimiter.join([b"nan"] * (row.count(delimiter) + 1)) if k in some else row
                for k, row in enumerate(rows)]
        yield Damaged("rows of nan", joined(kept), frozenset(some))
        kept = [row for k, row in enumerate(rows) for _ in range(2 if k in some else 1)]
        yield Damaged("duplicate rows", joined(kept), frozenset())
        ends = [b"\r\n" if rng.random() < 0.5 else b"\n" for _ in range(n + 1)]
        yield Damaged("mixed line ends", b"".join(line + end for line, end in zip([header, *rows], ends, strict=True)),
                      frozenset())
        kept = [row[: len(row) // 2] if k in some else row for k, row in enumerate(rows)]
        yield Damaged("ragged rows", joined(kept), frozenset(some))
        kept = [b"\x00" * len(row) if k in some else row for k, row in enumerate(rows)]
        yield Damaged("rows of zero bytes", joined(kept), frozenset(some), False)
        kept = [row.replace(b"1", b"x", 4) if k in some else row for k, row in enumerate(rows)]
        yield Damaged("text in cells", joined(kept), frozenset(some))
        yield Damaged("no header", joined(rows[1:], rows[0]), frozenset(), False)


def read_as_before(folder, damaged: Damaged, before: Flight, name: str = "a.csv",
                   whole: bool = False) -> Flight | None:
    """None where it was refused with one line; else every row that was not touched is as before. ``whole``: read the
    folder."""
    (folder / name).write_bytes(damaged.data)
    loaded = load_recordings([folder if whole else folder / name], cache=False)
    if not loaded.flights:
        failure = loaded.failed[0]
        assert "\n" not in failure["error"]
        assert "failed," not in failure["error"], f"{damaged.kind}: {failure['error']}"
        assert not damaged.readable, f"{damaged.kind}: {failure['error']}"
        return None
    (flight,) = loaded.flights
    same(flight, before, damaged)
    return flight


def same(flight: Flight, before: Flight, damaged: Damaged) -> None:
    """Rows of both flights with the same time have the same values, apart from those touched; none is new."""
    for name, stream in flight.streams.items():
        if name not in before.streams:
            raise AssertionError(f"{damaged.kind}: a stream {name} that was none")
        old = before[name]
        touched = np.isin(np.arange(len(old)), sorted(damaged.rows))
        when = old.time_s + before.epoch_s
        at = stream.time_s + flight.epoch_s
        near = np.clip(np.searchsorted(when, at), 1, len(when) - 1)
        near -= np.abs(at - when[near - 1]) < np.abs(at - when[near])
        known = np.abs(at - when[near]) < 1e-5
        assert known.sum() >= len(known) - len(damaged.rows), f"{damaged.kind}: rows of {name} at other times"
        check = known & ~touched[near]
        for k, quantity in enumerate(stream.quantities):
            if quantity in old.quantities:
                now, then = stream.values[check, k], old.values[near[check], old.quantities.index(quantity)]
                np.testing.assert_allclose(now, then, atol=1e-12, err_msg=f"{damaged.kind}: {name}.{quantity}")
