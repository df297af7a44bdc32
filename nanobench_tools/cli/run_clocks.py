"""The main job on several clocks: every row says its clock, and those of the published protocols are never moved."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from ..errors import InputError
from ..steps.options import Options
from ..steps.result_bodies import ControlBody, EstimateBody, GateBody, Joined, SysidBody
from ..time_offsets.moving.votes import AS_RECORDED

if TYPE_CHECKING:
    from ..auditing.recording_audit import Audit
    from ..flight import Flight
    from ..harness.clocks import Choice

SIMULATOR_RETIMED = "simulator_retimed.toml"


@dataclass(frozen=True)
class Recordings:
    """All recordings with their audits, and the selected clock; None: as recorded, and on further clocks what a clock
    changes much: logged estimates, dead reckoning, prediction."""

    options: Options
    flights: Sequence[Flight]
    audits: Mapping[str, Audit]
    clock: str | None = None


BRACKETED = ("drag_matrix_ekf",)
"""Dead reckoning that ``run`` shows on every clock, from nothing taken out to all that can be."""

COMPARED_CLOCKS: tuple[Choice, ...] = (("offset", ("position", "velocity")), ("retimed", ("position", "velocity")),
                            ("retimed", ("attitude",)), ("joint", ()))
"""Every clock that ``run`` puts each distinct recording on, with the logged estimates that are judged on it."""

Body = TypeVar("Body", bound=Joined)
Part = tuple[str, Callable[[], Body]]
"""(what it is, what makes its body)."""


def join(options: Options, parts: Sequence[Part[Body]]) -> Body:
    """One body from the ``parts``. A part that finds nothing to score is left out and said; InputError when that
    is all of them."""
    body: Body | None = None
    errors: list[InputError] = []
    for what, make in parts:
        try:
            found = make()
        except InputError as error:
            options.say(f"{what} left out: {error}")
            errors.append(error)
            continue
        body = found if body is None else body.joined(found)
    if body is None:
        raise errors[0]
    return body


def estimate_on(given: Recordings) -> EstimateBody:
    """estimate.json. No judged estimate is used to estimate its clock (``moving.votes``). Further clocks score only
    the logged estimate and dead reckoning, each distinct recording once."""
    from ..auditing.selection import distinct
    from ..protocols import compare
    from ..protocols.task3 import BLACKOUT, PROTOCOLS
    from ..steps.estimating import LOGGED, RECKONING, estimate_body, see
    from ..steps.named_methods import load_methods

    def recorded(*protocols: str) -> EstimateBody:
        # trajectories are what "nanobench estimate --out" writes: 90 MB that nothing here reads
        seen = see(given.options, given.flights, given.audits)
        return estimate_body(given.options, seen, protocols, trajectories=False)

    def moved(clock: str) -> EstimateBody:
        options = replace(given.options, clock=clock)
        alone = given.clock is not None
        seen = see(options, given.flights if alone else distinct(given.flights)[0], given.audits)
        return estimate_body(options, seen, ("clean",), None if alone else load_methods("estimators", LOGGED),
                             trajectories=False)

    def reckoned(clock: str, methods: Sequence[str] = RECKONING) -> EstimateBody:
        options = replace(given.options, clock=clock)
        seen = see(options, distinct(given.flights)[0], given.audits)
        return estimate_body(options, seen, (BLACKOUT,), load_methods("estimators", methods), None, False)

    clocks = (AS_RECORDED, "retimed") if given.clock is None else (given.clock,)
    further: list[Part[EstimateBody]] = [(f"{BLACKOUT}, clock {clock}", partial(reckoned, clock)) for clock in clocks]
    if given.clock is None:
        further += [(f"{BLACKOUT}, clock {clock}", partial(reckoned, clock, BRACKETED))
                    for clock in ("offset", "joint")]
    body = _parts(given, PROTOCOLS, recorded, moved, ("offset", "retimed"), further)
    rows = compare.clocks(body.rows, body.per_flight, body.windows or (), AS_RECORDED,
                          given.options.sessions.by_name(given.flights), given.options.seed)
    return replace(body, rows=rows)


def control_on(given: Recordings) -> ControlBody:
    """control.json; the gate of the shipped plant on the one clock, by default as recorded."""
    from ..protocols.task2 import PROTOCOLS
    from ..steps.controlling import control_body
    from .control_plants import Chosen, gate_body

    def recorded(*protocols: str) -> ControlBody:
        return control_body(given.options, given.flights, given.audits, protocols)

    def moved(clock: str) -> ControlBody:
        options = replace(given.options, clock=clock)
        return control_body(options, *options.on_clock(given.flights, given.audits), ("clean",))

    def gate() -> GateBody:
        options = replace(given.options, clock=given.clock or AS_RECORDED)
        flights, audits = options.on_clock(given.flights, given.audits)
        return gate_body(options, flights, audits, Chosen.of(options, None, ()), recorded=given.flights)

    body = _parts(given, PROTOCOLS, recorded, moved)
    return replace(body, gate=gate())


def sysid_on(given: Recordings) -> SysidBody:
    """sysid.json. The models are fitted to the training flights and scored on the test flights of one clock; each
    clock has a separate simulator file. Entries other than rows belong to the ``clock`` they give; those of every
    other clock are in ``by_clock``."""
    from ..auditing.selection import distinct
    from ..protocols import compare
    from ..protocols.task1 import JUDGED
    from .sysid import sysid_body
    from .sysid_models import SIMULATOR

    alone = given.clock is not None
    found: dict[str, SysidBody] = {}

    def on(clock: str, simulator: str) -> SysidBody:
        options = replace(given.options, clock=clock)
        flights = given.flights if alone or clock == AS_RECORDED else distinct(given.flights)[0]
        found[clock] = sysid_body(options, *options.on_clock(flights, given.audits, JUDGED), simulator=simulator,
                                  recorded=None if clock == AS_RECORDED else flights)
        return found[clock]

    files = {given.clock: SIMULATOR} if given.clock else {AS_RECORDED: SIMULATOR, "retimed": SIMULATOR_RETIMED}
    body = join(given.options, [(f"clock {clock}", partial(on, clock, name)) for clock, name in files.items()])
    rows = compare.prediction_clocks(body.rows, body.per_flight, AS_RECORDED,
                                     given.options.sessions.by_name(given.flights), given.options.seed)
    first, *others = found
    return replace(body, rows=rows, clock=first, by_clock={clock: found[clock].models for clock in others})


def _parts(given: Recordings, protocols: Sequence[str], recorded: Callable[..., Body],
           moved: Callable[[str], Body], clocks: Sequence[str] = (), further: Sequence[Part[Body]] = ()) -> Body:
    """All protocols as recorded and ``clean`` on more ``clocks``, or ``clean`` on the one selected clock. Then the
    ``further`` parts."""
    if given.clock is None:
        parts: list[Part[Body]] = [("everything as recorded", recorded), *((c, partial(moved, c)) for c in clocks)]
    else:
        parts = [(p, partial(recorded, p)) for p in protocols if p != "clean"]
        clean = partial(recorded, "clean") if given.clock == AS_RECORDED else partial(moved, given.clock)
        parts.append((f"clean, clock {given.clock}", clean))
    return join(given.options, [*parts, *further])
