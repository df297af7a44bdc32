"""What a result was made from and with: enough to make it again, nothing that belongs to one machine's folders."""

import platform
import sys
import time
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from ..flight import Flight
from ..version import __version__
from .identity import package_hash

LIBRARIES = ("numpy", "scipy", "pyarrow", "PyYAML", "joblib", "numba", "dask", "distributed")
"""Distributions whose version a result may depend on; those not installed are left out."""

STARTED = time.time()
"""Unix time at which this module was loaded: the start of a run."""


def manifest(inputs: Iterable[Flight | tuple[str, str]] = (), seed: int | None = None,
             argv: Sequence[str] | None = None, started: float | None = None) -> dict[str, Any]:
    """Versions, platform, inputs as [{file, sha256}], seed, command line, start and elapsed time in s.

    ``inputs`` are flights or (path, sha256); of a path only what lies below the working directory is kept, else the
    name. ``argv`` defaults to the command line of this process, ``started`` (Unix s) to the loading of this module.
    """
    started = STARTED if started is None else started
    files = [(f.provenance.path, f.provenance.sha256) if isinstance(f, Flight) else f for f in inputs]
    return {
        "versions": {"nanobench": __version__} | {name: version for name in LIBRARIES if (version := _version(name))},
        "source_sha256": package_hash(),
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
        "inputs": [{"file": portable(path), "sha256": sha256} for path, sha256 in sorted(files)],
        "seed": seed,
        "argv": ["nanobench", *map(portable, sys.argv[1:] if argv is None else argv)],
        "started": datetime.fromtimestamp(started, UTC).isoformat(timespec="seconds"),
        "elapsed_s": round(time.time() - started, 3),
    }


def portable(text: str) -> str:
    """An absolute path as seen from the working directory, or its name alone; any other text unchanged."""
    path = Path(text)
    if not path.is_absolute():
        return str(text)
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else path.name


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
