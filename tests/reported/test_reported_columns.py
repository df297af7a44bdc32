"""Reported tables with one column removed, renamed, negated, exchanged or rescaled: never silently wrong."""

import numpy as np
import pytest

from benchmarks.studies.column_mutations import SUFFIXES, mutations, outcome, read, sheet_of

DRAWN = 4
"""Changes of each table; the study makes all of them."""


@pytest.mark.real
@pytest.mark.slow
def test_a_drawn_change_of_a_column_is_never_silently_wrong(reported, tmp_path):
    rng = np.random.default_rng(46)
    silent, tables = [], 0
    for table in sorted(p for p in reported.rglob("*") if p.suffix in SUFFIXES):
        path = tmp_path / table.name
        path.write_bytes(table.read_bytes())
        if (whole := read(path)) is None:
            continue
        tables += 1
        changed = list(mutations(sheet_of(table.read_text(encoding="utf-8-sig"))))
        for k in rng.choice(len(changed), min(DRAWN, len(changed)), replace=False):
            path.write_text(changed[k][1].text(), encoding="utf-8")
            kind, where = outcome(whole, read(path))
            silent += [f"{table.parent.name}/{table.name}: {changed[k][0]}: {where}"] * (kind == "SILENT")
        path.unlink()
    assert tables > 10
    assert silent == []
