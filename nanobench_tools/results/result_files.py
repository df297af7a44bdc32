"""Result files: one envelope, plain JSON numbers, written whole or not at all."""

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..version import __version__
from .result import Result, to_json

SURROGATE = re.compile("[\ud800-\udfff]")
"""What Python makes of such bytes; no file can hold it."""


def envelope(schema: str, body: Mapping[str, Any] | Result, synthetic: bool, manifest: Mapping[str, Any],
             failed: list[dict[str, str]]) -> dict[str, Any]:
    """Every result file has ``schema`` (``audit`` becomes ``nanobench-audit/1``) and ``version`` of the package. It
    also has ``synthetic``, ``manifest``, ``failed`` and the keys of ``body``. All of it is JSON types."""
    name = schema if "/" in schema else f"nanobench-{schema}/1"
    found: dict[str, Any] = to_json({"schema": name, "version": __version__, "synthetic": synthetic,
                                     "manifest": manifest, "failed": failed, **to_json(body)})
    return found


def write_bytes(path: Path, data: bytes) -> None:
    """Write ``path`` whole or not at all: a temporary file next to it, flushed to the disk, then renamed.

    The temporary name contains the process id, so that ``sweep`` can identify abandoned ones.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
        with open(temporary, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(str(path), f"cannot be written ({error.strerror or error})") from error


def to_text(value: Mapping[str, Any]) -> str:
    """``value`` as JSON, a line per key and per entry of its lists and tables. Values nan and inf become null, bytes
    of file names that are not UTF-8 become U+FFFD."""
    lines = [f" {_dumps(str(key))}: {_entries(item)}" for key, item in to_json(value).items()]
    return SURROGATE.sub("\ufffd", "{\n" + ",\n".join(lines) + "\n}") + "\n"


def _entries(value: Any) -> str:
    if isinstance(value, dict) and value:
        return "{\n" + ",\n".join(f"  {_dumps(key)}: {_dumps(item)}" for key, item in value.items()) + "\n }"
    if isinstance(value, list) and value and isinstance(value[0], (dict, list)):
        return "[\n" + ",\n".join(f"  {_dumps(item)}" for item in value) + "\n ]"
    return _dumps(value)


def _dumps(value: Any) -> str:
    return json.dumps(value, allow_nan=False, ensure_ascii=False, separators=(", ", ": "))


def write_json(path: Path, value: Mapping[str, Any]) -> None:
    """Writes ``value`` as UTF-8 JSON, whole or not at all; nan and inf become null."""
    write_bytes(Path(path), to_text(value).encode())


def read_json(path: Path, schema: str | None = None) -> dict[str, Any]:
    """Reads a result file; InputError with file and line when it is unreadable, broken, or of another schema."""
    try:
        value = json.loads(Path(path).read_bytes())
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror or error})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: byte {error.start}", "is not UTF-8 text") from error
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: line {error.lineno}", f"is not JSON ({error.msg})") from error
    if not isinstance(value, dict):
        raise InputError(str(path), "holds no JSON object", "a result file of nanobench is one")
    if schema is not None:
        wanted = schema if "/" in schema else f"nanobench-{schema}/1"
        if value.get("schema") != wanted:
            raise InputError(str(path), f"schema is {value.get('schema')!r}", f"{wanted!r} is needed here")
    return value


def sweep(folder: Path) -> None:
    """Removes temporary files in ``folder`` whose writer is gone (killed in the middle of a write)."""
    for part in Path(folder).glob(".*.part"):
        if not _alive(part.name.split(".")[-2]):
            part.unlink(missing_ok=True)


def _alive(pid: str) -> bool:
    """Whether a process still runs; one that ended but was not collected by its parent does not."""
    try:
        os.kill(int(pid), 0)
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except (ProcessLookupError, ValueError, OverflowError):
        return False
    except OSError:  # another user's, or a system without /proc
        return True
