"""From a raw recording to the NanoBench format: CSV, sheet with the true numbers of packets, and raw Parquet.

Every sample gets the host's time at which the vehicle took it (``align``), not the time at which its packet came. Rows
are the poses of the motion capture that lie where all main streams have packets on both sides. Between packets values
are interpolated linearly, as the format does, and ``row_counts`` has the true number of packets. The set-points come
from the vehicle's own log, except where a controller on the host followed the path. Then they come from the host, as
the vehicle does not know the path (``setpoint_source: host`` in the sheet).

How a recorded flight ended whose link was lost in the air: the poses go on, and show a landing or a fall.
"""

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import so3
from ..errors import InputError
from ..flight import Flight, Provenance, Stream, make_stream
from ..practice.mocap import WINDOW, body_rate, savgol_derivative
from ..sources.known import Known, ecosystem
from ..sources.nanobench_columns import STREAMS
from ..sources.nanobench_writer import write_nanobench
from ..units import factor
from .align import TICK_S, Alignment, align, ticks_of
from .blocks import Block
from .mocap.pose_datagram import unpack
from .mocap.pose_source import seen
from .packets import ECHO, LOG, LOOP, NOTE, POSE, REFERENCE, TEXT, Packets, Record, read_packets
from .recorder import RAW_FOLDER

AIR_M = 0.1
"""Height above the lowest pose from which on a vehicle is in the air."""
AFTER_S = 0.3
"""The log ended at least so long before the poses."""
FALLS_M_S, OVER_S = 1.8, 0.05
"""Landings of the vehicle's planner sink with 1.3 m/s at most; a fall has reached this speed after 17 cm. Measured over
OVER_S, so that the noise of single poses does not count."""
TUMBLED_DEG = 60.0
LANDED, FELL, UNKNOWN = "landed", "fell", "unknown"


def lost_link(time_s: np.ndarray, position_m: np.ndarray, quaternion: np.ndarray, logged_s: float) -> dict[str, Any]:
    """For the sheet: ``how`` the flight ended, ``height_m`` at the last log, ``sank_m_s``. Empty if it did not end so.

    Parameters
    ----------
    time_s, position_m, quaternion : ndarray
        Poses (n,), (n, 3), (n, 4), world, in the order of time.
    logged_s : float
        Time of the last log packet.
    """
    if len(time_s) < 2 or not time_s[0] < logged_s:
        return {}
    ground_m = float(position_m[:, 2].min())
    height_m = float(np.interp(logged_s, time_s, position_m[:, 2])) - ground_m
    after = time_s > logged_s
    if height_m < AIR_M:
        return {}
    found: dict[str, Any] = {"how": UNKNOWN, "height_m": round(height_m, 3)}
    if not after.any() or time_s[-1] - logged_s < AFTER_S:
        return found | {"why": "no poses after it"} if not after.any() else {}
    t, z = time_s[after], position_m[after, 2]
    sank = float(np.max((z - np.interp(t + OVER_S, t, z)) / OVER_S))
    up = so3.rotate(quaternion[-1], np.array([0.0, 0.0, 1.0]))[2]
    found["sank_m_s"] = round(max(sank, 0.0), 2)
    if sank > FALLS_M_S or np.degrees(np.arccos(np.clip(up, -1.0, 1.0))) > TUMBLED_DEG:
        return found | {"how": FELL}
    if z[-1] - ground_m < AIR_M:
        return found | {"how": LANDED}
    return found | {"why": "in the air at the last pose"}


OWN = {"setpoint": {"yaw": (Known("ctrltarget.yaw", unit="deg"),)}}
"""The format keeps what the firmware calls ctrltarget.yaw (a rate) in a column of degrees."""
SHORTEST_S = 1.0
MOCAP = ("px", "py", "pz", "qx", "qy", "qz", "qw", "roll", "pitch", "yaw", "vx", "vy", "vz", "wx", "wy", "wz")
SLOW = ("battery",)
"""Streams that may end a little before the rows do: their last value is held."""


