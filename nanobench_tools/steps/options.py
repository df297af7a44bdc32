"""What a piece of work is given, and the steps around it: load, audit, run, write, say, exit code."""

from __future__ import annotations

import os
import re
import shutil
import sys
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ..errors import InputError, UsageError
from ..tables.result_table import Table
from ..tables.terminal import UNBOUNDED, folded, lines_of
from ..time_offsets.moving.votes import AS_RECORDED

if TYPE_CHECKING:
    from ..auditing.recording_audit import Audit
    from ..flight import Flight
    from ..harness import Item, Progress, RunResult
    from ..harness.clocks import Choice, OnClock
    from ..protocols.sessions import Sessions
    from ..results.result import Result
    from ..time_offsets.moving.time_offset import TimeOffset

CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]+")
SMALLEST = 24
"""Lines of the smallest terminal that a result is made for."""
SAID_OF_BAGS = ("received", "is taken for", "bear no names", "no definition", "not read; choose",
                "one recording in")
"""Notes on a bag that are printed."""
MOST_FAILED = 3
"""More failures are counted; each is shown with ``--verbose``."""
MOST_TOPICS = 8
"""Lines about topics of bags that are printed; audit.json has all."""
Case = TypeVar("Case")
"""One recording as a protocol uses it."""


@dataclass
class Options:
    """Options of a verb or a Python function. ``failed`` gathers the failures of reading and of items: [{item, file,
    error}]. ``time_offsets``: found with the audits, see ``audit``."""

    data: tuple[Path, ...] = ()
    out: Path | None = None
    json: Path | None = None
    jobs: int = 1
    scheduler: str | None = None
    seed: int = 0
    columns: Path | None = None
    quiet: bool = False
    clock: str = AS_RECORDED
    verbose: bool = False
    failed: list[dict[str, str]] = field(default_factory=list)
    flights: list[Flight] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    started: float = field(default_factory=time.time)
    time_offsets: dict[tuple[str, Choice], TimeOffset | None] = field(default_factory=dict)

    @property
    def progress(self) -> Progress:
        from ..harness import Progress

        return Progress(quiet=self.quiet)

    @property
    def store(self) -> Path | None:
        """Where finished items are kept for resuming: in the cache folder of the user; where none can be made, below
        ``--out``."""
        from ..harness.store import user_store

        return user_store() or (self.out / ".store" if self.out else None)

    @property
    def synthetic(self) -> bool:
        """Whether any flight that was read is simulated."""
        return any(flight.provenance.synthetic for flight in self.flights)

    @property
    def sessions(self) -> Sessions:
        """The sessions of all recordings that were read, whichever of them a table counts."""
        from ..protocols.sessions import Sessions

        return Sessions.of(self.flights)

    def places(self) -> list[Path]:
        """``--data``, else the default places; UsageError when there is nothing to read, InputError for a bad path."""
        from ..sources.discover import default_data

        for path in self.data:
            if not os.path.exists(path):  # Path.exists raises where a folder above may not be entered
                raise InputError(str(path), "does not exist", "give the path of a recording, or of a folder of them")
        places = list(self.data) or default_data()
        if not places:
            raise UsageError("no recordings in $NANOBENCH_DATA, ./data or ../shared/data/nanobench; give --data DIR, "
                             "or make practice flights with: nanobench simulate --out DIR")
        return list(places)

    def load(self, data: Sequence[Path] | None = None) -> list[Flight]:
        """Reads ``--data`` (or ``data``), says what was read and from where, and keeps the failures.

        Raises UsageError naming the first file when nothing at all could be read.
        """
        from ..sources.discover import load_recordings

        places = list(data) if data else self.places()
        before = time.perf_counter()
        with self.progress.task("read", 1) as step:
            loaded = load_recordings(places, columns=self.columns, jobs=self.jobs,
                                     progress=lambda done, total, path: step(done, total=total))
        failed = [{"item": "read", "file": readable(str(f["path"])), "error": readable(f["error"])}
                  for f in loaded.failed]
        where = ", ".join(map(str, places))
        if not loaded.flights:
            if failed:
                more = f" (and {len(failed) - 1} more)" if len(failed) > 1 else ""
                raise UsageError(f"no recording could be read: {failed[0]['error']}{more}")
            raise InputError(where, "no recording found")
        flights = [flight if (name := readable(flight.name)) == flight.name else replace(flight, name=name)
                   for flight in loaded.flights]
        self.flights += flights
        self.failed += failed
        elapsed = time.perf_counter() - before
        first = f"{places[0]}{f' and {len(places) - 1} more' if len(places) > 1 else ''}"
        self.say(f"{_kinds(flights)} from {first} in {elapsed:.1f} s"
                 + (f", {len(failed)} files failed" if failed else ""))
        said = [line for flight in flights if flight.metadata.get("topics") for line in _topics(flight)]
        said += _read_as([flight for flight in flights if not flight.metadata.get("topics")])
        for line in said[:MOST_TOPICS]:
            self.say(line)
        return flights

    def run(self, items: Sequence[Item], title: str) -> RunResult:
        """Runs items as the options say; failures are kept for the result file and the exit code."""
        from ..harness import run_items

        result = run_items(items, self.store, self.jobs, self.scheduler, self.progress, title)
        self.failed += result.failed
        return result

    def audit(self, flights: Sequence[Flight], clocks: Sequence[Choice] = (),
              moved: Collection[str] = ()) -> tuple[dict[str, Audit], list[list[str]]]:
        """Audits by flight name, and groups of names of copies; failures are kept. Computed once, then read from the
        store. ``clocks``: those needed later for the recordings in ``moved``, computed at the same time."""
        from ..harness.audits import audit_flights

        result = audit_flights(flights, self.store, self.jobs, self.scheduler, self.progress, clocks, moved)
        self.failed += result.failed
        self.time_offsets.update(result.time_offsets)
        return result.audits, result.copies

    def on_clock(self, flights: Sequence[Flight], audits: Mapping[str, Audit],
                 judged: Sequence[str] = ()) -> tuple[list[Flight], dict[str, Audit]]:
        """Flights and audits as seen with ``--clock``; says for how many recordings it could be identified."""
        result = self.see_on_clock(flights, audits, judged)
        return result.flights, result.audits

    def see_on_clock(self, flights: Sequence[Flight], audits: Mapping[str, Audit],
                     judged: Sequence[str] = ()) -> OnClock:
        """``on_clock`` with what was taken out of each recording; ``judged``: the logged estimates
        (``votes.ESTIMATES``) that are judged on it, and so get no vote."""
        from ..harness.clocks import on_clock

        result = on_clock(flights, audits, self.clock, judged, self.store, self.jobs, self.scheduler,
                          self.progress, self.time_offsets)
        self.failed += result.failed
        if self.clock != AS_RECORDED:
            self.say(clock_line(self.clock, list(result.time_offsets.values()), result.evidence, judged))
        return result

    def selected(self, requested: Sequence[str], known: Sequence[str],
                 select: Callable[[str], list[Case]]) -> Iterator[tuple[str, list[Case]]]:
        """(protocol, cases) of every protocol: the requested ones, else all ``known`` that have data to score.

        Raises the InputError of ``select`` for a requested protocol, and the last one if none has data.
        """
        reasons: list[InputError] = []
        unknown: list[str] = []
        wanted = tuple(dict.fromkeys(requested or known))
        for protocol in wanted:
            try:
                cases = select(protocol)
            except InputError as error:
                if requested:
                    raise
                reasons.append(error)
                unknown.append(f"protocol {protocol} left out: {error}")
                continue
            while unknown:
                self.say(unknown.pop(0))
            yield protocol, cases
        if reasons and len(reasons) == len(wanted):  # the error says it
            raise reasons[-1]
        for line in unknown:
            self.say(line)

    def manifest(self, inputs: Iterable[Any] | None = None) -> dict[str, Any]:
        from ..harness import manifest

        return manifest(self.flights if inputs is None else inputs, self.seed, started=self.started)

    def envelope(self, schema: str, body: Mapping[str, Any] | Result,
                 failed: list[dict[str, str]] | None = None) -> dict[str, Any]:
        """The whole content of a result file of this run; ``failed`` if not all that failed so far belongs to it."""
        from ..harness import envelope

        return envelope(schema, body, self.synthetic, self.manifest(), self.failed if failed is None else failed)

    def finish(self, schema: str, body: Mapping[str, Any] | Result) -> int:
        """Writes ``--json`` and ``--out``/SCHEMA.json, lists what failed, gives the exit code.

        ``--json -`` prints the result on stdout; tables are then not shown.
        """
        from ..harness import write_json

        content = self.envelope(schema, body)
        self.write_json(content)
        if self.out is not None:
            write_json(self.out / f"{schema}.json", content)
        return self.exit_code()

    def write_json(self, content: Mapping[str, Any]) -> None:
        """Writes ``--json``, or prints it for ``--json -``."""
        from ..harness import write_json
        from ..results.result_files import to_text

        if self.json is not None and str(self.json) == "-":
            click.echo(to_text(content), nl=False)
        elif self.json is not None:
            write_json(self.json, content)

    def exit_code(self) -> int:
        """0, or 1 after listing on stderr what failed."""
        for line in self.failures():
            print(line, file=sys.stderr)
        return 1 if self.failed else 0

    def failures(self) -> list[str]:
        """What failed, a line each. Of many, without ``--verbose``, the first ones without advice, and how many more.
        """
        lines = [" ".join(f"failed: {failure['item']}: {failure['error']}".split()) for failure in self.failed]
        if self.verbose or len(lines) <= MOST_FAILED:
            return lines
        return [*(line.partition("; ")[0] for line in lines[:MOST_FAILED]),
                f"failed: {len(lines) - MOST_FAILED} more; --verbose shows each, and what to do"]

    def say(self, text: str) -> None:
        """A line on stderr for a person, unless ``--quiet``."""
        if not self.quiet:
            print(text, file=sys.stderr, flush=True)
            self.said.append(text)

    def detail(self, part: Any) -> None:
        """``show``, with ``--verbose`` alone."""
        if self.verbose:
            self.show(part)

    def show(self, part: Any, most: int | None = None) -> None:
        """Print a table (ours or rich's) or a text on stdout, unless ``--quiet`` or ``--json -``. At most ``most``
        lines of a table of ours. In a file or pipe a text is one line of any width, and with ``--verbose`` a row is
        one, too. A closed pipe (head, less) does not stop the work."""
        if self.silent or part == "" or (isinstance(part, Table) and not part.rows):
            return
        if isinstance(part, str):
            write_lines(folded(CONTROL.sub(" ", part), screen_width() if sys.stdout.isatty() else UNBOUNDED))
        elif isinstance(part, Table):
            width = UNBOUNDED if self.verbose and not sys.stdout.isatty() else screen_width()
            write_lines(lines_of(part, width, self.verbose, most))
        else:
            write_lines(_rich_lines(part))

    @property
    def silent(self) -> bool:
        """Whether nothing is shown on stdout."""
        return self.quiet or str(self.json) == "-"


