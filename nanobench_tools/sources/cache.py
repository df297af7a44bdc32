"""Flights already read, kept as Parquet under the hash of the bytes they came from.

An entry is found by the content of the file, the source and its version, never by a path or a date. Pages carry
checksums; an entry that cannot be read or fails its check is read from the source again and replaced.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..flight import Assumption, Fault, Flight, Provenance, Span, Stream
from ..results.cache_folder import cache_folder


@functools.cache
def code_hash() -> str:
    """Of everything that turns bytes into a Flight: a reader that was changed is never answered from old entries."""
    here = Path(__file__).parent
    beside = ("flight.py", "units.py", "frames.py", "settings/values/sources.toml")
    files = [*sorted(here.rglob("*.py")), *sorted(here.rglob("*.toml")), *(here.parent / name for name in beside)]
    return hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).hexdigest()[:16]


def entry_path(sha256: str, source: str, version: int | str) -> Path:
    """Where the entry of a file of this content is, as this ``version`` of this source and this code read it."""
    return cache_folder() / "recordings" / sha256[:2] / f"{sha256}-{source}-{version}-{code_hash()}.parquet"


def store(entry: Path, flight: Flight) -> None:
    """Write an entry; a folder that cannot be written only costs the next read its speed."""
    times: list[np.ndarray] = []
    arrays: list[np.ndarray] = []
    streams = {}
    for name, stream in flight.streams.items():
        clock = next((i for i, t in enumerate(times) if t is stream.time_s), None)
        if clock is None:
            clock = len(times)
            times.append(stream.time_s)
        streams[name] = {
            "clock": clock,
            "first": len(arrays),
            "columns": stream.columns,
            "quantities": stream.quantities,
            "unit": stream.unit,
            "frame": stream.frame,
            "rate_hz": stream.rate_hz,
            "samples": stream.samples,
            "rows": len(stream),
            "valid": stream.valid and [[s.start_s, s.end_s] for s in stream.valid],
        }
        arrays += list(stream.values.T)
    try:
        header = json.dumps({
                                "name": flight.name,
                                "streams": streams,
                                "metadata": dict(flight.metadata),
                                "epoch_s": flight.epoch_s,
                                "source": flight.provenance.source,
                                "synthetic": flight.provenance.synthetic,
                                "notes": flight.provenance.notes,
                                "findings": [list(vars(f).values()) for f in flight.provenance.findings],
                                "assumptions": [list(vars(a).values()) for a in flight.provenance.assumptions],
                                "clocks": [len(t) for t in times],
                            })
    except TypeError:  # a plug-in put something into the metadata that is not JSON: not kept
        return
    rows = max((len(a) for a in (*times, *arrays)), default=0)
    columns = [pa.array(np.pad(a, (0, rows - len(a)), constant_values=np.nan)) for a in (*times, *arrays)]
    table = pa.Table.from_arrays(columns, [str(i) for i in range(len(columns))]).replace_schema_metadata(
        {"flight": header}
    )
    temporary = entry.with_name(f".{entry.name}.{os.getpid()}.{id(flight)}")
    try:
        entry.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table, temporary, compression="none", use_dictionary=False, write_statistics=False,
                       write_page_checksum=True, row_group_size=max(rows, 1))
        os.replace(temporary, entry)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink()


def fetch(entry: Path, path: str, sha256: str) -> Flight | None:
    """The flight of an entry, or None if the entry is missing or damaged."""
    if not entry.is_file():
        return None
    try:
        with pq.ParquetFile(entry, memory_map=True, page_checksum_verification=True) as file:
            head = json.loads(file.schema_arrow.metadata[b"flight"])
            table = file.read(use_threads=False)
        columns = [table.column(i).to_numpy() for i in range(table.num_columns)]
        times = [np.ascontiguousarray(columns[i][:n]) for i, n in enumerate(head["clocks"])]
        values = columns[len(times) :]
        streams = {}
        for name, s in head["streams"].items():
            block = np.empty((s["rows"], len(s["columns"])))
            for i, column in enumerate(values[s["first"] : s["first"] + len(s["columns"])]):
                block[:, i] = column[: s["rows"]]
            valid = s["valid"] if s["valid"] is None else tuple(Span(*v) for v in s["valid"])
            streams[name] = Stream(times[s["clock"]], block, tuple(s["columns"]), tuple(s["quantities"]),
                                   tuple(s["unit"]), s["frame"], s["rate_hz"], s["samples"], valid)
        findings = tuple(Fault(f[0], f[1], tuple(f[2]), *f[3:]) for f in head["findings"])
        provenance = Provenance(path, sha256, head["source"], head["synthetic"], findings, tuple(head["notes"]),
                                assumptions=tuple(Assumption(*a) for a in head["assumptions"]))
        return Flight(head["name"], streams, head["metadata"], provenance, head["epoch_s"])
    except (OSError, pa.ArrowException, ValueError, KeyError, TypeError, IndexError):
        with contextlib.suppress(OSError):
            entry.unlink()
        return None