@dataclass(frozen=True)
class BlockData:
    """Packets of one block: arrival_s (n,) on the host, time_s (n,) on the host's clock when they were taken, tick_s
    (n,) unwrapped, values: structured (n,)."""

    block: Block
    arrival_s: np.ndarray
    tick_s: np.ndarray
    time_s: np.ndarray
    values: np.ndarray


@dataclass(frozen=True)
class Exported:
    """csv: the recording; parquet: folder of raw tables; counts: packets by stream; alignment; notes in words."""

    csv: Path
    parquet: Path
    counts: dict[str, int]
    alignment: Alignment
    notes: tuple[str, ...]


def export(raw: Path, folder: Path | None = None, stamps: str = "aligned") -> Exported:
    """Writes NAME.csv, NAME_metadata.yaml and .raw/NAME/*.parquet into ``folder`` (by default where the raw recording
    was made). ``stamps``: ``aligned``, or ``arrival`` for times of arrival as other loggers write them.

    Raises InputError for a file that is no raw recording or holds too little.
    """
    packets = read_packets(raw)
    name = raw.name.removesuffix(raw.suffix)
    if folder is None:
        folder = raw.parent.parent if raw.parent.name == RAW_FOLDER else raw.parent
    data, alignment = blocks_of(packets, str(raw), stamps)
    notes = [packets.cut] if packets.cut else []
    flight = flight_of(packets, data, alignment, name, str(raw))
    csv = write_nanobench(flight, folder / f"{name}.csv")
    tables = folder / RAW_FOLDER / name
    write_parquet(tables, packets, data)
    counts = {n: int(s.samples or 0) for n, s in flight.streams.items()}
    return Exported(csv, tables, counts, alignment, tuple(notes))


def blocks_of(packets: Packets, place: str, stamps: str = "aligned") -> tuple[list[BlockData], Alignment]:
    """Every block that has packets, on the host's clock. Packets of a wrong length or a repeated tick are left out."""
    blocks = [Block.from_json(entry) for entry in packets.header["blocks"]]
    found = []
    for number, block in enumerate(blocks):
        size = 3 + block.dtype.itemsize
        records = [r for r in packets.of(LOG, number) if len(r.payload) == size]
        if records:
            found.append((block, records))
    if not found:
        raise InputError(place, "holds no log packets", "was the link up?")
    arrivals = [np.array([r.time_s for r in records]) for _, records in found]
    ticks = [np.array([int.from_bytes(r.payload[:3], "little") for r in records], float) for _, records in found]
    unwrapped = ticks_of(ticks, arrivals)
    echoes = np.array([r.time_s - struct.unpack("<d", r.payload)[0] for r in packets.of(ECHO)])
    alignment = align(np.concatenate(arrivals), np.concatenate(unwrapped), echoes)
    return [_block_data(block, records, arrival, tick, alignment, stamps) for (block, records), arrival, tick in
            zip(found, arrivals, unwrapped, strict=True)], alignment


def _block_data(block: Block, records: list[Record], arrival: np.ndarray, tick: np.ndarray, alignment: Alignment,
                stamps: str) -> BlockData:
    values = np.frombuffer(b"".join(r.payload[3:] for r in records), block.dtype)
    time = alignment.host(tick) if stamps == "aligned" else arrival
    order = np.argsort(tick, kind="stable")
    kept = order[np.concatenate([[True], np.diff(tick[order]) > 0.5 * TICK_S])]
    if stamps != "aligned":  # two packets may be read in one go: times have to rise
        kept = kept[np.concatenate([[True], np.diff(time[kept]) > 0.0])]
    return BlockData(block, arrival[kept], tick[kept], time[kept], values[kept])