def screen_width() -> int:
    """Columns of the terminal; $COLUMNS or 80 where stdout is a file or a pipe."""
    return shutil.get_terminal_size().columns


def screen_height() -> int:
    """Lines of the terminal, at least of the smallest one; of that one where stdout is a file or a pipe."""
    return max(shutil.get_terminal_size().lines, SMALLEST) if sys.stdout.isatty() else SMALLEST


def _rich_lines(table: Any) -> list[str]:
    """The lines of a table of rich's, in which no word is cut."""
    from rich.console import Console
    from rich.measure import Measurement

    wide, terminal = Console(width=10_000), sys.stdout.isatty()
    console = Console(width=None if terminal else 160, highlight=False, markup=False)
    for column in getattr(table, "columns", ()):
        words = [word for cell in (column.header, *column.cells) for word in str(cell).split()]
        column.min_width = max([len(word) for word in words], default=1)
    size = Measurement.get(wide, wide.options, table)
    console.width = max(console.width, size.minimum if terminal else size.maximum)
    with console.capture() as text:
        console.print(table)
    return text.get().replace("\\[", "[").rstrip("\n").split("\n")


def write_lines(lines: Sequence[str]) -> None:
    """On stdout, without padding."""
    try:
        sys.stdout.write("".join(f"{line.rstrip()}\n" for line in lines))
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _topics(flight: Flight) -> list[str]:
    """The topics of a bag that make a flight, and what of its clocks had to be moved."""
    topics = ", ".join(f"{stream} = {topic}" for stream, topic in flight.metadata["topics"].items())
    return [f"{flight.name}: {topics}", *(f"{flight.name}: {note}" for note in flight.provenance.notes
                                          if any(word in note for word in SAID_OF_BAGS))]


