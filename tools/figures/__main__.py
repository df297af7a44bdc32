"""`make figures`: run commands, store what the pages quote, write it into the pages.

    python -m tools.figures                            text from the stored figures only
    python -m tools.figures --results DIR              take over results that lie in DIR, then the text
    python -m tools.figures --results DIR --run quick  run the quick commands into DIR first (slow: the slow ones)
    python -m tools.figures --only thrust ...          these sources alone
    python -m tools.figures --check                    change nothing; exit 1 where text and figures differ
"""

import argparse
import datetime
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from nanobench_tools.version import __version__
from tools.figures import collect, numbers, text
from tools.figures.store import ROOT, FigureError, Store


def pages(root: Path = ROOT) -> list[Path]:
    """The pages whose numbers are written here."""
    return [root / "README.md", *sorted((root / "docs").glob("*.md"))]


def other_data() -> Path | None:
    """Folder of the public recordings other than NanoBench's: crazypad, crazyflie_usd, stand."""
    places = [Path(os.environ.get("NANOBENCH_OTHER_DATA", ".")), ROOT / "data", ROOT.parent / "shared" / "data"]
    return next((p.resolve() for p in places if (p / "crazypad").is_dir()), None)


def run(names: list[str], specs: dict[str, dict[str, Any]], results: Path, speed: str) -> None:
    """Run the commands of these sources, each once, one after another."""
    done, data = set(), other_data()
    for name in names:
        spec = specs[name]
        if data is None and any("{data}" in part for part in spec["run"]):
            print(f"{name}: recordings are not here (NANOBENCH_OTHER_DATA); its figures stay as they are")
            continue
        command = [part.replace("{results}", str(results)).replace("{data}", str(data)) for part in spec["run"]]
        if tuple(command) in done or spec.get("slow", False) != (speed == "slow"):
            continue
        done.add(tuple(command))
        script = command[0].endswith(".py")
        print("running", " ".join(command), flush=True)
        start = [sys.executable] if script else [sys.executable, "-m", "nanobench_tools.cli.main"]
        ended = subprocess.run([*start, *command], cwd=ROOT)
        if ended.returncode not in (0, 1):  # 1: some items failed; they are listed in the result
            raise FigureError(f"{name}: {' '.join(command)} ended with {ended.returncode}")


def take_over(names: list[str], specs: dict[str, dict[str, Any]], results: Path) -> list[str]:
    """Store the figures of every source whose result lies in the folder; what was wrong with the others."""
    problems: list[str] = []
    present = [n for n in names if (results / specs[n]["result"]).exists()]
    for name in present:
        path = results / specs[name]["result"]
        try:
            result = json.loads(path.read_text())
            if "manifest" not in result:  # of a benchmark, which writes its numbers alone
                written = datetime.datetime.fromtimestamp(path.stat().st_mtime, datetime.UTC)
                result |= {"version": __version__, "manifest": {"started": written.isoformat()}}
            new = collect.save(name, collect.collect(name, specs[name], result))
            print(f"{name}: {'new figures' if new else 'as before'} from {path}")
        except (FigureError, ValueError) as error:
            problems.append(f"{path.name}: {error}")
    if not present:
        problems.append(f"{results} holds none of {', '.join(dict.fromkeys(specs[n]['result'] for n in names))}")
    return problems


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.figures", description=__doc__.split("\n")[0])
    parser.add_argument("--results", type=Path, help="folder with results of earlier commands")
    parser.add_argument("--run", choices=["quick", "slow"], help="run these commands into --results first")
    parser.add_argument("--only", nargs="+", default=[], help="sources (docs/figures/NAME.toml)")
    parser.add_argument("--check", action="store_true", help="change nothing; exit 1 where a page is stale")
    given = parser.parse_args(arguments)
    specs = collect.specs()
    names = given.only or list(specs)
    problems: list[str] = []
    try:
        if unknown := [n for n in names if n not in specs]:
            raise FigureError(f"no source {', '.join(unknown)}; there are {', '.join(specs)}")
        if given.results:
            results = given.results.resolve()
            results.mkdir(parents=True, exist_ok=True)
            if given.run:
                run(names, specs, results, given.run)
            problems += take_over(names, specs, results)
        store = Store.load()
        for page in pages():
            problems += check(page, store, given.check)
    except FigureError as error:
        problems.append(str(error))
    print("\n".join(problems), file=sys.stderr)
    return 1 if problems else 0


def check(page: Path, store: Store, only_check: bool = True) -> list[str]:
    """Write a page anew (or say that it is stale); what is wrong with it."""
    old = page.read_text()
    try:
        new = text.render(old, store)
        problems = [f"no longer holds: {claim}" for claim in text.broken_claims(new, store)]
    except FigureError as error:
        return [f"{page.name}: {error}"]
    if new != old and only_check:
        problems.append("stale: run `make figures`")
    elif new != old:
        page.write_text(new)
        print(f"{page.name}: written")
    problems += [f"a number without a table: {piece}" for piece in numbers.without_table(new)]
    return [f"{page.name}: {p}" for p in problems]


if __name__ == "__main__":
    sys.exit(main())
