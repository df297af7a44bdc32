"""Scored trajectories as TUM files, so that any other tool can check the scores."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..flight import Flight
from ..methods import Estimator
from ..metrics.association import associate, snap
from ..results.result_files import write_bytes
from . import aided, whole_flight
from .result_rows import Scored
from .task3 import WHOLE_FLIGHT, Case, score

TRUTH = "truth"


def score_and_write(case: Case, method: Estimator, protocol: str, folder: Path | None,
                    aiding: aided.Aiding | None = None, seed: int = 0) -> Scored:
    """The score of the protocol without the trajectory, which goes to ``folder``/<method>/<flight>.tum (None: nowhere).

    aiding: how poses come in ``aided``, with noise from ``seed``.
    """
    if aiding is not None:
        value = aided.score(case, method, aiding, seed)
    elif protocol == WHOLE_FLIGHT:
        value = whole_flight.score(case, method)
    else:
        value = score(case, method, protocol)
    if folder is not None and value.trajectory is not None:
        write_tum(_path(folder, method.name, case), case.flight, value.trajectory)
    return replace(value, trajectory=None)


def write_missing(done: Iterable[tuple[Estimator, Case, Any]], protocol: str, folder: Path,
                  aiding: aided.Aiding | None = None, seed: int = 0) -> None:
    """Writes the files of items that were answered from the store, or made on another machine."""
    for method, case, _ in done:
        if not _path(folder, method.name, case).exists():
            score_and_write(case, method, protocol, folder, aiding, seed)


def write_truths(cases: Sequence[Case], methods: Sequence[str], folder: Path) -> None:
    """Truth of every flight at all timestamps at which a method was scored, to ``folder``/truth/<flight>.tum."""
    for case in {case.flight.name: case for case in cases}.values():
        mocap = case.flight["mocap"]
        files = [path for name in dict.fromkeys(methods) if (path := _path(folder, name, case)).exists()]
        stamps = [snap(np.loadtxt(path, usecols=0, ndmin=1) - case.flight.epoch_s, mocap.time_s) for path in files]
        time_s = np.unique(np.concatenate(stamps))
        truth = associate(time_s, mocap.time_s, mocap["px", "py", "pz"], mocap["qx", "qy", "qz", "qw"])
        rows = np.column_stack([time_s[truth.kept], truth.position_m, truth.quaternion])
        write_tum(_path(folder, TRUTH, case), case.flight, rows)


def write_tum(path: Path, flight: Flight, trajectory: np.ndarray) -> None:
    """trajectory (n, 8): seconds from the first row, position [m], quaternion; the file has Unix time."""
    absolute = np.column_stack([trajectory[:, 0] + flight.epoch_s, trajectory[:, 1:]])
    lines = (" ".join(f"{value:.9f}" for value in row) for row in absolute.tolist())
    write_bytes(path, ("# time x y z qx qy qz qw\n" + "\n".join(lines) + "\n").encode())


def _path(folder: Path, method: str, case: Case) -> Path:
    return folder / folder_name(method) / f"{folder_name(case.flight.name)}.tum"


def folder_name(name: str) -> str:
    """``name`` with everything but letters, digits, ``.``, ``_`` and ``-`` as ``_``; never empty, ``.`` or ``..``.

    >>> folder_name("../../evil <b>"), folder_name(".."), folder_name("onboard_ekf")
    ('.._.._evil__b_', '__', 'onboard_ekf')
    """
    safe = re.sub(r"[^A-Za-z0-9._-]", "_", name)
    return safe if safe.strip(".") else "_" * max(len(safe), 1)
