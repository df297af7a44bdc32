"""Puts the foreign package where Python finds it, as an installer would, and runs Python and the command beside it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


def placed(folder: Path) -> Path:
    """``folder`` with the package and the ``dist-info`` that an installer writes."""
    shutil.copytree(HERE / "nanobench_foreign", folder / "nanobench_foreign",
                    ignore=shutil.ignore_patterns("__pycache__"))
    about = folder / "nanobench_foreign-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: nanobench-foreign\nVersion: 1.0\n")
    shutil.copy(HERE / "entry_points.txt", about)
    return folder


def python(cwd: Path, path: Path | None, *words: object) -> str:
    """What Python prints, in ``cwd`` with the packages of ``path`` beside ours; fails with what it said."""
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(str(place) for place in (path, ROOT) if place)}
    done = subprocess.run([sys.executable, *map(str, words)], capture_output=True, text=True, timeout=300, env=env,
                          cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


def nanobench(cwd: Path, path: Path | None, *words: object) -> str:
    return python(cwd, path, "-m", "nanobench_tools.cli.main", *words)
