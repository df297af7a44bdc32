"""The published tables of NanoBench, reproduced from the recordings, and corrected: side by side.

    python benchmarks/studies/published_tables.py [--data PATH]

Says for every printed figure whether it came out digit by digit. Figures of Task 1 cannot: converter and test split are
not released. Exit code 1 if a figure of Task 2 or 3 does not match.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from nanobench_tools.cli.control import control_body
from nanobench_tools.cli.estimate import estimate_body, see
from nanobench_tools.cli.options import Options
from nanobench_tools.cli.sysid import sysid_body
from nanobench_tools.protocols.published import published
from nanobench_tools.result import to_json

DECIMALS = {"ate_rmse_m": 4, "ate_mean_m": 4, "rte_1m_m": 4, "velocity_rmse_m_s": 3, "attitude_rmse_deg": 2,
            "rmse_m": 4, "ade_m": 4, "heading_deg": 3, "divergence_percent": 3}
"""Printed digits after the point, in the unit of the name."""


def decimals(task: str, metric: str, value: float) -> int:
    """Digits of a figure: Task 2 prints velocities to four, and a divergence below 0.1 % to four."""
    if task == "task2" and (metric == "velocity_rmse_m_s" or (metric == "divergence_percent" and value < 0.1)):
        return 4
    return DECIMALS[metric]


def same(task: str, metric: str, printed: Mapping[str, float], found: Mapping[str, Any]) -> bool:
    """Whether mean and std have the printed digits."""
    digits = decimals(task, metric, printed["mean"])
    return all(f"{found[key]:.{digits}f}" == f"{printed[key]:.{digits}f}" for key in ("mean", "std"))


def text(task: str, metric: str, found: Mapping[str, Any] | None, printed: Mapping[str, float]) -> str:
    if not found or found.get("mean") is None:
        return "-"
    digits = decimals(task, metric, printed["mean"])
    return f"{found['mean']:.{digits}f} ± {found['std']:.{digits}f}"


def compare(console: Console, task: str, title: str, rows: list[tuple[str, dict, dict, dict | None]]) -> int:
    """Prints (label, published, reproduced, corrected) per metric; gives the number of figures that differ."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for head in ("row", "n", "metric", "published", "reproduced", "digits", "corrected", "n"):
        table.add_column(head, justify="left" if head in ("row", "metric") else "right")
    wrong = 0
    for label, row, metrics, corrected in rows:
        for metric, printed in row["published"].items():
            good = same(task, metric, printed, metrics[metric])
            wrong += not good
            after = (corrected or {}).get("statistics") or (corrected or {}).get("metrics") or {}
            table.add_row(label, str(row["n"]), metric, text(task, metric, printed, printed),
                          text(task, metric, metrics[metric], printed), "same" if good else "DIFFER",
                          text(task, metric, after.get(metric), printed), str((corrected or {}).get("n", "-")))
    console.print(table)
    console.print(f"What was wrong: {published()[task]['faults']}\n")
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, action="append", default=[])
    options = Options(data=tuple(parser.parse_args().data), quiet=True)
    flights = options.load()
    audits, _ = options.audit(flights)
    console = Console(width=150, highlight=False)
    estimate = to_json(estimate_body(options, see(options, flights, audits)).rows)
    mended = {row["group"]: row for row in estimate if row["protocol"] == "as-published-corrected"}
    task3 = [(row["group"], row, row["metrics"], mended.get(row["group"])) for row in estimate if "published" in row]
    control = to_json(control_body(options, flights, audits).rows)
    clean = {row["controller"]: row for row in control
             if row["protocol"] == "clean" and (row["reference"], row["speed"]) == ("trefoil", "medium")}
    task2 = [(row["controller"], row, row["statistics"], clean.get(row["controller"]))
             for row in control if "published" in row]
    wrong = compare(console, "task3", "Task 3, onboard EKF", task3) + compare(console, "task2", "Task 2, flown", task2)
    table = Table(title="Task 1, mean error after 1, 10, 50 steps", title_justify="left", box=box.SIMPLE_HEAD)
    for head in ("model", "metric", "published", "here, clean airborne rows"):
        table.add_column(head)
    for row in (r for r in to_json(sysid_body(options, flights, audits).rows) if "published" in r):
        for metric, printed in row["published"].items():
            table.add_row(row["model"], metric, *(" ".join(f"{v[h]:.4f}" for h in ("1", "10", "50"))
                                                  for v in (printed, row["metrics"][metric])))
    console.print(table)
    console.print(f"What was wrong: {published()['task1']['faults']}")
    figures = sum(len(row["published"]) for _, row, _, _ in task3 + task2)
    console.print(f"\n{figures - wrong} of {figures} figures of Tasks 2 and 3 came out digit by digit.")
    return 0 if figures and not wrong else 1


if __name__ == "__main__":
    raise SystemExit(main())
