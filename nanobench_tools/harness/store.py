"""Finished items on disk: one file per item, named by its key, whole or absent."""

import contextlib
import json
import os
import time
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..results.cache_folder import cache_folder
from ..results.result import to_json
from ..results.result_files import sweep, write_bytes
from .identity import sha256_of


class Store:
    """A folder of finished items. A file is two lines: a header with the hash of the second, and the value.

    A file that is broken in any way counts as absent and is written anew. ``keep_days`` is for a folder that nobody
    else tidies up: files not asked for that long are removed.
    """

    def __init__(self, folder: Path, keep_days: float | None = None) -> None:
        self.folder = Path(folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(str(folder), f"is no folder that can be written to ({error.strerror or error})") from error
        sweep(self.folder)
        if keep_days is not None:
            self._forget(time.time() - keep_days * 86400.0)

    def path(self, key: str) -> Path:
        return self.folder / f"{key}.json"

    def get(self, key: str) -> dict[str, Any] | None:
        """The value of a finished item, or None."""
        try:
            header, _, body = self.path(key).read_bytes().partition(b"\n")
            known = json.loads(header)
            if known["key"] == key and known["sha256"] == sha256_of(body):
                value: dict[str, Any] = json.loads(body)
                os.utime(self.path(key))
                return value
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return None

    def _forget(self, before_s: float) -> None:
        for path in self.folder.glob("*.json"):
            with contextlib.suppress(OSError):
                if path.stat().st_mtime < before_s:
                    path.unlink()

    def put(self, key: str, value: dict[str, Any], label: str = "") -> None:
        """Writes a value (as ``encode`` gives it); nan is kept."""
        body = json.dumps(value).encode()
        header = json.dumps({"key": key, "label": label, "sha256": sha256_of(body)}).encode()
        write_bytes(self.path(key), header + b"\n" + body)


def encode(value: Any) -> dict[str, Any]:
    """A value as it comes back from the store, so that fresh and stored ones are equal; nan is kept."""
    return dict(to_json(value, nan=float))


USER_STORE_DAYS = 30.0


def user_store() -> Path | None:
    """The default folder: below the cache folder, without entries unused for a month. None if it cannot be made."""
    folder = cache_folder() / "items"
    try:
        Store(folder, keep_days=USER_STORE_DAYS)
    except InputError:
        return None
    return folder
