"""Exports of motion capture programs: OptiTrack Motive (CSV), Vicon Tracker and Nexus (CSV), Qualisys (6D, TSV).

Each begins with a preamble that names bodies, units, rate and kind of rotation. Empty cells and rows of zeros are an
occlusion. Motive's y-up world is turned. Each program can be set to the other axis, which no line of the file states:
the ground that a body rests on shows it. Each of several rigid bodies is a flight.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..flight import Assumption, Flight, Provenance, make_stream
from ..settings import count, number, setting
from ..units import factor
from .axes import frame_of, in_our_axes
from .cells import parse_number
from .dialect import normalise_text
from .sheets import Sheet
from .tum_layout import NORM_TOLERANCE
from .units_as_written import unit_as_written

POSITION, QUATERNION = ("px", "py", "pz"), ("qx", "qy", "qz", "qw")
LINES_SEEN = count("sources.mocap_export.lines_seen")
QUALISYS = ("NO_OF_FRAMES", "FREQUENCY")
VICON = ("Objects", "Segments", "Global Angle (deg)", "Trajectories", "Devices", "Joints", "Model Outputs", "Subjects")
"""Titles of sections; a file may have several, each with its rate and its names."""
VICON_KIND = re.compile(r"^(Global|Local) (Angle|Translation|Rotation) ?")
"""Before the name of a body where each of its groups of columns has a title."""
ROTATION_MATRIX = 9
EULER = ("Roll", "Pitch", "Yaw")
FULL_TURN_DEG = 360.0
FLIGHT_M = setting("sources.mocap_export.flight_m")
Y_UP = "EUS/FUR"
GROUND_S = number("sources.mocap_export.ground_s")
STILL_M = number("sources.mocap_export.still_m")
NEAR_M = number("sources.mocap_export.near_m")
CLIMBS_M = number("sources.mocap_export.climbs_m")
MOST_M_S2 = number("sources.mocap_export.most_m_s2")
NOISY = number("sources.mocap_export.noisy")


@dataclass(frozen=True)
class Export:
    """Layout of an export.

    - program, body.
    - columns of position (3,) and attitude (4, 9, 3 or none) by place; ``turn``: one of quaternion, matrix, euler.
    - length: m per unit; order: axes of the angles, first turn first; ``angles``: their names.
    - time: place of seconds, else of frames, with their rate; first, end: rows of data (None: up to the last)."""

    program: str
    bodies: tuple[str, ...]
    position: tuple[int, ...]
    attitude: tuple[int, ...]
    turn: str
    length: float
    time: int | None
    rate_hz: float | None
    first: int
    frame: str = ""
    note: str = ""
    end: int | None = None
    order: str = "XYZ"
    angles: tuple[str, ...] = ()


class MocapExport:
    """Source ``mocap_export``: one stream, ``mocap``, of ``body``, which several bodies need."""

    name = "mocap_export"

    def __init__(self, body: str = "") -> None:
        self.body = body
        self.version = f"5-{body}"

    def recognises(self, path: Path, head: bytes) -> bool:
        return program_of(head) != ""

    def vehicles(self, path: Path, parts: Sequence[bytes]) -> tuple[str, ...]:
        """The bodies of an export of several."""
        bodies = LAYOUTS[program_of(parts[0])](_rows(parts[0]), str(path), "").bodies
        return bodies if len(bodies) > 1 else ("",)

    def of(self, vehicle: str) -> MocapExport:
        """The source of one body."""
        return MocapExport(vehicle)

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        place = str(path)
        rows = _rows(data)
        export = LAYOUTS[program_of(data)](rows, place, self.body)
        if len(export.bodies) != 1 and not self.body:
            raise InputError(place, f"an export of {export.program} with {len(export.bodies)} rigid bodies "
                             f"({', '.join(export.bodies)})", "export one of them to a separate file")
        rows = rows[export.first:export.end]
        decimal = "," if any("," in cell for row in rows[:20] for cell in row) else "."
        wanted = (*export.position, *export.attitude)
        filled = [row for row in rows if any(row)]
        cells = np.array([[float(n) if export.time is None else _number(row, export.time, decimal),
                           *(_number(row, k, decimal) for k in wanted)] for n, row in enumerate(filled)])
        kept = np.isfinite(cells[:, 0]) if len(cells) else np.zeros(0, dtype=bool)
        if not kept.any():
            raise InputError(place, f"an export of {export.program} without a row of numbers", "export it again")
        cells = cells[kept]
        stamps = cells[:, 0] / export.rate_hz if export.rate_hz else cells[:, 0]
        _check_length(stamps, cells[:, 1:4], export, place)
        position = cells[:, 1:4] * export.length
        _check_turns(cells[:, 4:], export, place)
        quaternion = _quaternion(cells[:, 4:], export)
        hidden = ~np.isfinite(position).all(axis=1) | ~position.any(axis=1)
        values = position if quaternion is None else np.hstack([position, quaternion])
        values[hidden] = np.nan
        names = POSITION if quaternion is None else (*POSITION, *QUATERNION)
        time_s = stamps - stamps[0]
        duration = float(time_s[-1])
        made = make_stream("mocap", time_s, values, names, samples=int((~hidden).sum()),
                           rate_hz=(len(time_s) - 1) / duration if duration > 0.0 else float("nan"))
        frame = _frame_by_ground(time_s, values[:, :3], export.frame)
        if frame:
            made = in_our_axes(made, frame_of(frame))
        other = f"{'y' if frame else 'z'} is up, since the body goes below its place of rest along the other axis"
        notes = (f"an export of {export.program}, body {self.body or export.bodies[0]}",
                 *([export.note] if export.note else []), *([other] if frame != export.frame else []))
        return Flight(path.name, {"mocap": made}, {"family": None, "speed": None, "reference_speed_m_s": None},
                      Provenance(place, "", self.name, notes=notes, assumptions=_assumed(export)),
                      epoch_s=float(stamps[0]))


def _number(row: list[str], column: int, decimal: str) -> float:
    return parse_number(row[column].strip(), decimal) if column < len(row) else float("nan")


def _assumed(export: Export) -> tuple[Assumption, ...]:
    """The order and the signs of Euler angles, which are a setting of the program. Motive states the order."""
    return (Assumption("mocap", ", ".join(export.angles),
                       "deg about axes of the body in this order, signs by the right hand",
                       "the header states their order alone" if export.program == "Motive" else
                       "a setting of the program that no line of the file states"),) * (export.turn == "euler")


def program_of(head: bytes) -> str:
    """Motive, Qualisys, Vicon, or "" by the first lines."""
    if b"\x00" in head[:512]:
        return ""
    text = normalise_text(head[:4096]).decode("utf-8", errors="replace")
    first = text.lstrip().split("\n", 1)[0].replace('"', "")
    if first.startswith("Format Version") and ("Take Name" in first or "Capture Frame Rate" in first):
        return "Motive"
    if all(any(line.startswith(word) for line in text.split("\n")) for word in QUALISYS):
        return "Qualisys"
    return "Vicon" if first.strip(",; \t") in VICON and ("TX" in text or "Sub Frame" in text) else ""


def _rows(data: bytes) -> list[list[str]]:
    text = normalise_text(data)
    try:
        lines = text.decode("utf-8").split("\n")
    except UnicodeDecodeError:
        lines = text.decode("cp1252", errors="replace").split("\n")
    sample = "\n".join(lines[:LINES_SEEN])
    delimiter = next((d for d in "\t;" if d in sample), ",")  # a comma may be the decimal mark
    return list(csv.reader(lines, delimiter=delimiter))


def _at(rows: list[list[str]], test: str, place: str, program: str) -> int:
    """The row that begins with a word."""
    found = next((k for k, row in enumerate(rows[:LINES_SEEN]) if row and row[0].strip() == test), None)
    if found is None:
        raise InputError(place, f"an export of {program} without its line of names ({test} ...)", "export it again")
    return found


def _motive(rows: list[list[str]], place: str, body: str) -> Export:
    about = {k.strip(): v.strip() for k, v in zip(rows[0][::2], rows[0][1::2], strict=False)}
    names = _at(rows, "Frame", place, "Motive")
    above = [row + [""] * (len(rows[names]) - len(row)) for row in rows[1:names] if any(c.strip() for c in row)]
    kinds = next((r for r in above if any(c.strip() in ("Rigid Body", "Marker", "Bone") for c in r)), [])
    groups = next((r for r in above if any(c.strip() in ("Position", "Rotation") for c in r)), [])
    bodies_row = above[above.index(kinds) + 1] if kinds and above.index(kinds) + 1 < len(above) else []
    if not kinds or not groups or not bodies_row:
        raise InputError(place, "a Motive export without the lines above its names (type, name, Rotation, Position)",
                         "export rigid bodies with the full header")
    at: dict[str, dict[str, dict[str, int]]] = {}
    for k, (kind, name, group, axis) in enumerate(zip(kinds, bodies_row, groups, rows[names], strict=False)):
        if kind.strip() == "Rigid Body" and axis.strip() in ("X", "Y", "Z", "W"):
            at.setdefault(name.strip(), {}).setdefault(group.strip(), {})[axis.strip()] = k
    if not at:
        raise InputError(place, "a Motive export without a rigid body", "export rigid bodies, not markers alone")
    first = at[body or next(iter(at))]
    if not {"X", "Y", "Z"} <= set(first.get("Position", {})):
        raise InputError(place, "a Motive export without the position of its body", "export positions, too")
    turn = first.get("Rotation", {})
    kind = about.get("Rotation Type", "Quaternion")
    known, order = "", "XYZ"
    if kind.lower().startswith("quat") and {"X", "Y", "Z", "W"} <= set(turn):
        known = "quaternion"
    elif sorted(kind.upper()) == ["X", "Y", "Z"] and set(turn) == {"X", "Y", "Z"}:
        known, order = "euler", kind.upper()
    axes = {"quaternion": "XYZW", "euler": order}.get(known, "")
    note = "" if known else f"the rotation ({kind}) is not read: export quaternions"
    unit = _length(about.get("Length Units", ""), place)
    seconds = next((k for k, n in enumerate(rows[names]) if n.strip().startswith("Time")), None)
    rate = None if seconds is not None else _rate(about.get("Export Frame Rate", ""), place)
    return Export("Motive", tuple(at), tuple(first["Position"][a] for a in "XYZ"),
                  tuple(turn[a] for a in axes), known, unit, 0 if seconds is None else seconds, rate, names + 1, Y_UP,
                  note, order=order, angles=tuple(f"Rotation {a}" for a in order))


def _qualisys(rows: list[list[str]], place: str, body: str) -> Export:
    about = {row[0].strip(): [c.strip() for c in row[1:]] for row in rows[:LINES_SEEN] if row}
    bodies = tuple(b for b in about.get("BODY_NAMES", []) if b)
    names = next((k for k, row in enumerate(rows[:LINES_SEEN])
                  if [c.split()[-1] for c in row if c.strip()].count("X") and any(c.strip() == "Y" for c in row)), None)
    if names is None:
        raise InputError(place, "a Qualisys export without a line of names (X Y Z Roll ...)", "export 6D data")
    header = [c.strip() for c in rows[names]]
    starts = [k for k, c in enumerate(header) if c.split() and c.split()[-1] == "X"]
    header = _of_body(header, dict(zip(starts, bodies, strict=False)), body)
    x = next(k for k, c in enumerate(header) if c.split() and c.split()[-1] == "X")
    axes = [c.split()[-1] if c else "" for c in header]
    matrix = tuple(k for k, c in enumerate(header) if c.startswith("Rot[") or "Rot[" in c)[:ROTATION_MATRIX]
    euler = tuple(sorted(axes.index(n) for n in EULER)) if set(EULER) <= set(axes) else ()
    seconds = header.index("Time") if "Time" in header else None
    frame = header.index("Frame") if "Frame" in header else None
    if axes[x:x + 3] != ["X", "Y", "Z"]:
        raise InputError(place, f"a Qualisys export whose positions are {', '.join(axes[x:x + 3])}",
                         "export X, Y and Z")
    turn, attitude = ("matrix", matrix) if len(matrix) == ROTATION_MATRIX else ("euler", euler) if euler else ("", ())
    angles = [n for n in header[x + 3:] if n and not n.startswith("Residual") and "Rot[" not in n]
    note = (f"{', '.join(header[k] for k in euler)} are read as turns about axes of the body in this order: other "
            "settings of the program need the rotation matrix") if turn == "euler" else (
            f"the angles {', '.join(angles)} are not read: their axes are a setting; export the rotation matrix"
            if angles and not turn else "")
    return Export("Qualisys", bodies or ("body",), (x, x + 1, x + 2), attitude, turn, factor("mm"),
                  frame if seconds is None else seconds,  # without both, the rows are counted
                  None if seconds is not None else _rate(about.get("FREQUENCY", [""])[0], place), names + 1, "", note,
                  order="".join("XYZ"[EULER.index(axes[k])] for k in euler), angles=tuple(axes[k] for k in euler))


def _vicon(rows: list[list[str]], place: str, body: str) -> Export:
    titles = [k for k, row in enumerate(rows) if _lone(row) in VICON and k + 1 < len(rows) and
              parse_number((_lone(rows[k + 1]).split() or [""])[0]) > 0.0] or [0]
    ends = [*titles[1:], len(rows)]
    names_at = {k: next((n for n in range(k, min(end, k + LINES_SEEN)) if rows[n] and rows[n][0].strip() == "Frame"),
                        None) for k, end in zip(titles, ends, strict=True)}
    posed = {k: n for k, n in names_at.items() if n is not None
             and {"TX", "TY", "TZ"} <= {c.strip() for c in rows[n]}}
    if len(posed) != 1:
        seen = ", ".join(filter(None, [_lone(rows[k]) for k in posed or titles])) or "no section"
        what = "without TX, TY, TZ; it contains" if not posed else f"with {len(posed)} sections of poses:"
        raise InputError(place, f"a Vicon export {what} {seen}", "export the object or its segments, not its markers"
                         if not posed else "export each to a separate file")
    (title, names), = posed.items()
    rate = _rate((_lone(rows[title + 1]).split() or [""])[0], place)
    header = [c.strip() for c in rows[names]]
    count = header.count("TX")
    starts = {k: VICON_KIND.sub("", c.strip()) for k, c in enumerate(rows[names - 1]) if c.strip()}
    bodies = tuple(dict.fromkeys(starts.values()))
    if len(bodies) < count:
        starts = {k: f"body {n + 1}" for n, k in enumerate(k for k, c in enumerate(header) if c == header[2])}
        bodies = tuple(starts.values())
    header = _of_body(header, starts, body)
    at = tuple(header.index(n) for n in ("TX", "TY", "TZ"))
    below = [c.strip() for c in rows[names + 1]] if names + 1 < len(rows) else []
    units = dict.fromkeys(below[k] if k < len(below) else "" for k in at)
    if len({_length(unit, place) for unit in units}) > 1:
        raise InputError(place, f"TX, TY and TZ are in different units ({', '.join(units)})", "export them in one unit")
    whole = all(n in header for n in ("RX", "RY", "RZ", "RW"))
    notes = [] if whole else ["RX, RY, RZ are not read: Euler angles or a rotation vector, the file does not say which"]
    notes += [f"section {_lone(rows[k])} is not read" for k in titles if k != title]
    return Export("Vicon", bodies, at, tuple(header.index(n) for n in ("RX", "RY", "RZ", "RW")) if whole else (),
                  "quaternion" if whole else "", _length(next(iter(units)), place), header.index("Frame"), rate,
                  names + 2, "", "; ".join(notes), ends[titles.index(title)])


def _of_body(header: list[str], starts: dict[int, str], body: str) -> list[str]:
    """The names without those of other bodies. ``starts``: where the columns of a body begin, and its name."""
    if not body:
        return header
    owner = [next((starts[s] for s in sorted(starts, reverse=True) if s <= k), "") for k in range(len(header))]
    return [name if owner[k] in ("", body) else "" for k, name in enumerate(header)]


def _lone(row: list[str]) -> str:
    """The cell of a row that has no other; "" for other rows."""
    return row[0].strip() if row and not any(c.strip() for c in row[1:]) else ""


def _length(text: str, place: str) -> float:
    unit = unit_as_written(text)
    if unit not in ("m", "cm", "mm"):
        raise InputError(place, f"lengths are in {text!r}", "export in millimeters or meters")
    return factor(unit)


def _rate(text: str, place: str) -> float:
    rate = parse_number(text.strip())
    if not rate > 0.0:
        raise InputError(place, f"the frame rate is {text!r}", "export the time of each frame")
    return rate


def _frame_by_ground(time_s: np.ndarray, position: np.ndarray, usual: str) -> str:
    """``usual``, or the frame with the other of y and z up where the ground shows that.

    The body rests at both ends. Along the other axis alone it is never below these places, and rises above them."""
    seen = np.isfinite(position).all(axis=1)
    time_s, position = time_s[seen], position[seen]
    if not len(time_s):
        return usual
    ends = [position[time_s <= time_s[0] + GROUND_S], position[time_s >= time_s[-1] - GROUND_S]]
    if any(len(end) < 3 or (np.ptp(end, axis=0) > STILL_M).any() for end in ends):
        return usual
    stood = np.stack([np.median(end, axis=0) for end in ends])
    low, high = np.quantile(position, (0.02, 0.98), axis=0)
    rises = (stood.max(axis=0) - low < NEAR_M) & (high - stood.max(axis=0) > CLIMBS_M)
    falls = stood.min(axis=0) - low > CLIMBS_M
    up, other = (1, 2) if usual == Y_UP else (2, 1)
    return usual if not (falls[up] and rises[other]) else "" if usual == Y_UP else Y_UP


def _check_length(time_s: np.ndarray, cells: np.ndarray, export: Export, place: str) -> None:
    """InputError for a path that is a flight in another unit than the header's."""
    p = cells[np.isfinite(cells).all(axis=1) & cells.any(axis=1)]
    step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
    if len(p) < 20 or not step_s > 0.0:
        return
    k = max(1, min(round(0.05 / step_s), len(p) // 4))
    extent = np.ptp(np.quantile(p, (0.01, 0.99), axis=0), axis=0)
    widest = int(np.argmax(extent))
    bend = (p[2 * k:] - 2.0 * p[k:-k] + p[:-2 * k]) / (k * step_s) ** 2
    pull = float(np.quantile(np.linalg.norm(bend, axis=1), 0.9))
    if float(np.median(np.abs(np.diff(p[:, widest])))) > NOISY * extent[widest]:
        return
    fits = [u for u in ("m", "cm", "mm", "in") if FLIGHT_M[0] <= factor(u) * extent[widest] <= FLIGHT_M[1]
            and factor(u) * pull < MOST_M_S2]
    stated = next(u for u in ("m", "cm", "mm") if factor(u) == export.length)
    if fits and stated not in fits:
        others = " or ".join(fits).replace("in", "inches")
        raise InputError(place, f"lengths are in {stated} by the header of this {export.program} export, in which the "
                         f"path spans {factor(stated) * extent[widest]:.2g} m; in {others} it is a flight",
                         "correct the unit in the header" if export.program != "Qualisys" else
                         "write the positions in mm, as this layout has them")


def _check_turns(cells: np.ndarray, export: Export, place: str) -> None:
    """InputError for invalid rotations: valid are a unit quaternion, a rotation matrix or angles within a turn."""
    there = cells[np.isfinite(cells).all(axis=1) & cells.any(axis=1)] if cells.size else cells
    if not there.size:
        return
    if export.turn == "euler":
        if (most := float(np.abs(there).max())) > FULL_TURN_DEG:
            raise InputError(place, f"{', '.join(export.angles)} reach {most:.4g}: no angles in degrees",
                             "export degrees")
        return
    parts = there if export.turn == "quaternion" else there.reshape(-1, 3)  # rows of a matrix have length 1, too
    length = np.linalg.norm(parts, axis=1)
    off = float(np.quantile(np.abs(length - 1.0), 0.95))
    if off > NORM_TOLERANCE:
        what = "rotations (X, Y, Z, W)" if export.turn == "quaternion" else "columns of rotation matrices"
        raise InputError(place, f"{what} have lengths up to {length.max():.4g}, where 1 belongs", "export them again")


def _quaternion(cells: np.ndarray, export: Export) -> np.ndarray | None:
    """(n, 4) x, y, z, w; nan rows where there is no rotation; None where the file holds none that is known."""
    if not export.attitude:
        return None
    found = np.full((len(cells), 4), np.nan)
    there = np.isfinite(cells).all(axis=1) & (cells.any(axis=1) if export.turn != "euler" else True)
    if export.turn == "quaternion":
        found[there] = cells[there]
    elif export.turn == "matrix":  # column by column
        found[there] = Rotation.from_matrix(cells[there].reshape(-1, 3, 3).swapaxes(1, 2)).as_quat()
    else:
        found[there] = Rotation.from_euler(export.order, cells[there], degrees=True).as_quat()
    return found


LAYOUTS = {"Motive": _motive, "Qualisys": _qualisys, "Vicon": _vicon}
