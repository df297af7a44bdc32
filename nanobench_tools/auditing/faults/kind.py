"""Declaration of a kind of fault, used by the rest of the code: one object per kind, next to its detector."""

from __future__ import annotations

import functools
import importlib
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from ...flight import Fault, Flight

if TYPE_CHECKING:
    from ...signals.context import Context

Group = Literal["lost", "value", "clock", "flight", "information"]
"""What a kind does: rows are lost, values wrong, stamps wrong, the flight ended badly; or it is only worth knowing."""
Severity = Literal["cut", "corrected", "noted", "information"]


@dataclass(frozen=True)
class Blind:
    """A data fault that ``nanobench prove`` may deal: size and options of the injection. ``everywhere``: the whole
    logging setup is wrong, not one flight. ``place`` orders the deck, so that a seed keeps its cases when a kind is
    added."""

    size: float | None
    options: Mapping[str, Any] = field(default_factory=dict)
    everywhere: bool = False
    place: float = math.inf


@dataclass(frozen=True)
class Injection:
    """How to put a known fault into a flight or the bytes of a file. The input is never changed.

    ``function(flight, rng, size, **case) -> (flight, Fault)``, or with the bytes ``data`` for the flight.

    sizes: from near the detection limit to plain, in ``unit``; (None,) if a size makes no sense. ``cases``: further
    keyword arguments worth trying. ``blind``: deals of ``nanobench prove``. The truth's size has the unit of the
    audit's smallest detectable size. For some kinds that differs from the argument here (a fraction of the peak).
    """

    function: Callable[..., Any]
    sizes: tuple[float | None, ...] = (None,)
    unit: str = ""
    cases: tuple[dict[str, Any], ...] = ({},)
    blind: tuple[Blind, ...] = ()


@dataclass(frozen=True)
class FaultKind:
    """One kind of fault. ``find(flight, context)`` lists the faults of a recording. ``doc``: the docstring of its file,
    which begins with ``name: sentence.`` and contains ``Smallest found: ...``.

    Effect. ``cuts``: its rows must not be used. ``spares``: streams in which it leaves the other streams intact.
    ``corrected``: timestamps are corrected rather than cut; ``left_s(fault)``: the largest remaining time error if such
    a fault is found once more. ``cuts_logs``: rows of a logged estimate or command differ from the sent values. A jump
    of an estimate is its error and is scored; None: as ``cuts``. ``cuts_trim``: a mean of the commands is not a trim
    there; None: as ``cuts``.

    Extent. ``whole``: in every row of the recording. ``across``: faults in several streams are one event.
    ``log_ended``: the log of the stream stopped, and its end is the end of the recording, also after timestamps are
    corrected.

    Text. ``told``: an event in plain words, without a full stop (``fault_events`` defines {streams}, {columns},
    {count}, {seconds}, {size} ...). If empty, it is the first sentence of ``doc``. ``advice``: what to do.
    ``in_overview``: False if rates and numbers of samples show it already. ``in_diagnosis``: False if irrelevant to a
    diagnosis of the vehicle.

    ``injection``, ``file_injection``: an ``Injection``, or its place (``module:NAME``), loaded on demand.
    """

    name: str
    find: Callable[[Flight, Context], Sequence[Fault]]
    doc: str
    group: Group = "value"
    cuts: bool = False
    spares: frozenset[str] = frozenset()
    corrected: bool = False
    left_s: Callable[[Fault], float] | None = None
    cuts_logs: bool | None = None
    cuts_trim: bool | None = None
    whole: bool = False
    across: bool = False
    log_ended: bool = False
    told: str = ""
    advice: str = ""
    in_overview: bool = True
    in_diagnosis: bool = True
    injection: Injection | str | None = None
    file_injection: Injection | str | None = None

    def __post_init__(self) -> None:
        if self.cuts and self.corrected:
            raise ValueError(f"fault kind {self.name}: rows are cut or corrected, not both")
        if not self.doc.startswith(self.name) or not self.sentence or not self.smallest:
            raise ValueError(f"fault kind {self.name}: its text must begin with '{self.name}: sentence.' and "
                             "contain 'Smallest found: size.'")

    @property
    def sentence(self) -> str:
        """One-sentence description of the fault."""
        found = re.match(r"[^:]*:\s*(.+?\.)(?:\s|$)", self.doc, re.DOTALL)
        return " ".join(found[1].split()) if found else ""

    @property
    def smallest(self) -> str:
        """The smallest size that is found, in words; each ``Fault`` has its own as a number."""
        found = re.search(r"Smallest (?:found|reported)[^:]*:\s*(.+?)(?:\n\n|$)", self.doc, re.DOTALL)
        return " ".join(found[1].split()) if found else ""

    @property
    def merges(self) -> bool:
        """Whether faults of several streams at one time are one event: a link that is silent, a clock that moves."""
        return self.across or self.group in ("lost", "clock")

    @property
    def severity(self) -> Severity:
        """What becomes of its rows."""
        if self.cuts:
            return "cut"
        if self.corrected:
            return "corrected"
        return "information" if self.group == "information" else "noted"

    @property
    def into_flight(self) -> Injection | None:
        """Its injection into a flight, if there is one."""
        return _loaded(self.injection)

    @property
    def into_file(self) -> Injection | None:
        """Its injection into the bytes of a NanoBench CSV, if there is one."""
        return _loaded(self.file_injection)


def _loaded(injection: Injection | str | None) -> Injection | None:
    return _load(injection) if isinstance(injection, str) else injection


@functools.cache
def _load(place: str) -> Injection:
    module, _, name = place.partition(":")
    found: Injection = getattr(importlib.import_module(module), name)
    return found
