"""What ``estimate`` adds for pictures: single estimates with their three standard deviations, dead logs, and where the
onboard filter's error comes from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from ..results.result import INLINE, Result
from ..time_offsets.moving.votes import AS_RECORDED
from .options import Options

if TYPE_CHECKING:
    from ..auditing.recording_audit import Audit
    from ..flight import Flight
    from ..protocols.aided import Aiding
    from ..protocols.attribution import Attribution
    from ..protocols.bands import Band
    from ..protocols.task3 import Case

Done = Sequence[tuple[Any, "Case", Any]]
"""(method, case, value) of what was scored."""

JUDGES = (AS_RECORDED, "offset", "retimed")
JUDGED_ESTIMATE = ("position", "velocity")
"""No figure of an attribution is about attitude."""


@dataclass(frozen=True, repr=False)
class DrawnBand(Result):
    """The band of one method on one flight, or one window of it, and its ``name`` in the picture."""

    protocol: str
    name: str
    flight: str
    method: str
    clock: str
    band: Band = field(metadata=INLINE)


def aided_bands(options: Options, done: Done, aiding: Aiding) -> list[DrawnBand]:
    """Of the flight with the first telling method's median error."""
    from ..protocols.bands import aided_band, median_case
    from ..protocols.task3 import AIDED

    case = next((case for scored in _by_method(done) if (case := median_case(scored)) is not None), None)
    if case is None:
        return []
    kwargs = {"case": case, "aiding": aiding, "seed": options.seed}
    name = (f"{aiding.rate_hz:g} Hz, {1e3 * aiding.delay_s:g} ms late, {1e3 * aiding.noise_m:g} mm: "
            f"{case.flight.name}")
    return _bands(options, aided_band, done, case, kwargs, AIDED, name)


def blackout_bands(options: Options, done: Done) -> list[DrawnBand]:
    """The same for the window with the median end error."""
    from ..protocols.bands import blackout_band, median_window
    from ..protocols.task3 import BLACKOUT

    found = next((one for scored in _by_method(done) if (one := median_window(scored)) is not None), None)
    if found is None:
        return []
    case, t0, h = found
    name = f"no pose for {h:g} s: {case.flight.name}, from {t0:.1f} s on"
    kwargs = {"case": case, "t0_s": t0, "h_s": h}
    return _bands(options, blackout_band, done, case, kwargs, BLACKOUT, name)


def _by_method(done: Done) -> list[list[tuple[Case, Any]]]:
    names = dict.fromkeys(method.name for method, _, _ in done)
    return [[(case, value) for method, case, value in done if method.name == name] for name in names]


def _bands(options: Options, function: Any, done: Done, case: Case, kwargs: Mapping[str, Any],
           protocol: str, picture: str) -> list[DrawnBand]:
    from ..harness import make_item
    from ..protocols.task3 import is_logged

    methods = {method.name: method for method, one, _ in done if one is case and not is_logged(method)}
    items = {name: make_item(function, {**kwargs, "method": method}, f"{protocol} picture {name}",
                             file=case.flight.provenance.path) for name, method in methods.items()}
    values = options.run(list(items.values()), "3 sigma").values
    return [DrawnBand(protocol, picture, case.flight.name, name, options.clock, band) for name, item in items.items()
            if item.key in values and (band := values[item.key].band) is not None]


def attribution(options: Options, flights: Sequence[Flight], audits: Mapping[str, Audit]) -> Attribution:
    """What the onboard filter's error comes from, shown; see ``protocols.attribution``. InputError as ``task3.select``
    where no flight fits."""
    from estimators.drag_ekf import DragMatrixEkf
    from estimators.firmware_ekf import FirmwareEkf

    from ..auditing.selection import distinct
    from ..harness import make_item
    from ..protocols import attribution as protocol
    from ..protocols.task3 import select

    kept = distinct(flights)[0]
    on: dict[str, dict[str, Case]] = {}
    for clock in JUDGES:
        moved = replace(options, clock=clock)
        seen = moved.see_on_clock(kept, audits, JUDGED_ESTIMATE) if clock != AS_RECORDED else None
        cases = select(seen.flights, seen.audits, "clean") if seen else select(kept, audits, "clean")
        on[clock] = {case.flight.name: case for case in cases}
    names = [name for name in on[AS_RECORDED] if all(name in cases for cases in on.values())]

    def item(function: Any, what: str, name: str, **kwargs: Any) -> Any:
        return make_item(function, kwargs, f"attribution {what} {name}",
                         file=on[AS_RECORDED][name].flight.provenance.path)

    single = {clock: [item(protocol.logged, clock, name, case=on[clock][name]) for name in names] for clock in JUDGES}
    filters = protocol.Filters(FirmwareEkf, DragMatrixEkf())
    again = [item(protocol.replays, "replay", name, filters=filters, recorded=on[AS_RECORDED][name],
                  retimed=on["retimed"][name]) for name in names]
    values = options.run([*(one for items in single.values() for one in items), *again], "attribution").values
    flown = [on[AS_RECORDED][name].flight for name in names]
    sessions = {what: options.sessions.labels(flight for flight, one in zip(flown, items, strict=True)
                                              if one.key in values)
                for what, items in {**single, "replayed": again}.items()}
    return protocol.tabulate({clock: [values[one.key] for one in items if one.key in values]
                              for clock, items in single.items()},
                             [values[one.key] for one in again if one.key in values], options.seed, sessions)
