"""The published, the corrected and the clean table of Task 3 on the real recordings."""

import os
from pathlib import Path

import numpy as np
import pytest
from cases_of_task3 import table
from fifteen import FIFTEEN

from nanobench_tools.protocols.published import published
from nanobench_tools.results.result import to_json
from nanobench_tools.sources.discover import load_recordings

CORRECTED = {  # means and SD over flights: n, ATE RMSE, ATE mean, RTE mm, velocity m/s, attitude deg, unaligned mm
    "Slow": (11, (21.1, 3.3), (16.5, 3.2), (28.2, 6.8), (0.069, 0.015), (1.04, 0.36), (23.4, 4.5)),
    "Medium": (8, (21.3, 2.0), (17.2, 1.5), (30.4, 3.1), (0.067, 0.010), (0.97, 0.38), (24.4, 2.6)),
    "Fast": (7, (42.1, 6.0), (33.5, 5.9), (57.7, 14.2), (0.152, 0.033), (1.84, 0.45), (47.9, 8.6))}
METRICS = (("ate_rmse_m", 1e3, 0.06), ("ate_mean_m", 1e3, 0.06), ("rte_1m_m", 1e3, 0.06),
           ("velocity_rmse_m_s", 1.0, 6e-4), ("attitude_rmse_deg", 1.0, 6e-3), ("ate_unaligned_rmse_m", 1e3, 0.06))


def assert_published(rows, groups=("Slow", "Medium", "Fast")):
    printed = published()["task3"]["groups"]
    digits = {"ate_rmse_m": 4, "ate_mean_m": 4, "rte_1m_m": 4, "velocity_rmse_m_s": 3, "attitude_rmse_deg": 2}
    assert list(rows) == [*groups]
    for group, row in rows.items():
        assert row.n == printed[group]["n"]
        for metric, places in digits.items():
            for key in ("mean", "std"):
                assert f"{getattr(row.metrics[metric], key):.{places}f}" == f"{printed[group][metric][key]:.{places}f}"
        assert to_json(row.published.published["ate_rmse_m"]) == printed[group]["ate_rmse_m"]


def assert_corrected(rows):
    for group, (n, *values) in CORRECTED.items():
        assert rows[group].n == n
        for (metric, factor, tolerance), (mean, std) in zip(METRICS, values, strict=True):
            found = rows[group].metrics[metric]
            assert factor * found.mean == pytest.approx(mean, abs=tolerance), (group, metric)
            assert factor * found.std == pytest.approx(std, abs=tolerance), (group, metric)


@pytest.mark.real
def test_the_fast_group_of_the_published_table_to_every_printed_digit(real_data, audits_of):
    """Its seven slices alone; the whole table is a slow proof."""
    files = sorted((real_data / "nanobench" / "benchmarks" / "task3_stateEst").rglob("*_fast_*.csv.xz"))
    flights = load_recordings(files).flights
    assert_published(table(flights, audits_of(flights), "as-published"), ["Fast"])


@pytest.mark.slow
@pytest.mark.real
def test_the_published_table_to_every_printed_digit(real):
    assert_published(table(*real, "as-published"))


@pytest.mark.slow
@pytest.mark.real
def test_the_corrected_table(real):
    assert_corrected(table(*real, "as-published-corrected"))


@pytest.mark.slow
@pytest.mark.real
def test_both_tables_from_the_slices_alone_under_other_names_without_sheets(real_data, audits_of, tmp_path):
    files = sorted((real_data / "nanobench" / "benchmarks" / "task3_stateEst").rglob("*.csv.xz"))
    for i, path in enumerate(np.random.default_rng(0).permutation([os.fspath(f) for f in files])):
        (tmp_path / f"x{i}").symlink_to(path)
    flights = load_recordings([tmp_path]).flights
    assert not any(flight.metadata.get("trajectory_id") for flight in flights)
    audits = audits_of(flights)
    assert_published(table(flights, audits, "as-published"))
    assert_corrected(table(flights, audits, "as-published-corrected"))


@pytest.mark.real
@pytest.mark.slow
def test_the_clean_protocol_on_a_few_trefoils(real):
    """An estimate that is late along the path; as few recordings do, errors scatter about those of all."""
    flights, audits = real
    paths = {f.name: Path(f.provenance.path) for f in flights}  # names of copies elsewhere hold their folder, too
    few = [f for f in flights if paths[f.name].parent.name == "dataset" and f.metadata.get("family") == "trefoil"
           and paths[f.name].name.partition(".")[0] in FIFTEEN]
    rows = table(few, audits, "clean")
    assert (rows["medium/trefoil"].n, rows["fast/trefoil"].n) == (3, 3)
    assert 1e3 * rows["medium/trefoil"].metrics["ate_rmse_m"].mean == pytest.approx(21.0, rel=0.15)
    assert 1e3 * rows["fast/trefoil"].metrics["ate_rmse_m"].mean == pytest.approx(39.4, rel=0.15)
    late = rows["all"].metrics
    assert 0.0 < late["delay_s"].median < 0.05
    assert late["across_track_delay_removed_rmse_m"].median < 2e-3
    assert late["along_track_delay_removed_rmse_m"].median > 0.01


def assert_late(metrics):
    assert metrics["delay_s"].median == pytest.approx(0.0205, abs=0.006)
    assert metrics["across_track_delay_removed_rmse_m"].median < 1.5e-3
    assert metrics["along_track_delay_removed_rmse_m"].median > 0.015


@pytest.mark.slow
@pytest.mark.real
def test_the_clean_protocol_on_trefoils(real):
    flights, audits = real
    trefoils = [f for f in flights if f.metadata.get("family") == "trefoil"]
    rows = table(trefoils, audits, "clean")
    for group, n, ate_mm, attitude_deg in (("slow/trefoil", 12, 20.1, 1.04), ("medium/trefoil", 8, 21.0, 0.99),
                                           ("fast/trefoil", 9, 39.4, 1.75)):
        # The reference is for rows with motor 1 above 1000; airborne rows leave the ground out, where errors are small.
        assert rows[group].n == n
        assert 1e3 * rows[group].metrics["ate_rmse_m"].mean == pytest.approx(ate_mm, rel=0.04)
        assert rows[group].metrics["attitude_rmse_deg"].mean == pytest.approx(attitude_deg, rel=0.04)
    assert_late(rows["all"].metrics)
