"""State of a campaign on disk: which flights are done, with recording and voltage. Written whole after every flight."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...results.result_files import read_json, sweep, write_json
from ...sources.nanobench_writer import sheet_path
from ..packets import SUFFIX, read_packets
from ..record_export import export
from ..recorder import RAW_FOLDER
from .campaign_plan import CampaignPlan, FlightId

STATE, SCHEMA, LOCK = "campaign.json", "nanobench-campaign/1", ".campaign.lock"
SHEET_KEY = "campaign"
"""Of the sheet of a recording: plan, path, pair and controller."""


@dataclass(frozen=True)
class Flown:
    """A flight that is done. ``battery_V``: at rest before it; ``csv``: name of its recording."""

    flight: FlightId
    battery_V: float
    csv: str


class CampaignState:
    """The flights of ``plan`` in ``folder`` that are done. ``ended_early``: recordings that do not count."""

    def __init__(self, folder: Path, plan: CampaignPlan) -> None:
        self.folder, self.plan = folder, plan
        self.done: dict[FlightId, Flown] = {}
        self.ended_early: list[str] = []

    @property
    def flown_V(self) -> dict[FlightId, float]:
        """Voltage at rest of every flight that is done."""
        return {flight: flown.battery_V for flight, flown in self.done.items()}

    @property
    def recordings(self) -> list[Path]:
        """Recordings of the flights that are done, in the order of the plan."""
        return [self.folder / self.done[flight].csv for flight in self.plan.flights if flight in self.done]

    def sheet(self, flight: FlightId) -> dict[str, Any]:
        """Entries of the sheet of a recording, by which it is recognized after an interruption."""
        return {"repetition": flight.pair, SHEET_KEY: {"plan": self.plan.digest, **flight._asdict()}}

    def add(self, flown: Flown) -> None:
        """Keeps a flight that is done."""
        self.done[flown.flight] = flown
        self.write()

    def add_ended(self, csv: str) -> None:
        """Keeps the recording of a flight that ended early. That flight is flown again."""
        self.ended_early.append(csv)
        self.write()

    def write(self) -> None:
        """Writes the state, whole or not at all."""
        flights = [{**flown.flight._asdict(), "battery_V": flown.battery_V, "csv": flown.csv}
                   for flown in self.done.values()]
        write_json(self.folder / STATE, {"schema": SCHEMA, "plan": self.plan.digest, "flights": flights,
                                         "ended_early": self.ended_early})

    def read(self) -> None:
        """What earlier runs did. Raises InputError for the state of another plan, or a recording that is missing."""
        path = self.folder / STATE
        if not path.exists():
            return
        content = read_json(path, SCHEMA)
        if content.get("plan") != self.plan.digest:
            raise InputError(str(path), "belongs to another plan", "give the plan that this campaign began with, or "
                             "another folder to --record")
        try:
            for entry in content["flights"]:
                flight = FlightId(entry["path"], entry["pair"], entry["controller"])
                self.done[flight] = Flown(flight, float(entry["battery_V"]), str(entry["csv"]))
            self.ended_early = [str(name) for name in content["ended_early"]]
        except (KeyError, TypeError, ValueError):
            raise InputError(str(path), "is damaged", "restore it, or give another folder to --record") from None
        for recording in self.recordings:
            if not recording.is_file():
                raise InputError(f"{path}: {recording.name}", "this recording is missing", "put it back, or remove its "
                                 "line to fly it again")

    def recover(self, say: Callable[[str], None]) -> None:
        """Adds flights that were completed by a program that ended before it could write the state."""
        known = {flown.csv for flown in self.done.values()}
        for raw in sorted((self.folder / RAW_FOLDER).glob(f"*{SUFFIX}")):
            name = f"{raw.name.removesuffix(SUFFIX)}.csv"
            flown = None if name in {*known, *self.ended_early} else self._completed(raw, name)
            if flown is None or flown.flight in self.done:
                continue
            try:
                if not (self.folder / name).exists() or not sheet_path(self.folder / name).exists():
                    export(raw, self.folder)
            except InputError as error:
                say(f"{flown.flight}: completed before, but not exported ({error}); it is flown again")
                continue
            say(f"{flown.flight}: completed before the interruption; its recording is {name}")
            self.add(flown)

    def _completed(self, raw: Path, name: str) -> Flown | None:
        """The flight of a raw recording, if it is one of this plan and was flown to its end."""
        try:
            sheet = read_packets(raw).sheet
        except InputError:  # cut before its header was written
            return None
        mark, summary = sheet.get(SHEET_KEY), sheet.get("flight")
        if not isinstance(mark, dict) or mark.get("plan") != self.plan.digest or not isinstance(summary, dict):
            return None
        if summary.get("stopped") is not None or "battery_at_rest_V" not in sheet:
            return None
        flight = FlightId(mark["path"], mark["pair"], mark["controller"])
        return Flown(flight, float(sheet["battery_at_rest_V"]), name)


@contextmanager
def opened(folder: Path, plan: CampaignPlan, say: Callable[[str], None]) -> Iterator[CampaignState]:
    """The state in ``folder``, for one program at a time. Raises InputError if another one has it."""
    state = CampaignState(folder, plan)
    with _locked(folder):
        sweep(folder)
        state.read()
        state.recover(say)
        yield state


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    with open(folder / RAW_FOLDER / LOCK, "w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(str(folder), "another program flies a campaign there", "wait for its end") from None
        yield