def _read_as(flights: Sequence[Flight]) -> list[str]:
    """What a source decided about frames and streams of its recordings, each sentence once."""
    of: dict[str, list[str]] = {}
    for flight in flights:
        for sentence in flight.metadata.get("read_as") or ():
            of.setdefault(sentence, []).append(flight.name)
    return [f"{names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: {sentence}"
            for sentence, names in of.items()]


def _kinds(flights: Sequence[Flight]) -> str:
    synthetic = sum(flight.provenance.synthetic for flight in flights)
    counts = [(len(flights) - synthetic, "REAL"), (synthetic, "SYNTHETIC")]
    return " and ".join(f"{n} {kind} recording{'s' * (n > 1)}" for n, kind in counts if n)


def readable(text: str) -> str:
    """``text`` with bytes of a file name that are not UTF-8 as ``\\udcff``. Python keeps them as lone surrogates, which
    files cannot contain."""
    return text.encode("utf-8", "backslashreplace").decode()


def one_line(text: str) -> str:
    """``text`` (a name from anywhere) without control characters."""
    return CONTROL.sub(" ", text).replace("\n", " ")


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def clock_line(clock: str, time_offsets: Sequence[TimeOffset | None], evidence: Sequence[str],
               judged: Sequence[str]) -> str:
    """Effect of ``--clock`` on the recordings: streams used, number of moving clocks, number of unknown ones."""
    moving = sum(found is not None and found.moving for found in time_offsets)
    constant = sum(time_offset is not None and not time_offset.moving for time_offset in time_offsets)
    label = f"clock {clock}" + (f", for judging logged {' and '.join(judged)}" if judged else "")
    if not moving + constant:
        return f"{label}: no stream identifies the time error of any recording ({len(time_offsets)} as recorded)"
    parts = [f"{n} {what}" for n, what in ((moving, "with a moving error"), (constant, "with a constant error"),
                                           (len(time_offsets) - moving - constant, "as recorded, no clock found")) if n]
    return f"{label}, set by {', '.join(evidence)}: {' and '.join(parts)} (of {len(time_offsets)})"
