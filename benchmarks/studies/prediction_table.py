"""What studies of Task 1 share: their options, the recordings split as ``nanobench sysid`` splits them, and a row."""

import argparse
from collections.abc import Mapping
from pathlib import Path

from nanobench_tools.metrics.prediction import QUANTITIES
from nanobench_tools.protocols import task1
from nanobench_tools.steps.options import Options

COLUMNS = "position m | velocity m/s | attitude rad | rate rad/s after 1, 10, 50 steps"


def asked(doc: str) -> tuple[argparse.Namespace, task1.Split, str]:
    """(arguments, training and test flights on the clock asked for, whether these are real)."""
    parser = argparse.ArgumentParser(description=doc.split("\n")[0])
    parser.add_argument("--clock", default="retimed", choices=["as-recorded", "retimed"])
    parser.add_argument("--data", type=Path, nargs="*", default=())
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    options = Options(data=tuple(args.data), clock=args.clock, quiet=True)
    flights = options.load()
    audits, _ = options.audit(flights)
    return args, task1.split(*options.on_clock(flights, audits)), "SYNTHETIC" if options.synthetic else "real"


def line(name: str, row: Mapping[str, Mapping[str, float]]) -> str:
    return f"{name:<38} " + " | ".join(" ".join(f"{row[q][h]:.4f}" for h in ("1", "10", "50")) for q in QUANTITIES)
