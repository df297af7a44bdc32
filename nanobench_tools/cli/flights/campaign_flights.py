"""``nanobench fly --campaign``: alternated controllers in pairs of equal battery voltage, then their comparison."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...errors import InputError, UsageError
from ...results.result import OPTIONAL, Result
from ...steps.options import Options
from ...steps.result_bodies import ControlBody
from ...tables.result_table import Table
from ..closing import again, close
from ..record import toc_cache
from .flight_controllers import pilot_for
from .flight_requests import FlightOptions

if TYPE_CHECKING:
    from ...practice.references import PathSpec
    from ...radio.campaign.campaign_plan import CampaignPlan
    from ...radio.campaign.campaign_state import CampaignState
    from ...radio.campaign.next_flight import Window
    from ...radio.fly import session
    from ...radio.fly.flight_plan import Plan

INTERRUPTED = 130


@dataclass(frozen=True, repr=False)
class CampaignBody(Result):
    """fly.json of a campaign. ``flights``: path, pair, controller, voltage at rest and recording of each that is done.
    ``pairs``: path, number, difference of voltages [V] and whether it is small enough. ``control``: their comparison,
    once all are done."""

    flights: Sequence[dict[str, Any]]
    planned: int
    within_V: float
    pairs: Sequence[dict[str, Any]]
    control: ControlBody | None = field(default=None, metadata=OPTIONAL)


def fly_campaign(options: Options, file: Path, common: FlightOptions, uri: str | None, mocap: str | None) -> int:
    """Flies what is left of the plan in ``file``; compares the controllers when all flights are done."""
    from ...radio.campaign.campaign_plan import read_campaign
    from ...radio.campaign.campaign_state import opened
    from ...radio.fly.checklist import check_plan
    from ...radio.recorder import check_folder

    plan = read_campaign(file)
    if uri is None or mocap is None or common.record_to is None:
        raise UsageError("--campaign needs --uri URI, --mocap SOURCE and --record DIR")
    for path in plan.paths:
        check_plan(_plan_from_its_start(path), common.limits)
    for controller in plan.controllers:
        pilot_for(controller.name, controller.setpoints, controller.simulator)
    check_folder(common.record_to)
    with opened(common.record_to, plan, options.say) as state:
        return _Campaign(options, state, common, uri, mocap).run()


def _plan_from_its_start(path: PathSpec) -> Plan:
    """Before a link is open: with the vehicle below the start of the path."""
    import numpy as np

    from ...radio.fly.flight_plan import Plan

    first = path.at(np.zeros(1)).position_m[0]
    return Plan(path, np.array([first[0], first[1], 0.0]), 0.0)


@dataclass(frozen=True)
class _Campaign:
    options: Options
    state: CampaignState
    common: FlightOptions
    uri: str
    mocap: str

    def run(self) -> int:
        """Exit code: 0 when all flights are done and compared."""
        from ...radio.campaign.campaign_run import fly_campaign as flown

        options, state, plan = self.options, self.state, self.state.plan
        before = len(state.done)
        if before:
            options.say(f"{before} of {len(plan.flights)} flights were done before")
        try:
            stop = flown(state, self._measure, self._fly, self._charge, options.say)
        except KeyboardInterrupt:
            options.say(f"interrupted: {len(state.done)} of {len(plan.flights)} flights are done")
            return INTERRUPTED
        body = campaign_body(state)
        if stop is not None:
            options.failed.append({"item": "fly", "file": self.uri, "error": f"landed early: {stop}"})
        else:
            body = replace(body, control=self._control())
        said = (f"{len(state.done)} of {len(plan.flights)} flights are done; "
                f"{sum(pair['matched'] for pair in body.pairs)} of {len(body.pairs)} complete pairs match")
        following: tuple[str, list[object]] = ("the other flights", again()) if stop is not None else (
            "the pairs of equal voltage", ["nanobench", "control", *state.recordings, "--plant", "real", "--protocol",
                                           "clean", "--verbose"])
        close(options, said, following[0], *following[1], screen=[pairs_table(state)])
        code = options.finish("fly", body)
        return INTERRUPTED if stop is not None and stop.rule == "interrupted" else code

    def _measure(self) -> float:
        from ...radio.campaign import rest_voltage
        from ...radio.fly.session import HOST

        return rest_voltage.rest_voltage(self.uri, HOST, toc_cache(), self.options.say)

    def _fly(self, window: Window) -> session.Result:
        from ...radio.campaign.campaign_run import check_window
        from ...radio.fly import session

        flight, plan = window.flight, self.state.plan
        controller = plan.controller(flight.controller)
        pilot = pilot_for(controller.name, controller.setpoints, controller.simulator)
        request = self.common.request(self.options, plan.paths[flight.path - 1], pilot, self.uri, self.mocap,
                                      sheet=self.state.sheet(flight))
        asked = request.confirm

        def confirm(ready: Any) -> None:
            check_window(window, ready)
            asked(ready)

        return session.fly_session(replace(request, confirm=confirm))

    def _charge(self, text: str) -> None:
        """Asks for another battery. Raises InputError without a terminal: the campaign goes on when it is called
        again."""
        if not sys.stdin.isatty():
            raise InputError(self.uri, text, "then give the same command again")
        click.echo(f"{text}. Enter goes on, Ctrl-C ends (the campaign can be continued)", err=True)
        try:
            input()
        except EOFError:
            raise KeyboardInterrupt from None

    def _control(self) -> ControlBody:
        """Task 2 on the recordings of the flights that are done."""
        from ...steps.controlling import control_body, control_screen

        quiet = replace(self.options, data=tuple(self.state.recordings), flights=[], failed=self.options.failed)
        flights = quiet.load()
        audits, _ = quiet.audit(flights)
        body = control_body(quiet, flights, audits, ("clean",))
        for part in control_screen(quiet, body):
            self.options.show(part)
        self.options.flights += quiet.flights
        return body


def campaign_body(state: CampaignState) -> CampaignBody:
    """Flights and pairs that are done."""
    from ...radio.campaign.next_flight import matches

    flights = [{**flown.flight._asdict(), "battery_V": flown.battery_V, "csv": flown.csv}
               for flown in state.done.values()]
    pairs = [{"path": pair[0].path, "pair": pair[0].pair, "apart_V": apart, "matched": matched}
             for pair, apart, matched in matches(state.plan, state.flown_V)]
    return CampaignBody(flights, len(state.plan.flights), state.plan.within_V, pairs)


def pairs_table(state: CampaignState) -> Table:
    """Every pair with the voltages of its flights."""
    plan: CampaignPlan = state.plan
    volts: Callable[[Any], str] = lambda f: f"{state.flown_V[f]:.3f}" if f in state.flown_V else "-"  # noqa: E731
    rows = []
    for path in range(1, len(plan.paths) + 1):
        for number in range(1, plan.repeats + 1):
            pair = sorted(plan.pair(path, number), key=lambda f: [c.name for c in plan.controllers].index(f.controller))
            known = [state.flown_V[f] for f in pair if f in state.flown_V]
            apart = max(known) - min(known) if len(known) == len(pair) else None
            rows.append((plan.paths[path - 1].trajectory_id, str(number), *map(volts, pair),
                         "-" if apart is None else f"{apart:.3f}",
                         "-" if apart is None else "yes" if apart <= plan.within_V + 1e-5 else "no"))
    return Table.plain(f"Battery at rest before each flight, V; a pair matches within {plan.within_V:g} V",
                       ("path", "pair", *(c.name for c in plan.controllers), "apart V", "matches"), rows)