def flight_of(packets: Packets, data: list[BlockData], alignment: Alignment, name: str, place: str) -> Flight:
    """The recording as a Flight, rows on the poses."""
    raw = _streams(data)
    sheet = dict(packets.sheet)
    commanded = packets.of(REFERENCE)
    if commanded:
        raw["setpoint"] = _commanded(commanded, raw.get("setpoint"))
        sheet["setpoint_source"] = "host"
    poses = [pose for pose in (unpack(r.payload) for r in packets.of(POSE)) if seen(pose)]
    stamps = np.array([pose.time_s for pose in poses])
    rises = np.concatenate([[True], np.diff(np.maximum.accumulate(stamps)) > 0.0]) if len(stamps) else stamps > 0
    stamps = stamps[rises]
    main = [s for n, s in raw.items() if n not in SLOW and not (n == "setpoint" and commanded)]
    first, last = max(s.time_s[0] for s in main), min(s.time_s[-1] for s in main)
    inside = (stamps >= first) & (stamps <= last)
    kept = [pose for pose, rise in zip(poses, rises, strict=True) if rise]
    if len(stamps):
        if inside.sum() < max(WINDOW, SHORTEST_S / 0.01):
            raise InputError(place, f"{int(inside.sum())} poses while the log ran", "nothing to export")
        raw["mocap"] = _mocap(stamps[inside], [p for p, here in zip(kept, inside, strict=True) if here])
    base = raw["mocap"] if "mocap" in raw else max(main, key=len)
    epoch = float(base.time_s[0])
    span = base.time_s[0], base.time_s[-1]
    streams = {n: _on_span(n, s, span, epoch) for n, s in raw.items()}
    sheet |= {"recorder": {"raw": f"{RAW_FOLDER}/{name}", "clock": alignment.to_json(), **loop_of(packets),
                           **_end(kept, max(float(s.time_s[-1]) for s in main))}}
    battery = streams.get("battery")
    if battery is not None and len(battery):
        sheet |= {"battery_voltage_start": float(battery["vbat"][0]), "battery_voltage_end": float(battery["vbat"][-1])}
    provenance = Provenance(place, "", "radio", synthetic=bool(sheet.get("synthetic")))
    return Flight(name, streams, sheet, provenance, epoch_s=epoch)


def _end(poses: list[Any], logged_s: float) -> dict[str, Any]:
    """How the flight ended if its link was lost in the air, for the sheet; {} for others."""
    if not poses:
        return {}
    found = lost_link(np.array([p.time_s for p in poses]), np.array([p.position_m for p in poses]),
                      np.array([p.quaternion for p in poses]), logged_s)
    return {"lost_link": found} if found else {}


def loop_of(packets: Packets) -> dict[str, dict[str, float]]:
    """How late the host's loop was, for the sheet; {} if that was not recorded."""
    late_ms = np.array([1e3 * struct.unpack("<d", r.payload)[0] for r in packets.of(LOOP)])
    if not len(late_ms):
        return {}
    p50, p99, most = np.percentile(late_ms, [50, 99, 100])
    return {"loop": {"ticks": len(late_ms), "late_p50_ms": round(float(p50), 3), "late_p99_ms": round(float(p99), 3),
                     "late_most_ms": round(float(most), 3)}}


def _streams(data: list[BlockData]) -> dict[str, Stream]:
    """Streams of the format that the logged variables give; a stream needs all its variables in one block."""
    found: dict[str, Stream] = {}
    for part in data:
        logged = set(part.block.variables)
        for name, columns in STREAMS.items():
            options = {**ecosystem("crazyflie").streams.get(name, {}), **OWN.get(name, {})}
            chosen = {c.quantity: next((v for v in options.get(c.quantity, ()) if v.name in logged), None)
                      for c in columns}
            if name == "mocap" or None in chosen.values() or len(found.get(name, ())) >= len(part.time_s):
                continue
            values = np.stack([v.sign * factor(v.unit) * part.values[v.name].astype(float) + v.offset
                               for v in chosen.values() if v is not None], axis=1)
            found[name] = make_stream(name, part.time_s, values, [c.quantity for c in columns],
                                      [c.name for c in columns])
    if not found:
        raise InputError("recording", "none of the NanoBench streams is in the logged blocks",
                         "the raw packets are kept; log whole groups such as acc and gyro in one block")
    return found


