"""What a computation gives: frozen dataclasses with a short ``repr``, and the one way into JSON and back.

Metadata of a field says how it is in JSON: ``OPTIONAL``, absent where it is None or an empty text; ``INLINE``, its
own keys among those around it; ``named("pass")``, under another key.
"""

import dataclasses
import math
import os
import types
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")

OPTIONAL: Mapping[str, Any] = types.MappingProxyType({"optional": True})
INLINE: Mapping[str, Any] = types.MappingProxyType({"inline": True})

LONGEST = 390
"""Characters of a ``repr``."""


def named(key: str) -> Mapping[str, Any]:
    """Metadata of a field whose JSON key is ``key``."""
    return {"key": key}


class Result:
    """Base of results, which are ``@dataclass(frozen=True, repr=False)``: a ``repr`` that fits a few lines."""

    def __repr__(self) -> str:
        fields = [(field.name, getattr(self, field.name)) for field in dataclasses.fields(self)]  # type: ignore[arg-type]
        text = ", ".join(f"{name}={_short(value)}" for name, value in fields if value is not None)
        return f"{type(self).__name__}({text if len(text) <= LONGEST - 40 else text[:LONGEST - 44] + ' ...'})"


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, str):
        return repr(value if len(value) <= 40 else value[:37] + "...")
    if isinstance(value, np.ndarray):
        return f"<{'x'.join(map(str, value.shape))}>"
    if isinstance(value, Result):
        return f"{type(value).__name__}(...)"
    if isinstance(value, (Mapping, Sequence, set, frozenset)):
        few = len(value) < 3 and not isinstance(value, Mapping)
        return f"[{', '.join(map(_short, value))}]" if few else f"<{len(value)}>"
    return repr(value)[:60]


def to_json(value: Any, nan: Any = None) -> Any:
    """``value`` as JSON types: numpy to lists and numbers, dataclasses to objects, paths to text, keys to text.

    A float that is not finite becomes ``nan`` (default ``None``, JSON's null); with ``nan=float`` it is kept.
    Raises TypeError for anything else, with its type.
    """
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, (float, np.floating)):
        return float(value) if nan is float or math.isfinite(value) else nan
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.ndarray):
        return to_json(value.tolist(), nan)
    if isinstance(value, Mapping):
        return {str(key): to_json(item, nan) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json(item, nan) for item in value]
    if isinstance(value, (set, frozenset)):
        return [to_json(item, nan) for item in sorted(value)]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _object(value, nan)
    raise TypeError(f"a {type(value).__module__}.{type(value).__qualname__} has no place in a JSON file")


def _object(value: Any, nan: Any) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for field in dataclasses.fields(value):
        item = getattr(value, field.name)
        if "inline" in field.metadata:
            found |= to_json(item, nan) or {}
        elif "optional" not in field.metadata or not isinstance(item, (str, types.NoneType)) or item:
            found[field.metadata.get("key", field.name)] = to_json(item, nan)
    return found


def from_json(kind: Any, value: Any) -> Any:
    """Reads back what ``to_json`` wrote for a ``kind``: a dataclass, or a type such as ``list[Row]``.

    null is nan where a float is expected. A dataclass takes the keys of its fields and leaves others alone; a mapping
    that is INLINE takes what no other field has.

    >>> from_json(dict[str, tuple[float, ...]], {"a": [1.0, None]})
    {'a': (1.0, nan)}
    """
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return None if value is None else from_json(next(part for part in parts if part is not type(None)), value)
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        return _instance(kind, value)
    if origin in (dict, Mapping):
        return {int(key) if parts[0] is int else key: from_json(parts[1], item) for key, item in value.items()}
    if origin is tuple and parts[1:] != (...,):
        return tuple(from_json(part, item) for part, item in zip(parts, value, strict=True))
    if origin in (tuple, list, Sequence):
        items = [from_json(parts[0], item) for item in value]
        return tuple(items) if origin is tuple else items
    if kind is np.ndarray:
        return np.array(value, float)
    if kind is Path:
        return Path(value)
    return math.nan if kind is float and value is None else value


def _instance(kind: type[T], value: Mapping[str, Any]) -> T:
    hints, fields = typing.get_type_hints(kind), dataclasses.fields(kind)  # type: ignore[arg-type]
    keys = {field.name: field.metadata.get("key", field.name) for field in fields if "inline" not in field.metadata}
    given = {name: from_json(hints[name], value[key]) for name, key in keys.items() if key in value}
    for field in fields:
        if "inline" in field.metadata:
            others = {key: item for key, item in value.items() if key not in keys.values()}
            given[field.name] = from_json(hints[field.name], others)
    return kind(**given)
