"""``nanobench control --learned all``: cloned policies and MPPI, on learned dynamics and on the plant."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..protocols.published import beside
from ..protocols.sessions import Drawn
from ..steps.options import Options, one_line
from ..steps.result_bodies import LearnedRow, Lessons
from ..steps.show import data_word, rich_table, score_text

if TYPE_CHECKING:
    from controllers.learned.policies import Network

    from ..auditing.recording_audit import Audit
    from ..flight import Flight
    from ..practice.references import PathSpec
    from ..protocols.gate import GateSummary
    from ..protocols.simulated import SimulatedRow
    from .control_plants import Chosen

CLONED = ("bc_mlp", "bc_lstm")
ON_DYNAMICS = (*CLONED, "mppi")
NEEDED = {"bc_mlp": {"bc_mlp"}, "bc_lstm": {"bc_lstm"}, "mppi_learned": {"bc_mlp", "dynamics"}}
"""Networks that a row needs."""
TAUGHT = ("circle", "figure_eight", "helix", "oval", "star", "trefoil")
TAUGHT_PLANTS = 2
"""A teacher corrects on the first three of these families that do not judge, on so many plants each."""
TUNED = {"controllers.learned.pilots:MppiFar": "mppi_far"}
"""Of what ``tune`` searches, and its row."""
MPPI_FLIGHTS = 4
"""MPPI plans 128 rollouts at every tick of a flight: only so many of the published reference are flown."""
COLUMNS = (("rmse_m", "RMSE m", 4), ("ade_m", "ADE m", 4), ("velocity_rmse_m_s", "velocity m/s", 4),
           ("heading_deg", "heading deg", 2), ("divergence_percent", "> 0.5 m %", 2), ("valid_percent", "flown %", 1),
           ("setpoint_rmse_m", "to setpoint m", 4))


def learned_rows(options: Options, flights: Sequence[Flight], audits: Mapping[str, Audit], chosen: Chosen,
                 specs: Sequence[PathSpec], members: int, summary: Mapping[str, GateSummary] | None, rounds: int,
                 gains: Mapping[str, Mapping[str, float]] | None = None
                 ) -> tuple[list[LearnedRow | SimulatedRow], Lessons]:
    """Rows, the trained networks and their data. Rows on learned dynamics (plant ``learned``) come with the published
    numbers, then rows on the ensemble (plant ``simulated``). ``rounds``: of correction by the teacher; gains: with
    these, those of TUNED fly again."""
    from controllers.learned.demonstrations import demonstrations, shown
    from controllers.learned.learned_flights import corrected
    from controllers.learned.policies import KINDS, trained
    from identification.learned.libraries import libraries

    from .sysid_learned import checkpoint_folder

    libraries()
    found = shown(demonstrations(flights, audits), options.seed)
    folder = checkpoint_folder(options)
    networks = _each(options, KINDS, lambda kind: trained(kind, found, None, folder, options.quiet))
    options.say(f"policies learn from {len(found.train)} flights of the onboard PID, {len(found.valid)} validate")
    rows = dynamics_rows(options, found, networks)
    plain = dict(networks)
    if rounds:
        paths = taught_on(specs)
        networks |= {f"{kind}_dagger": network for kind, network in _each(
            options, [kind for kind in CLONED if kind in plain], lambda kind: corrected(
                kind, found, plain[kind], paths, chosen.simulator, rounds, TAUGHT_PLANTS, options.seed, chosen.draws,
                folder, options.quiet)).items()}
    _draw(options, found, plain)
    flown = plant_rows(options, networks, chosen, specs, members, summary, gains)
    return [*rows, *flown], Lessons({name: network.trained for name, network in networks.items()},
                                    *([d.name for d in part] for part in (found.train, found.valid, found.test)))


def taught_on(specs: Sequence[PathSpec]) -> list[PathSpec]:
    """Paths on which the teacher corrects: of other families than ``specs``, as fast and as long."""
    from ..protocols.simulated import specs_of

    judged = {spec.family for spec in specs}
    speeds = sorted({spec.params["speed_mps"] for spec in specs if "speed_mps" in spec.params})
    return specs_of([name for name in TAUGHT if name not in judged][:3], speeds[:1], specs[0].duration_s)


def _each(options: Options, kinds: Sequence[str], train: Callable[[str], Network]) -> dict[str, Network]:
    """{kind: network}; a training that fails is kept in ``options`` and is no row, the others go on."""
    found = {}
    for kind in kinds:
        try:
            found[kind] = train(kind)
        except InputError as error:
            options.failed.append({"item": f"train {kind}", "file": error.place, "error": str(error)})
    return found


def _draw(options: Options, shown: Any, networks: Mapping[str, Any]) -> None:
    """learned_commands.html in ``--out``."""
    if options.out is None or not shown.test:
        return
    from controllers.learned.policies import commands
    from identification.learned.learning_pictures import command_figure, learning_figure, write_page

    flight = next((d for d in shown.test if d.controller == "pid"), shown.test[0])
    predicted = {kind: commands(networks[kind], flight) for kind in CLONED if kind in networks}
    write_page(options.out / "learned_commands.html",
               [command_figure(flight.action[flight.longest], predicted, flight.name),
                learning_figure({kind: network.trained["history"] for kind, network in networks.items()})],
               options.synthetic, "Cloned policies")


def dynamics_rows(options: Options, shown: Any, networks: Mapping[str, Any]) -> list[LearnedRow]:
    """Rows of flights on learned dynamics: the published reference by who flew it, and all test flights."""
    from controllers.learned.demonstrations import TEACHER
    from controllers.learned.rollouts import rolled, score

    from ..protocols.score_tables import summaries
    from ..protocols.task2 import PUBLISHED

    rows, sessions = [], options.sessions.by_name(options.flights)
    reference = " ".join(PUBLISHED)
    published = [d for d in shown.test if d.reference == reference]
    for pilot in (name for name in ON_DYNAMICS if {*NEEDED.get(name, CLONED[:1]), "dynamics"} <= set(networks)):
        slow = pilot == "mppi"
        flights = published[:MPPI_FLIGHTS] if slow else [*published,
                                                         *(d for d in shown.test if d.reference != reference)]
        if not flights:
            options.say(f"{pilot} does not fly on the learned dynamics: no test flight"
                        + f" along {reference}" * slow)
            continue
        scored = [(d, score(states, d)) for d, states in zip(flights, rolled(pilot, dict(networks), flights),
                                                             strict=True)]
        own = [(d, s) for d, s in scored if d.reference == reference]
        for label, members in ((reference, own),
                               (f"{reference}, flown by {TEACHER}",
                                [(d, s) for d, s in own if d.controller == TEACHER]),
                               ("all", [] if slow else scored)):
            if members:
                labels = [sessions[d.name] for d, _ in members]
                statistics = summaries([s for _, s in members], options.seed, labels)
                rows.append(LearnedRow(
                    "learned", pilot, label, None, "as flown", len(members), Drawn.of(labels, statistics), statistics,
                    {name: value.mean for name, value in statistics.items()},
                    beside("task2", "learned", pilot) if label == reference else None))
    _show(options, rows)
    return rows


def plant_rows(options: Options, networks: Mapping[str, Any], chosen: Chosen, specs: Sequence[PathSpec], members: int,
               summary: Mapping[str, GateSummary] | None,
               gains: Mapping[str, Mapping[str, float]] | None = None) -> list[SimulatedRow]:
    """Rows of the learned controllers on the ensemble of plants, with the gate's error bar."""
    from controllers.learned.learned_flights import PILOTS, fly_learned

    from ..harness import make_item
    from ..protocols.simulated import LOST_M, tabulate
    from ..steps.control_tables import show_simulated
    from .control_plants import error_bar

    bar = error_bar(options, chosen, summary)
    wanted: list[tuple[str, Mapping[str, float] | None]] = [
        (name, None) for name in (*PILOTS, *(name for name in networks if name.endswith("_dagger")))
        if set(NEEDED.get(name, ())) <= set(networks)]
    wanted += [(TUNED[name], dict(found)) for name, found in (gains or {}).items() if name in TUNED]
    items = [make_item(fly_learned, {"name": name, "networks": dict(networks), "specs": list(specs),
                                     "simulator": chosen.simulator, "plants": members, "seed": options.seed,
                                     "draws": chosen.draws, "gains": tuned},
                       f"simulated {name}{' tuned' if tuned is not None else ''}", file=name)
             for name, tuned in wanted]
    values = options.run(items, "simulated").values
    rows = [row for item in items if item.key in values for row in tabulate([values[item.key]], specs, bar)]
    show_simulated(options, rows, bar, 0.0, 0.0, 0.0)
    for row in rows:
        kept = row.statistics["kept_s"].median
        options.detail(f"{one_line(row.controller)}, {row.reference}: within {LOST_M:g} m of its path for "
                     f"{kept:.1f} s (median of {row.n} plants), {row.metrics['lost_percent']:.0f} % lost")
    return rows


def _show(options: Options, rows: Sequence[LearnedRow]) -> None:
    from ..protocols.sessions import interval_note

    title = (f"Task 2, learned controllers on learned dynamics: {data_word(options)} flights held out, scored against "
             "the logged path until 2 m away, mean ± SD over n flights")
    table = rich_table(title, ("reference", "controller", "n"), [heading for _, heading, _ in COLUMNS])
    for row in rows:
        lines: list[tuple[str, str, Mapping[str, Any]]] = [(row.reference, str(row.n), row.statistics)]
        if row.published is not None:
            lines.append(("(published)", str(row.published.published_n), row.published.published))
        for reference, n, found in lines:
            table.add_row(one_line(reference), row.controller, n,
                          *(score_text(found[m], 1.0, digits) if m in found else "" for m, _, digits in COLUMNS))
    options.detail(table)
    options.detail(interval_note(rows))