def _commanded(records: list[Record], logged: Stream | None) -> Stream:
    """References of the host in flight, and of the vehicle's planner before and after."""
    time = np.array([r.time_s for r in records])
    rows = np.array([struct.unpack("<4d", r.payload) for r in records])
    if logged is not None:
        before, after = logged.time_s < time[0], logged.time_s > time[-1]
        time = np.concatenate([logged.time_s[before], time, logged.time_s[after]])
        rows = np.concatenate([logged.values[before], rows, logged.values[after]])
    return make_stream("setpoint", time, rows, ("x", "y", "z", "yaw"), [c.name for c in STREAMS["setpoint"]])


def _mocap(time_s: np.ndarray, poses: list[Any]) -> Stream:
    """The 16 columns of motion capture, velocities and rates made as in the published files."""
    place = np.array([pose.position_m for pose in poses])
    turn = np.array([pose.quaternion for pose in poses])
    turn = so3.make_continuous(turn / np.linalg.norm(turn, axis=1, keepdims=True) * np.where(turn[:1, 3:] < 0, -1, 1))
    values = np.concatenate([place, turn, so3.euler_zyx(turn), savgol_derivative(time_s, place),
                             body_rate(time_s, turn)], axis=1)
    return make_stream("mocap", time_s, values, MOCAP, [c.name for c in STREAMS["mocap"]])


def _on_span(name: str, stream: Stream, span: tuple[float, float], epoch: float) -> Stream:
    """Times from ``epoch``; samples: packets inside the span; slow streams and host set-points are held to its ends."""
    inside = (stream.time_s >= span[0]) & (stream.time_s <= span[1])
    count = int(inside.sum())
    first, last = max(int(np.argmax(inside)) - 1, 0), min(len(inside) - int(np.argmax(inside[::-1])), len(inside) - 1)
    time, values = stream.time_s[first:last + 1], stream.values[first:last + 1]
    if len(time) and time[0] > span[0]:
        time, values = np.concatenate([[span[0]], time]), np.concatenate([values[:1], values])
    if len(time) and time[-1] < span[1]:
        time, values = np.concatenate([time, [span[1]]]), np.concatenate([values, values[-1:]])
    return make_stream(name, time - epoch, values, stream.quantities, stream.columns, samples=count,
                       rate_hz=count / max(span[1] - span[0], 1e-9))


def write_parquet(folder: Path, packets: Packets, data: list[BlockData]) -> None:
    """One table a block (host_time_s, aligned_time_s, tick_s and the variables as logged), poses, and notes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        folder.mkdir(parents=True, exist_ok=True)
        for part in data:
            columns = {"host_time_s": part.arrival_s, "aligned_time_s": part.time_s, "tick_s": part.tick_s,
                       **{v: np.ascontiguousarray(part.values[v]) for v in part.block.variables}}
            pq.write_table(pa.table(columns), folder / f"{part.block.name}.parquet")
        if poses := [(r.time_s, unpack(r.payload)) for r in packets.of(POSE)]:
            table: dict[str, list[Any]] = {"host_time_s": [t for t, _ in poses], "time_s": [p.time_s for _, p in poses]}
            for i, column in enumerate(("px", "py", "pz", "qx", "qy", "qz", "qw")):
                table[column] = [float((*p.position_m, *p.quaternion)[i]) for _, p in poses]
            pq.write_table(pa.table(table), folder / "poses.parquet")
        if loop := packets.of(LOOP):
            pq.write_table(pa.table({"host_time_s": [r.time_s for r in loop],
                                     "late_s": [struct.unpack("<d", r.payload)[0] for r in loop]}),
                           folder / "loop.parquet")
        if notes := packets.of(NOTE, TEXT):
            table = {"host_time_s": [r.time_s for r in notes], "text": [r.payload.decode() for r in notes]}
            pq.write_table(pa.table(table), folder / "notes.parquet")
    except OSError as error:
        raise InputError(str(folder), f"cannot be written ({error.strerror or error})", "check the folder") from None
