"""Make the shipped plant again from the public recordings: ``python -m tools.recorded_vehicle nanobench_data``.

The vehicle is what ``nanobench sysid`` fits to the training flights of Task 1, re-timed. Its gate flies the held-out
flights as recorded and re-timed, which sets nothing. Three files are written beside the plant of Task 2.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from nanobench_tools.auditing.selection import distinct
from nanobench_tools.cli.control_plants import SHIPPED_GATE, Chosen, gate_body
from nanobench_tools.errors import NanobenchError
from nanobench_tools.physics.simulator import dumps, loads
from nanobench_tools.protocols.completed import completed
from nanobench_tools.protocols.gate import GateSummary
from nanobench_tools.protocols.task1 import split
from nanobench_tools.steps.options import Options
from nanobench_tools.time_offsets.moving.votes import AS_RECORDED

OUT = Path(__file__).resolve().parents[1] / "controllers/plants"
RETIMED = "retimed"
DRAWS = 100
HEAD = """\
# The vehicle of the NanoBench recordings, which is the plant of Task 2 too: fitted to the training flights of Task 1
# (the earliest recording of each trajectory of circle, figure-8, helix, oval and star; all 15), re-timed, with the
# priors of nanobench sysid. The trim of the motors belongs to flights and is left out. Made by
# python -m tools.recorded_vehicle.
"""
GATE_HEAD = """\
# Of the plant in recorded_vehicle.toml: the recordings it was identified from (start and end, Unix time), and what
# its gate says on the held-out ones (nanobench control --plant gate, all flights of both controllers).
"""
KEPT = ("n", "pass_share", "ratio_share", "lag_share", "gap_share", "ratio_median", "ratio_off_median", "ratio_off_p90",
        "lag_diff_median_s", "lag_off_median_s", "path_gap_median_m", "path_gap_p90_m", "aim")


def _table(name: str, found: GateSummary) -> str:
    def written(value: float | int | bool) -> str:
        return f"{value:.5f}" if isinstance(value, float) else str(value).lower()

    lines = "".join(f"{key} = {written(getattr(found, key))}\n" for key in KEPT)
    return f"\n[summary.{name}]\n{lines}"


def without_trim(fitted: Chosen) -> Chosen:
    """Without the trim of the motors, which belongs to flights: plants draw their own."""
    assert fitted.draws is not None  # an identified plant has them
    names, rows = fitted.draws
    kept = [k for k, name in enumerate(names) if not name.startswith("motor_imbalance")]
    return replace(fitted, simulator=dumps(loads(fitted.simulator).without("motor_imbalance")),
                   draws=(tuple(names[k] for k in kept), [[row[k] for k in kept] for row in rows]))


def main(data: Sequence[Path], out: Path = OUT) -> None:
    """Fit, judge, write."""
    options = Options(data=tuple(data), clock=RETIMED)
    flights = options.load()
    audits, _ = options.audit(flights)
    moved, judged = options.on_clock(flights, audits)
    fitted = Chosen.fitted(options, split(completed(distinct(moved)[0]), judged).train, ", ".join(map(str, data)))
    chosen = without_trim(fitted)
    (out / "recorded_vehicle.toml").write_text(HEAD + chosen.simulator, encoding="utf-8")
    assert chosen.draws is not None  # an identified plant has them
    names, rows = chosen.draws
    with (out / "recorded_vehicle_draws.csv").open("w", encoding="utf-8") as file:
        file.write(",".join(names) + "\n")
        file.writelines(",".join(f"{value:.6g}" for value in row) + "\n" for row in rows[:DRAWS])
    tables = []
    for clock in (RETIMED, AS_RECORDED):
        seen = replace(options, clock=clock)
        moved, judged = seen.on_clock(flights, audits)
        summary = gate_body(seen, moved, judged, chosen, True, flights).summary
        assert summary is not None  # it was requested
        tables.append(_table(clock, summary["all"]))
    spans = "".join(f"    [{start:.2f}, {end:.2f}],\n" for start, end in chosen.trained)
    (out / SHIPPED_GATE).write_text(f"{GATE_HEAD}trained = [\n{spans}]\n{''.join(tables)}", encoding="utf-8")


if __name__ == "__main__":
    try:
        main([Path(one) for one in sys.argv[1:]])
    except NanobenchError as error:
        sys.exit(str(error))
