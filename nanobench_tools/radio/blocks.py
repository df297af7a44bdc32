"""Log blocks: which variables the vehicle sends together, how often; from YAML, by default the NanoBench signals.

```yaml
blocks:
  imu: {period_ms: 10, variables: [acc.x, acc.y, acc.z, gyro.x, gyro.y, gyro.z]}
  power: {period_ms: 100, variables: [pm.vbat, {supervisor.info: uint16_t}]}
```
A variable alone is fetched as it is stored on board; ``{name: type}`` fetches it as another type. Limits are the
firmware's (log.c of 2025.12.1): 26 bytes of values a packet, 16 blocks, 128 variables, periods of 10 ms.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..errors import InputError

TYPES: dict[str, tuple[str, int]] = {
    "uint8_t": ("u1", 1), "uint16_t": ("u2", 2), "uint32_t": ("u4", 4), "int8_t": ("i1", 1), "int16_t": ("i2", 2),
    "int32_t": ("i4", 4), "float": ("f4", 4), "FP16": ("f2", 2)}
"""Name of a type in the Crazyflie world -> NumPy's, bytes."""
MOST_BYTES, MOST_BLOCKS, MOST_VARIABLES = 26, 16, 128
PERIOD_MS, LONGEST_MS = 10, 2550
HALF, HALF_SINCE = "FP16", (2026, 8)
"""Type whose values below 0.5, 2, 8 ... the firmware halved before this release (year, month): its rounding lost a
carry."""

DEFAULT: dict[str, tuple[int, tuple[str, ...]]] = {
    "imu": (10, ("acc.x", "acc.y", "acc.z", "gyro.x", "gyro.y", "gyro.z")),
    "motor": (10, ("motor.m1", "motor.m2", "motor.m3", "motor.m4")),
    "estimator": (10, tuple(f"stateEstimate.{n}" for n in ("x", "y", "z", "vx", "vy", "vz"))),
    "estimator_acc": (10, tuple(f"stateEstimate.{n}" for n in ("ax", "ay", "az"))),
    "attitude": (10, tuple(f"stateEstimate.{n}" for n in ("roll", "pitch", "yaw"))),
    "attitude_qw": (10, tuple(f"stateEstimate.{n}" for n in ("qx", "qy", "qz", "qw"))),
    "setpoint": (10, tuple(f"ctrltarget.{n}" for n in ("x", "y", "z", "yaw"))),
    "pid": (10, tuple(f"controller.{n}" for n in ("roll", "pitch", "yaw", "cmd_thrust"))),
    "battery": (100, ("pm.vbat", "supervisor.info")),
}
"""The NanoBench signals, a block for each of its streams; name -> period [ms], variables."""


@dataclass(frozen=True)
class Block:
    """``types`` (k) of ``variables`` (k) as fetched; empty text: the stored type, unknown before a vehicle reported
    it."""

    name: str
    period_ms: int
    variables: tuple[str, ...]
    types: tuple[str, ...]

    @property
    def dtype(self) -> np.dtype:
        """Of a packet's values, packed and little endian."""
        return np.dtype([(v, f"<{TYPES[t][0]}") for v, t in zip(self.variables, self.types, strict=True)])

    @property
    def layout(self) -> struct.Struct:
        codes = {"u1": "B", "u2": "H", "u4": "I", "i1": "b", "i2": "h", "i4": "i", "f4": "f", "f2": "e"}
        return struct.Struct("<" + "".join(codes[TYPES[t][0]] for t in self.types))

    def to_json(self) -> dict[str, Any]:
        return {"name": self.name, "period_ms": self.period_ms, "variables": list(self.variables),
                "types": list(self.types)}

    @classmethod
    def from_json(cls, found: Mapping[str, Any]) -> Block:
        return cls(str(found["name"]), int(found["period_ms"]), tuple(found["variables"]), tuple(found["types"]))


def default_blocks() -> list[Block]:
    """The blocks of the NanoBench format."""
    return [Block(name, period, names, ("",) * len(names)) for name, (period, names) in DEFAULT.items()]


