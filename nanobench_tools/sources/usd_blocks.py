"""Binary logs of the Crazyflie uSD deck before events (Crazyswarm, neural-swarm): blocks of rows of one kind.

Little endian. The header is the number of names and each ``name(type),``, then a checksum. Blocks follow: the number of
rows, the rows packed in the order of the names, a checksum. A checksum is the complement of the CRC-32 of its part. The
variable ``tick`` is the time since boot, us in 32 bits. The attitude is a quaternion in 32 bits.
"""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from .. import so3
from ..errors import InputError
from ..flight import Fault, Flight, Provenance, Stream
from .base import text_fault
from .sheets import Sheet
from .usd import DTYPES, FIXED_FREQUENCY, EventType, Log, streams_of

TICK = "tick"
TICK_S = 1e-6
COMPRESSED = "stateEstimateZ.quat"
QUATERNION = tuple(f"stateEstimate.q{a}" for a in "xyzw")
PITCH_RATE = "stateEstimateZ.ratePitch"
MOST_ROWS = 64
"""Of a block; 1 to 24 were seen. A larger number is damage."""
DECIDED = 0.3
"""Correlation with the turning of the attitude from which on the sign of the pitch rate is shown."""
MOVES_RAD_S = 0.1
"""Standard deviation of the turning rate of a vehicle at rest: below it, noise decides the correlation."""
LAG = 8
"""Rows over which the attitude is compared with the rate: 80 ms at 100 Hz, since it is logged with 0.1 deg digits."""
_NAME = re.compile(rb"([A-Za-z_][\w.]*)\(([BbHhIif])\)")


class UsdBlocks:
    """Source ``usd_blocks``."""

    name = "usd_blocks"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        return _header(head) is not None

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        found = _header(data)
        if found is None:
            raise InputError(str(path), "the header of the uSD log is damaged", "take another copy of the file")
        variables, dtype, at = found
        if TICK not in variables:
            raise InputError(str(path), "a uSD log without the variable tick, so its rows have no time",
                             "log tick, too")
        rows, bad, cut = _blocks(data, at, dtype)
        if not len(rows):
            raise InputError(str(path), "a uSD log without a whole row",
                             "logging was never started, or the card lost it")
        ticks = rows[f"v{variables.index(TICK) + 1}"].astype(np.int64)
        ticks += np.concatenate(([0], np.cumsum(np.diff(ticks) < -(1 << 31)))) << 32
        names, records = _records(variables, rows, ticks)
        log = Log(0, {0: EventType(FIXED_FREQUENCY, tuple(names), records.dtype)}, {0: records}, None)
        streams, faults = streams_of(log, {0: records}, int(ticks[0]), TICK_S)
        notes: list[str] = []
        if "imu" in streams and "attitude_qw" in streams:
            streams["imu"], note = _pitch_rate(streams["imu"], streams["attitude_qw"])
            notes.append(note)
        if not streams:
            raise InputError(str(path), "a uSD log without any variable", "its configuration named none")
        end = max(s.span.end_s for s in streams.values())
        return Flight(path.name, streams,
                      {"family": None, "speed": None, "reference_speed_m_s": None, "clock": "seconds since boot",
                       "usd_version": 0, "read_as": notes},
                      Provenance(str(path), "", self.name, findings=(*_faults(bad, cut, end), *faults),
                                 notes=tuple(notes)),
                      epoch_s=float(ticks[0]) * TICK_S)


def _header(data: bytes) -> tuple[list[str], np.dtype, int] | None:
    """Names of the variables, their packed row, and the byte of the first block; None where the checksum is wrong."""
    if len(data) < 8 or not data[0]:
        return None
    at, names, fields = 1, [], []
    for _ in range(data[0]):
        end = data.find(b",", at, at + 80)
        match = _NAME.fullmatch(data[at:end]) if end > 0 else None
        if match is None:
            return None
        names.append(match[1].decode())
        fields.append((f"v{len(names)}", DTYPES[match[2].decode()]))
        at = end + 1
    if len(data) < at + 4 or not _right(data, 0, at) or len(set(names)) < len(names):
        return None
    return names, np.dtype(fields), at + 4


def _right(data: bytes, start: int, end: int) -> bool:
    stored: int = struct.unpack_from("<I", data, end)[0]
    return zlib.crc32(data[start:end]) ^ 0xFFFFFFFF == stored


def _blocks(data: bytes, at: int, dtype: np.dtype) -> tuple[np.ndarray, list[int], int]:
    """Rows of the blocks whose checksums are right, places of those that are wrong, and bytes of a block that was cut
    at the end."""
    size, parts = dtype.itemsize, []
    bad: list[int] = []
    while at < len(data):
        count = data[at]
        end = at + 1 + count * size
        if 0 < count <= MOST_ROWS and end + 4 <= len(data) and _right(data, at, end):
            parts.append(np.frombuffer(data, dtype, count, at + 1))
            at = end + 4
            continue
        following = _next(data, at + 1, size)
        if following is None:
            if bad or not 0 < count <= MOST_ROWS or end + 4 <= len(data):
                bad.append(at)
                return _joined(parts, dtype), bad, 0
            return _joined(parts, dtype), bad, len(data) - at
        bad.append(at)
        at = following
    return _joined(parts, dtype), bad, 0


