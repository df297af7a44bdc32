"""Everything that goes over a link, written down as it comes: ``Recorder`` listens to link, mocap and flight."""

import datetime
import re
import struct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..version import __version__
from .blocks import Block
from .fly.flight_loop import Beat
from .fly.pose_tracker import Believed
from .host_clock import Clock
from .mocap.pose_datagram import Pose, pack
from .packets import ECHO, LOG, LOOP, POSE, REFERENCE, SENT, SUFFIX, PacketWriter
from .vehicle_link import CflibLink

RAW_FOLDER = ".raw"
"""Below the folder of recordings; readers of recordings leave folders with a dot out."""


def recording_name(words: Sequence[str], started_s: float) -> str:
    """A file name of words and the time of the start."""
    stamp = datetime.datetime.fromtimestamp(started_s, datetime.UTC).strftime("%Y%m%dT%H%M%SZ")
    return "_".join([*(re.sub(r"[^A-Za-z0-9.-]+", "-", word) for word in words if word), stamp])


class Recorder:
    """Writes ``folder``/.raw/NAME.packets from ``start`` to ``close``. It is a listener of ``fly.Flight``, too."""

    def __init__(self, folder: Path, name: str, link: CflibLink, blocks: Sequence[Block],
                 sheet: Mapping[str, Any], clock: Clock) -> None:
        self.name, self.folder, self._link, self._clock = name, folder, link, clock
        self.path = folder / RAW_FOLDER / f"{name}{SUFFIX}"
        header = {"version": __version__, "uri": link.uri, "protocol": link.version, "started_unix_s": clock.now(),
                  "blocks": [block.to_json() for block in blocks]}
        self._writer = PacketWriter(self.path, header)
        self._sheet = dict(sheet)
        self._writer.sheet(self._clock.now(), self._sheet)
        self.log_packets = self.poses = 0
        self.hosted = False
        self.beat_of: Callable[[], Beat | None] = lambda: None
        self._ticks = 0

    def start(self) -> None:
        """Listens to the link."""
        self._link.on_log, self._link.on_echo, self._link.on_sent = self._log, self._echo, self._sent

    def _log(self, number: int, time_s: float, data: bytes) -> None:
        self.log_packets += 1
        self._writer.write(LOG, number, time_s, data)

    def _echo(self, time_s: float, requested_s: float) -> None:
        self._writer.write(ECHO, 0, time_s, struct.pack("<d", requested_s))

    def _sent(self, time_s: float, header: int, data: bytes) -> None:
        self._writer.write(SENT, 0, time_s, bytes([header]) + data)

    def pose(self, pose: Pose) -> None:
        """A pose as it came, seen or not."""
        self.poses += 1
        self._writer.write(POSE, 0, self._clock.now(), pack(*pose))

    def tick(self, time_s: float, phase: str, believed: Believed | None, commanded_m: np.ndarray | None,
             yaw_rad: float) -> None:
        """Commanded positions of a controller on the host, and how late the loop was."""
        beat = self.beat_of()
        if beat is not None and len(beat.late_s) > self._ticks:
            self._ticks = len(beat.late_s)
            self.loop(beat.late_s[-1])
        if self.hosted and commanded_m is not None:
            self._writer.write(REFERENCE, 0, self._clock.now(), struct.pack("<4d", *commanded_m, yaw_rad))

    def loop(self, late_s: float) -> None:
        """Delay of a tick of the host's loop: shows the load of this computer."""
        self._writer.write(LOOP, 0, self._clock.now(), struct.pack("<d", late_s))

    def note(self, text: str) -> None:
        self._writer.note(self._clock.now(), text)

    def sheet(self, content: Mapping[str, Any]) -> None:
        """Adds to what is known of the flight."""
        self._sheet |= dict(content)
        self._writer.sheet(self._clock.now(), self._sheet)

    def close(self) -> None:
        """Ends the file."""
        self._link.on_log = self._link.on_echo = self._link.on_sent = None
        self._writer.close()


def check_folder(folder: Path) -> None:
    """Raises InputError if nothing can be written there."""
    try:
        (folder / RAW_FOLDER).mkdir(parents=True, exist_ok=True)
        probe = folder / RAW_FOLDER / ".probe"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        raise InputError(str(folder), f"cannot be written ({error.strerror})", "check folder and permissions") from None