def read_blocks(path: Path) -> list[Block]:
    """Blocks of a YAML file. Raises InputError naming file and block."""
    place = str(path)
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(place, f"cannot be read ({error.strerror})", "check the path") from None
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        raise InputError(f"{place}: line {mark.line + 1}" if mark else place, "no YAML", "mend it") from None
    found = content.get("blocks") if isinstance(content, Mapping) else None
    if not isinstance(found, Mapping) or not found:
        raise InputError(place, "no blocks", "write blocks: {NAME: {period_ms: 10, variables: [acc.x, ...]}}")
    blocks = [_block(f"{place}: block {name!r}", str(name), entry) for name, entry in found.items()]
    check_numbers(blocks, place)
    return blocks


def _block(place: str, name: str, entry: Any) -> Block:
    if not isinstance(entry, Mapping) or set(entry) - {"period_ms", "variables"}:
        raise InputError(place, "should hold period_ms and variables", "and nothing else")
    period, names = entry.get("period_ms", PERIOD_MS), entry.get("variables")
    whole = isinstance(period, int) and not isinstance(period, bool) and period % PERIOD_MS == 0
    if not whole or not PERIOD_MS <= period <= LONGEST_MS:
        raise InputError(place, f"period_ms {period!r}", f"give a multiple of {PERIOD_MS} up to {LONGEST_MS}")
    if not isinstance(names, list) or not names:
        raise InputError(place, "has no variables", "list at least one, such as acc.x")
    pairs = [_variable(place, given) for given in names]
    variables = tuple(variable for variable, _ in pairs)
    if len(set(variables)) < len(variables):
        raise InputError(place, "names a variable twice", "remove one")
    return Block(name, period, variables, tuple(kind for _, kind in pairs))


def _variable(place: str, given: Any) -> tuple[str, str]:
    name, kind = given, ""
    if isinstance(given, Mapping) and len(given) == 1:
        (name, kind), = given.items()
    if not isinstance(name, str) or name.count(".") != 1 or not all(name.split(".")):
        raise InputError(place, f"variable {given!r}", "write group.name, such as gyro.x")
    if kind and kind not in TYPES:
        raise InputError(place, f"type {kind!r} of {name}", f"known: {', '.join(TYPES)}")
    return name, str(kind)


def check_numbers(blocks: Sequence[Block], place: str) -> None:
    """Raises InputError for more blocks, variables or (of known types) bytes than the firmware takes."""
    if len(blocks) > MOST_BLOCKS:
        raise InputError(place, f"{len(blocks)} blocks", f"the vehicle holds {MOST_BLOCKS}")
    variables = sum(len(block.variables) for block in blocks)
    if variables > MOST_VARIABLES:
        raise InputError(place, f"{variables} variables", f"the vehicle holds {MOST_VARIABLES}")
    for block in blocks:
        size = sum(TYPES[kind][1] if kind else 1 for kind in block.types)
        if size > MOST_BYTES:
            raise InputError(f"{place}: block {block.name!r}", f"{size} bytes or more of values, and a packet holds "
                             f"{MOST_BYTES}", "split it into two blocks")


def check_half_precision(blocks: Sequence[Block], firmware: str, place: str) -> None:
    """Raises InputError for variables in half precision from a ``firmware`` that is not known to round them right."""
    halves = sorted({v for b in blocks for v, kind in zip(b.variables, b.types, strict=True) if kind == HALF})
    found = re.match(r"(\d{4})\.(\d{1,2})", firmware)
    if not halves or (found and (int(found[1]), int(found[2])) >= HALF_SINCE):
        return
    raise InputError(place, f"{', '.join(halves)} as FP16 from firmware {firmware or 'of unknown version'}",
                     "before 2026.08 it halves values just below 0.5, 2, 8 ...; log them as float")


def resolve(blocks: Sequence[Block], stored: Mapping[str, str], place: str) -> list[Block]:
    """Blocks with all types known, from ``stored``: variable -> type on board.

    Raises InputError naming every variable that the vehicle does not have, and a block that no packet holds.
    """
    missing = sorted({v for block in blocks for v in block.variables if v not in stored})
    if missing:
        raise InputError(place, f"the vehicle has no log variable {', '.join(missing)}",
                         "another firmware, or leave them out with --blocks")
    found = [Block(b.name, b.period_ms, b.variables,
                   tuple(kind or stored[v] for v, kind in zip(b.variables, b.types, strict=True))) for b in blocks]
    check_numbers(found, place)
    return found