def _next(data: bytes, at: int, size: int) -> int | None:
    """The next byte from which a block with a right checksum begins."""
    for place in range(at, len(data) - 5 - size + 1):
        count = data[place]
        end = place + 1 + count * size
        if 0 < count <= MOST_ROWS and end + 4 <= len(data) and _right(data, place, end):
            return place
    return None


def _joined(parts: list[np.ndarray], dtype: np.dtype) -> np.ndarray:
    return np.concatenate(parts) if parts else np.empty(0, dtype)


def _records(variables: list[str], rows: np.ndarray, ticks: np.ndarray) -> tuple[list[str], np.ndarray]:
    """The rows as records of an event, with the quaternion unpacked."""
    kept = [v for v in variables if v not in (TICK, COMPRESSED)]
    columns: dict[str, np.ndarray] = {v: rows[f"v{variables.index(v) + 1}"] for v in kept}
    if COMPRESSED in variables:
        unpacked = decompressed(rows[f"v{variables.index(COMPRESSED) + 1}"].astype(np.uint32))
        columns |= {name: unpacked[:, k] for k, name in enumerate(QUATERNION) if name not in columns}
    dtype = np.dtype([("id", "<u2"), ("time", "<u8"), *((f"v{k}", c.dtype) for k, c in enumerate(columns.values(), 1))])
    records = np.zeros(len(rows), dtype)
    records["time"] = ticks
    for k, column in enumerate(columns.values(), start=1):
        records[f"v{k}"] = column
    return list(columns), records


def decompressed(packed: np.ndarray) -> np.ndarray:
    """(n,) uint32 -> (n, 4) x, y, z, w. The two highest bits are the index of the largest element. The others follow
    from the lowest bits, highest index first: a sign, and nine bits of the size over sqrt(1/2)."""
    found = np.zeros((len(packed), 4))
    largest = (packed >> 30).astype(int)
    rest = packed.copy()
    for k in (3, 2, 1, 0):
        here = largest != k
        size = (rest[here] & 0x1FF) / 511.0 / np.sqrt(2.0)
        found[here, k] = np.where(rest[here] & 0x200, -size, size)
        rest[here] >>= 10
    found[np.arange(len(packed)), largest] = np.sqrt(np.maximum(1.0 - (found**2).sum(axis=1), 0.0))
    return found


def _pitch_rate(imu: Stream, attitude: Stream) -> tuple[Stream, str]:
    """The gyro with the sign about y that the attitude shows: the logs have that of our axes, today's firmware the
    other."""
    if "gyro_y" not in imu or PITCH_RATE not in imu.columns or len(attitude) <= 2 * LAG:
        return imu, f"{PITCH_RATE}: the sign is not shown by the data"
    q = so3.make_continuous(attitude[["qx", "qy", "qz", "qw"]])
    step = attitude.time_s[LAG:] - attitude.time_s[:-LAG]
    turned = so3.log(so3.multiply(so3.conjugate(q[:-LAG]), q[LAG:]))[:, 1] / np.where(step > 0.0, step, np.nan)
    middle = 0.5 * (attitude.time_s[LAG:] + attitude.time_s[:-LAG])
    window = np.ones(LAG) / LAG
    smooth = np.convolve(np.nan_to_num(imu["gyro_y"]), window, mode="same")
    seen = np.interp(middle, imu.time_s, smooth)
    known = np.isfinite(turned)
    r = float(np.corrcoef(seen[known], turned[known])[0, 1]) if known.sum() > LAG and np.std(seen[known]) > 0.0 and (
        np.std(turned[known]) > MOVES_RAD_S) else 0.0
    values = imu.values.copy()
    if abs(r) < DECIDED:
        values[:, imu.index("gyro_y")] *= -1.0
        return replace(imu, values=values), f"{PITCH_RATE}: positive nose down, as in other logs of this format; the " \
                                            "attitude turns too little to show it"
    if r < 0.0:
        values[:, imu.index("gyro_y")] *= -1.0
    sign = "nose down" if r < 0.0 else "nose up"
    return replace(imu, values=values), f"{PITCH_RATE}: positive {sign}, as the attitude turns (r {abs(r):.2f})"


def _faults(bad: list[int], cut: int, end: float) -> tuple[Fault, ...]:
    faults = []
    if bad:
        faults.append(text_fault("checksum", "", (), f"the checksums of {len(bad)} blocks are wrong, the first at byte "
                                 f"{bad[0]}; their rows are left out", (0.0, end)))
    if cut:
        faults.append(text_fault("truncated", "", (), f"the log ends inside a block, {cut} bytes after its last whole "
                                 "one", (end, end)))
    return tuple(faults)
