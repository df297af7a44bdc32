"""The plant's side of ``nanobench control``: which plant, the gate, simulated rows, and their tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, UsageError
from ..results.fitted_values import LeftOut
from ..steps.control_tables import show_mismatch, show_simulated
from ..steps.options import Options, one_line
from ..steps.result_bodies import GateBody, GateJudged, SimulatedPart
from ..steps.show import data_word, rich_table
from ..time_offsets.moving.votes import AS_RECORDED, evidence_of

if TYPE_CHECKING:
    from ..auditing.recording_audit import Audit
    from ..flight import Flight
    from ..practice.references import PathSpec
    from ..protocols.compare import GateChange
    from ..protocols.gate import GateRow, GateSummary
    from ..protocols.simulated import ErrorBar, MismatchRow, SampledFlight, SimulatedRow
    from ..protocols.task1 import Case

CHUNK = 8
"""Recordings that fly side by side in one item: as many as fill a vector."""
TOGETHER = 5
"""Families of paths that fly side by side in one item: vehicles in company cost less."""
SHIPPED_GATE = "recorded_vehicle_gate.toml"


@dataclass(frozen=True)
class Chosen:
    """A plant: text of its simulator.toml, draws of its parameters (names, rows) or None, and its origin in words.

    ``trained`` has (start, end) in Unix time of the recordings it was identified from."""

    simulator: str
    draws: tuple[tuple[str, ...], list[list[float]]] | None
    trained: tuple[tuple[float, float], ...]
    origin: str
    shipped: bool = False

    @classmethod
    def of(cls, options: Options, simulator: Path | None, train: Sequence[Path]) -> Chosen:
        """From a file, identified from recordings, or the one that is shipped."""
        from controllers.plants.ensemble import shipped_draws, shipped_simulator

        if simulator is not None:
            from controllers.plants.plant import closed_loop_model

            from ..physics.simulator import loads, read_quadrotor

            read_quadrotor(simulator, "the firmware behind the plant")  # says which line is wrong
            text = simulator.read_text(encoding="utf-8")
            closed_loop_model(loads(text, str(simulator)))
            return cls(text, None, (), str(simulator))
        if train:
            return cls._identified(options, train)
        names, rows = shipped_draws()
        return cls(shipped_simulator(), (names, rows.tolist()), shipped_gate().trained,
                   "the recorded vehicle as shipped", True)

    @classmethod
    def _identified(cls, options: Options, train: Sequence[Path]) -> Chosen:
        from ..auditing.selection import distinct
        from ..protocols.completed import completed
        from ..protocols.task1 import training_cases

        flights = options.load(train)
        audits, _ = options.audit(flights)
        flights, audits = options.on_clock(flights, audits)
        cases = training_cases(completed(distinct(flights)[0]), audits)
        if not cases:
            raise InputError(str(train[0]), "no recording to identify a plant from",
                             "give some with motion capture, IMU, motors, battery and attitude")
        return cls.fitted(options, cases, ", ".join(map(str, train)))

    @classmethod
    def fitted(cls, options: Options, cases: Sequence[Case], where: str) -> Chosen:
        """The vehicle of the training flights ``cases``, which are in ``where``."""
        from identification.vehicle.vehicle_fit import fit_vehicle

        from ..physics.simulator import dumps

        found = fit_vehicle(cases, seed=options.seed)
        spans = tuple((case.flight.epoch_s + float(case.flight["mocap"].time_s[0]),
                       case.flight.epoch_s + float(case.flight["mocap"].time_s[-1])) for case in cases)
        priors = sum(p.prior_share == 1.0 for p in found.parameters.values())
        options.say(f"plant identified from {found.flights} recordings; {priors} of {len(found.parameters)} parameters "
                    "are priors")
        return cls(dumps(found.model), (found.model.names, found.draws.tolist()), spans,
                   f"identified from {found.flights} recordings in {where}")


@dataclass(frozen=True)
class ShippedGate:
    """The shipped plant: (start, end) in Unix time of the recordings it was identified from, and its gate on their own
    clock."""

    trained: tuple[tuple[float, float], ...]
    error_bar: ErrorBar


def shipped_gate() -> ShippedGate:
    """Of ``SHIPPED_GATE``."""
    import tomllib
    from importlib import resources

    from ..protocols.simulated import ErrorBar

    found = tomllib.loads(resources.files("controllers.plants").joinpath(SHIPPED_GATE).read_text(encoding="utf-8"))
    summary = found["summary"][AS_RECORDED]
    return ShippedGate(tuple((float(a), float(b)) for a, b in found["trained"]),
                       ErrorBar(summary["ratio_off_median"], summary["ratio_off_p90"], summary["path_gap_median_m"],
                                summary["n"], "held-out recordings, as shipped"))


def given_gains(options: Options, files: Sequence[Path]) -> dict[str, dict[str, float]]:
    """{controller: gains} of files that ``tune`` wrote."""
    from controllers.gains import read_gains, reports_better

    found: dict[str, dict[str, float]] = {}
    for path in files:
        name, gains = read_gains(path)
        if name in found:
            raise UsageError(f"--gains {path}: gains of {name} are given twice")
        if not reports_better(path):
            options.say(f"--gains {path}: these were not shown to be better than {name}'s own")
        found[name] = gains
    return found


def check_simulated(controllers: Sequence[str], trajectories: Sequence[str], speeds: Sequence[float],
                    seconds: float) -> list[PathSpec]:
    """The paths; UsageError for an unknown controller, trajectory or too short a path, before anything is read."""
    from controllers.plants.simulated_flights import settled_s

    from ..lookup.registry import load
    from ..protocols.simulated import specs_of

    specs = specs_of(trajectories, speeds, seconds)
    settled_s(specs)
    for name in controllers:
        load("controllers", name)
    return specs


def gate_body(options: Options, flights: Sequence[Flight], audits: Mapping[str, Audit], chosen: Chosen,
              requested: bool = False, recorded: Sequence[Flight] = ()) -> GateBody:
    """The gate, with the table shown and paths written to ``--out``.
    ``recorded``: the flights on their own stamps.

    Raises InputError when it was ``requested`` for and no recording can be judged.
    """
    from controllers.plants.gate_flights import fly_cases

    from ..harness import make_item
    from ..protocols import gate

    cases, reasons = gate.select(flights, audits, chosen.trained, recorded)
    if not cases:
        note = "no recording can validate the plant: " + "; ".join(sorted(set(reasons.values())))
        if requested:
            raise InputError(flights[0].provenance.path if flights else "data", note)
        return GateBody(gate_note=note)
    chunks = [same[i:i + CHUNK] for name in gate.FLOWN
              for same in [sorted((c for c in cases if c.controller == name), key=lambda c: c.ticks)]
              for i in range(0, len(same), CHUNK)]
    items = [make_item(fly_cases, {"cases": chunk, "simulator": chosen.simulator, "seed": options.seed},
                       f"gate {chunk[0].controller} {', '.join(c.flight.name for c in chunk)}",
                       file=chunk[0].flight.provenance.path) for chunk in chunks]
    values = options.run(items, "gate").values
    rows: list[gate.GateRow] = []
    by_name = {case.flight.name: case.flight for case in cases}
    seen = {flight.name: flight for flight in flights}
    flown: dict[str, list[list[float]]] = {}
    for again in values.values():
        rows += [replace(row, clock=options.clock, clock_evidence=evidence_of([seen[row.flight]]))
                 for row in again.rows]
        flown |= again.paths
    if options.out is not None:
        _write_paths(options.out, by_name, flown)
    rows.sort(key=lambda row: row.flight)
    shown = gate.pictured(rows, cases, flown)
    found = gate.summary(rows, options.sessions.by_name(by_name.values()), options.seed)
    _show_gate(options, rows, found)
    judged = GateJudged(shown, found, chosen.origin, LeftOut.of(dict(sorted(reasons.items()))))
    return GateBody(rows, judged, _gate_note(found, chosen))


def gate_on_clock(options: Options, flights: Sequence[Flight], audits: Mapping[str, Audit], chosen: Chosen,
                  requested: bool) -> GateBody:
    """``gate_body`` on the clock of the options. On another clock than the recordings' own, adds ``gate_compared``:
    ratios to the gate as recorded over the same flights. That gate flies first and is not shown."""
    from ..protocols import compare

    seen, judged = options.on_clock(flights, audits)
    if options.clock == AS_RECORDED:
        return gate_body(options, seen, judged, chosen, requested, flights)
    plain = replace(options, clock=AS_RECORDED, quiet=True)
    recorded = gate_body(plain, flights, audits, chosen, False, flights).gate
    body = gate_body(options, seen, judged, chosen, requested, flights)
    found = compare.gates(body.gate, recorded, options.sessions.by_name(flights), options.seed)
    if found:
        passed = [sum(row.passed for row in rows) for rows in (recorded, body.gate)]
        options.detail(f"As recorded {passed[0]} of {len(recorded)} flights pass, with clock {options.clock} "
                     f"{passed[1]} of {len(body.gate)}. Over the same {found['path_gap_m'].paired.n} flights: "
                     + "; ".join(_change(name, one) for name, one in found.items() if one.paired.ratio is not None)
                     + ".")
    return replace(body, gate_compared=found)


GATE_WORDS = {"path_gap_m": ("distance of the two paths", 100.0, "cm", 1),
              "lag_off_s": ("difference of the lags", 1e3, "ms", 1),
              "rmse_ratio_off": ("how far the RMSE is off", 100.0, "%", 1),
              "failed_share": ("flights that fail", 100.0, "%", 0)}
"""What ``compare.gates`` compares: in words, factor to the unit shown, unit, digits."""


def _change(name: str, one: GateChange) -> str:
    from ..protocols import compare

    words, factor, unit, digits = GATE_WORDS[name]
    return (f"{words} {factor * one.mean_recorded:.{digits}f} -> {factor * one.mean:.{digits}f} {unit}, "
            f"{compare.verdict(one.paired.ratio, one.paired.ci95)}")


def _write_paths(out: Path, flights: Mapping[str, Flight], paths: Mapping[str, Any]) -> None:
    from ..protocols.trajectories import write_tum

    for name, rows in paths.items():
        write_tum(out / "trajectories" / "gate" / f"{name}.tum", flights[name], np.array(rows, float))


def _gate_note(found: Mapping[str, GateSummary], chosen: Chosen) -> str:
    parts = [f"{name}: RMSE ratio within 10 % on {100.0 * s.ratio_share:.0f} % of {s.n} flights (aim 85). Medians: lag "
             f"difference {1e3 * s.lag_diff_median_s:+.0f} ms (aim 30), path gap {100.0 * s.path_gap_median_m:.1f} cm "
             "(aim 5)" for name, s in found.items() if name != "all"]
    return (f"plant: {chosen.origin}; given setpoints, battery, gaps of the radio and state at the start; "
            + "; ".join(parts))


def _show_gate(options: Options, rows: Sequence[GateRow], found: Mapping[str, GateSummary]) -> None:
    from ..protocols.sessions import interval_note

    title = (f"Gate: {data_word(options)} held-out flights flown again on the plant, clock {options.clock}; given: "
             "setpoints, battery, gaps of the radio, state at the start")
    table = rich_table(title, ("flight", "controller"),
                       ("RMSE recorded m", "simulated m", "ratio", "lag diff ms", "gap cm", "pass"))
    for row in rows:
        table.add_row(one_line(row.flight), row.controller, f"{row.rmse_real_m:.3f}",
                      f"{row.rmse_sim_m:.3f}", f"{row.ratio:.3f}", f"{1e3 * row.lag_diff_s:+.0f}",
                      f"{100.0 * row.path_gap_m:.1f}", "yes" if row.passed else "no")
    options.detail(table)
    for row in rows:
        if row.reason:
            options.detail(one_line(f"{row.flight}: {row.reason}"))
    for name, s in found.items():
        ends = s.statistics["pass_share"].ci95
        interval = f" (95 % {100.0 * ends[0]:.0f} to {100.0 * ends[1]:.0f})" if ends else ""
        options.detail(f"{name}: {s.n} flights, {100.0 * s.pass_share:.0f} % pass all criteria{interval}. Passed: "
                     f"ratio {100.0 * s.ratio_share:.0f} %, lag {100.0 * s.lag_share:.0f} %, gap "
                     f"{100.0 * s.gap_share:.0f} %. Medians: ratio {s.ratio_median:.3f}, lag "
                     f"{1e3 * s.lag_diff_median_s:+.0f} ms, gap {100.0 * s.path_gap_median_m:.1f} cm")
    if "all" in found:
        options.detail(interval_note([found["all"]], ["pass_share", "lag_real_s"]))


def simulated_rows(options: Options, chosen: Chosen, names: Sequence[str], specs: Sequence[PathSpec], members: int,
                   summary: Mapping[str, GateSummary] | None, radio_s: float = 0.0, wind_m_s: float = 0.0,
                   silent: float = 0.0, gains: Mapping[str, Mapping[str, float]] | None = None
                   ) -> tuple[list[SimulatedRow], SimulatedPart]:
    """Rows of every controller on the ensemble, and with its ``gains`` too where some are given; and their body.
    Without ``names``: all registered controllers. An item is a controller on TOGETHER families."""
    from controllers.plants.simulated_flights import fly_controller

    from ..harness import make_item
    from ..protocols.simulated import solve_times, tabulate

    bar = error_bar(options, chosen, summary)
    own = [[spec for spec in specs if spec.family == name] for name in dict.fromkeys(s.family for s in specs)]
    families = [list(chain(*own[i:i + TOGETHER])) for i in range(0, len(own), TOGETHER)]
    items = {(name, tuned is not None, k): make_item(
        fly_controller, {"name": name, "specs": same, "simulator": chosen.simulator, "plants": members,
                         "seed": options.seed, "draws": chosen.draws, "disturbed": k == 0, "radio_s": radio_s,
                         "wind_m_s": wind_m_s, "silent": silent, "gains": tuned},
        f"simulated {name}{' tuned' if tuned is not None else ''} {same[0].family} to {same[-1].family}", file=name)
        for name, tuned in _versions(names, gains) for k, same in enumerate(families)}
    values = options.run(list(items.values()), "simulated").values
    rows: list[SimulatedRow] = []
    flights: list[SampledFlight] = []
    for (_, _, k), item in items.items():
        found = values.get(item.key)
        if found is None:
            continue
        rows += tabulate([found], families[k], bar, radio_s, wind_m_s, 100.0 * silent)
        flights += [replace(path, controller=found.controller) for path in found.paths]
    if not rows and not options.failed:
        raise UsageError("no controller to fly")
    show_simulated(options, rows, bar, radio_s, wind_m_s, silent)
    times = solve_times([values[item.key] for item in items.values() if item.key in values])
    return rows, SimulatedPart(flights, times, bar, chosen.origin)


def _versions(names: Sequence[str], gains: Mapping[str, Mapping[str, float]] | None,
              ) -> list[tuple[str, dict[str, float] | None]]:
    """(controller, gains): each as it is, and those with gains again with these."""
    from ..lookup.registry import names as registered

    wanted = list(dict.fromkeys([*(names or registered("controllers")), *(gains or {})]))
    return [(name, None) for name in wanted] + [(name, dict(found)) for name, found in (gains or {}).items()]


def mismatch_rows(options: Options, chosen: Chosen, names: Sequence[str], specs: Sequence[PathSpec],
                  gains: Mapping[str, Mapping[str, float]] | None = None) -> list[MismatchRow]:
    """Every controller on plants that each differ from its assumptions in one thing."""
    from controllers.plants.simulated_flights import fly_mismatched

    from ..harness import make_item
    from ..protocols.simulated import tabulate_cases

    items = [make_item(fly_mismatched, {"name": name, "specs": list(specs), "simulator": chosen.simulator,
                                        "seed": options.seed, "gains": tuned}, f"mismatch {name}", file=name)
             for name, tuned in _versions(names, gains)]
    values = options.run(items, "mismatch").values
    rows = [row for item in items if item.key in values for row in tabulate_cases(values[item.key], specs)]
    show_mismatch(options, rows)
    return rows


def error_bar(options: Options, chosen: Chosen, summary: Mapping[str, GateSummary] | None) -> ErrorBar | None:
    """What the gate of this plant says of a simulated RMSE: of the gate in this run, else of the shipped plant's; None
    for another plant that no flight has judged."""
    from ..protocols.simulated import ErrorBar

    if summary and "all" in summary:
        found = summary["all"]
        return ErrorBar(found.ratio_off_median, found.ratio_off_p90, found.path_gap_median_m, found.n,
                        "gate of this run")
    return shipped_gate().error_bar if chosen.shipped else None
