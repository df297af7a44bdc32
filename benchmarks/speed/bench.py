"""Runs every script in this folder, keeps its ratios in ``results.csv`` and reports clearly worse ones.

    python benchmarks/speed/bench.py [SCRIPT...] [--no-keep]

``make bench``. Sizes are small, so that all take less than half an hour; a script run alone measures more. Exit code 1
where a script failed, or where a ratio is below its requirement. Also where it is clearly below the last one kept on
the same kind of machine.
"""

import argparse
import subprocess
import sys
import time
from datetime import date
from pathlib import Path

import kept

SPEED = Path(__file__).parent
NO_SCRIPTS = ("bench", "kept")

SMALL = {
    "audit_speed": ("--most", "20"),
    "compiled_rollout": ("--sizes", "small", "--repeats", "1"),
    "diagnose_speed": ("--flights", "5", "10", "--seconds", "20"),
    "filters_speed": ("--seconds", "20"),
    "mpc_speed": ("--steps", "600"),
    "practice_speed": ("--flights", "60"),
    "read_speed": ("--repeat", "1"),
    "served_vehicle": ("--seconds", "8"),
    "smoothers_speed": ("--seconds", "21", "--repeats", "3"),
}
"""Script -> options of a short run; the others are short by themselves."""


def commit() -> str:
    """Of the checkout, with a plus where files were changed."""
    done = subprocess.run(["git", "describe", "--always", "--dirty=+", "--abbrev=10"], cwd=SPEED, capture_output=True,
                          text=True)
    return done.stdout.strip() or "unknown"


def run(script: Path) -> tuple[int, str]:
    """Exit code and what it printed, shown as it comes."""
    words = [sys.executable, str(script), *SMALL.get(script.stem, ())]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        lines = []
        for line in process.stdout:
            print(line, end="", flush=True)
            lines.append(line)
    return process.returncode, "".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scripts", nargs="*", help="names without .py; default: all")
    parser.add_argument("--no-keep", action="store_true", help="compare, but add nothing to the table")
    options = parser.parse_args()
    scripts = [p for p in sorted(SPEED.glob("*.py")) if p.stem not in NO_SCRIPTS]
    if unknown := set(options.scripts) - {p.stem for p in scripts}:
        parser.error(f"no script {', '.join(sorted(unknown))}; there are {', '.join(p.stem for p in scripts)}")
    begun, rows, failed = time.monotonic(), [], []
    before, of_commit = kept.read(), commit()
    for script in scripts:
        if options.scripts and script.stem not in options.scripts:
            continue
        print(f"== {script.stem}", flush=True)
        start = time.monotonic()
        code, text = run(script)
        failed += [script.stem] if code else []
        mine = [kept.Kept(script.stem, *found, date.today().isoformat(), kept.machine(), of_commit)
                for found in kept.found_in(text)]
        rows += mine
        if not options.no_keep:
            kept.add(mine)
        print(f"   {time.monotonic() - start:.0f} s", flush=True)
        failed += [] if code or mine else [f"{script.stem} (no ratio)"]
    lost, short = kept.worse(rows, before), kept.short_of(rows)
    print(f"{len(rows)} ratios in {time.monotonic() - begun:.0f} s"
          + ("" if options.no_keep else f", kept in {kept.TABLE.relative_to(SPEED.parents[1])}"))
    for line in lost:
        print(f"CLEARLY WORSE: {line}")
    for line in short:
        print(f"BELOW ITS REQUIRED RATIO: {line}")
    if failed:
        print(f"FAILED, or missed its own aim: {', '.join(failed)}")
    return int(bool(lost or short or failed))


if __name__ == "__main__":
    sys.exit(main())
