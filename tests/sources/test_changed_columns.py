"""One column of a table removed, renamed or rescaled: right, left out, refused, asked about, assumed or found by the
audit. Never silently wrong."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from test_draft_axes import G, flown

from nanobench_tools import Flight
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.errors import NanobenchError
from nanobench_tools.signals.column_draft import draft_columns
from nanobench_tools.sources import load_recordings

FACTORS = (1e3, 1e-3, 100.0, 0.01, float(np.rad2deg(1.0)), float(np.deg2rad(1.0)))
NAMES = ("x1", "vx", "acc_x", "gyro_z", "m1", "vbat", "yaw", "thrust", "time")
QUICK = ("gyro_y",)
COLUMNS = ("t", *"xyz", "qx", "qy", "qz", "qw", "acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")


def table() -> dict[str, np.ndarray]:
    t, p, _, a, turn, w = flown()
    force = turn.inv().apply(a + G) + 0.05 * np.random.default_rng(6).standard_normal(a.shape)
    columns = np.column_stack([t, p, turn.as_quat(), force, w])
    return dict(zip(COLUMNS, columns.T, strict=True))


def read(folder, columns: Mapping[str, np.ndarray]) -> tuple[Flight, set[str], bool]:
    """The flight, columns whose unit is assumed, and whether there is a question. NanobenchError if refused."""
    rows = [",".join(columns), *(",".join(f"{c:.9g}" for c in row) for row in zip(*columns.values(), strict=True))]
    path, drafted = folder / "flight.csv", folder / "map.toml"
    path.write_text("\n".join(rows) + "\n")
    draft = draft_columns(path)
    drafted.write_text(draft.text)
    loaded = load_recordings([path], columns=drafted, cache=False)
    if loaded.failed:
        raise NanobenchError(loaded.failed[0]["error"])
    assumed = {column for column, status in draft.status.items() if status == "assumed"}
    return loaded.flights[0], assumed, bool(draft.questions)


def wrong(flight: Flight, original: Flight) -> list[str]:
    """Columns with other values than in the original, more than 2 % off."""
    found = []
    for name, stream in flight.streams.items():
        for quantity, column in zip(("time", *stream.quantities), ("t", *stream.columns), strict=True):
            now = stream.time_s if quantity == "time" else stream[quantity]
            there = name in original and quantity in ("time", *original[name].quantities)
            was = (original[name].time_s if quantity == "time" else original[name][quantity]) if there else None
            if was is None or not np.allclose(now, was, atol=0.02 * float(np.nanmax(np.abs(was))), equal_nan=True):
                found.append(column)
    return found


def faults(flight: Flight) -> set[tuple[str, str]]:
    return {(fault.kind, fault.stream) for fault in audit(flight).faults}


def changes(column: str) -> dict[str, dict[str, np.ndarray]]:
    """{what was done: columns of the table}"""
    whole = table()
    found = {"removed": {c: v for c, v in whole.items() if c != column}}
    for name in NAMES:
        if name not in whole:
            found[f"called {name}"] = {name if c == column else c: v for c, v in whole.items()}
    for factor in FACTORS:
        found[f"times {factor:.4g}"] = {**whole, column: factor * whole[column]}
    return found


@pytest.mark.parametrize("column", [pytest.param(c, marks=[] if c in QUICK else pytest.mark.slow) for c in COLUMNS])
def test_a_changed_column_is_never_silently_wrong(tmp_path, column):
    original, _, asked = read(tmp_path, table())
    assert not asked
    known = faults(original)
    silent = []
    for what, columns in changes(column).items():
        try:
            flight, assumed, asked = read(tmp_path, columns)
        except NanobenchError:
            continue
        off = set(wrong(flight, original)) - assumed
        if off and not asked and not faults(flight) - known:
            silent.append(f"{column} {what}: {', '.join(sorted(off))}")
    assert silent == []
