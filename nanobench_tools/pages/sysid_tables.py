"""Tables of Task 1 from sysid.json."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..physics.term_words import in_words
from ..protocols.sessions import short_note
from ..tables.method_names import fit_in_words
from ..tables.quantities import shown
from ..tables.result_table import Cell, Column, Score, Table
from .row_cells import (
    AS_RECORDED,
    CLOCK,
    DATA,
    RATIO_NOTE,
    RATIOS,
    SESSIONS,
    SYSID_METRICS,
    WHY,
    clock_in_place,
    clock_of,
    count_of,
    data_label,
    drop_blank,
    noted,
    of_one_clock,
    one_truth,
    rank_of,
    reason_of,
    score_column,
    session_cells,
    text_of,
)

TASK1_GROUPS = ("all", "seen", "unseen")
EXPORTED = "simulator.toml"
MOSTLY = 0.5
"""Share of the prior from which on a parameter is called a prior."""


def task1(sysid: Mapping[str, Any], synthetic: bool) -> Table:
    """Rows of ``sysid``: error after h steps of 10 ms and their sum, with the published row under ours."""
    rows = sysid.get("rows", [])
    horizons = _horizons(rows)
    scores = []
    for metric in SYSID_METRICS:
        how = shown(metric)
        for h in horizons:
            title = f"{how.title} Σ" if h == "sum" else f"{how.title} h={h}"
            scores.append(Column(f"{metric} h={h}", title, "score", how.unit, how.factor, how.decimals))
    columns = (Column("model", "Model"), Column("group", "Group"), Column("truth", "Truth"),
               Column("start", "Start"), CLOCK, *scores, Column("n_windows", "Windows", "count"),
               Column("n_flights", "Flights", "count"), SESSIONS, WHY,
               Column("information", "Given"), DATA)
    groups = [text_of(row.get("group")) for row in rows]
    rank = {group: (rank_of(group, TASK1_GROUPS), groups.index(group)) for group in groups}
    first = clock_of(of_one_clock(rows)[0]) if rows else AS_RECORDED
    rows = sorted(rows, key=lambda row: (clock_of(row) != first, rank[text_of(row.get("group"))],
                                         text_of(row.get("truth")) != "onboard", row.get("start") == "past"))
    lines: list[tuple[Cell, ...]] = []
    main = 0
    for row in rows:
        model, group, truth = (text_of(row.get(key)) for key in ("model", "group", "truth"))
        information = text_of(row.get("information"))
        if (published := row.get("published")) and clock_of(row) == first:
            lines.append((f"{model} (published)", "published table", truth, "", "",
                          *_horizon_scores(published, {}, horizons, exact=True), None, None, None, "", information,
                          "published"))
        lines.append((model, group, truth, text_of(row.get("start")), text_of(row.get("clock")),
                      *_horizon_scores(row.get("metrics"), row, horizons),
                      count_of(row.get("n_windows")), count_of(row.get("n_flights")), *session_cells(row), information,
                      data_label(synthetic)))
        main = len(lines) if group in ("", *TASK1_GROUPS) and clock_of(row) == first else main
    note = noted("Mean over windows with its 95 % interval; Σ is the sum over all steps.", rows)
    if main < len(lines):
        further = "groups and clocks" if any(clock_of(row) != first for row in rows) else "groups"
        note += f" Further {further} are in the CSV file."
    table = Table("table_task1", "Task 1: error of the predicted state after h steps of 10 ms", columns, tuple(lines),
                  note, main).without_empty_columns()
    return clock_in_place(drop_blank(table, "start"))


def sysid_screen(sysid: Mapping[str, Any], synthetic: bool) -> Table:
    """Every model over all test flights from the published start, for one screen; of the position the interval, too.
    The best model is the first row, then the exported vehicle."""
    best = sysid.get("best")
    rows = sorted((row for row in one_truth(sysid["rows"]) if row["group"] == "all"),
                  key=lambda row: (row["model"] != best, not row["model"].startswith(EXPORTED)))
    heads = {"position_mae_m": "position m", "velocity_mae_m_s": "velocity m/s", "attitude_mae_rad": "attitude rad",
             "rate_mae_rad_s": "rate rad/s"}
    lines: list[tuple[Cell, ...]] = []
    for row in rows:
        ends = row["ci95"]["position_mae_m"].get("50")
        lines.append((fit_in_words(row["model"]) + " (no result)" * bool(row.get("trouble")), row["information"],
                      *(f"{row['metrics'][m]['50']:.4f}" for m in heads),
                      f"{ends[0]:.4f} .. {ends[1]:.4f}" if ends else "-"))
        if theirs := row.get("published"):
            lines.append(("  published", "", *(f"{theirs[m]['50']:.4f}" for m in heads), ""))
    title = (f"Task 1, {data_label(synthetic)} data: mean error after half a second, "
             f"{(n := len(sysid['test']))} test flight{'s' * (n != 1)}")
    return Table.plain(title, ("model", "given", *heads.values(), "95 % of position"), lines, short_note(rows))


def vehicle_tables(sysid: Mapping[str, Any]) -> list[Table | str]:
    """A sentence on the priors of the exported vehicle, and its parameters with the share of the prior; empty where
    none was fitted."""
    fit = next((fit for fit in (sysid.get("fits") or {}).values() if fit.get("thrust_spread") is not None), None)
    if fit is None:
        return []
    groups: dict[str, list[Mapping[str, Any]]] = {}
    terms: dict[str, list[str]] = {}
    for name, entry in fit["parameters"].items():
        groups.setdefault(name.partition("[")[0], []).append(entry)
    lines: list[tuple[Cell, ...]] = []
    mostly: dict[str, list[str]] = {"prior alone": [], "mostly prior": []}
    for name, entries in groups.items():
        units = list(dict.fromkeys(entry["unit"] for entry in entries))
        shares = [entry.get("prior_share") or 0.0 for entry in entries]
        percents = [f"{100.0 * share:.0f}" for share in shares]
        lines.append((name, ", ".join(f"{entry['value']:.3g}" for entry in entries),
                      units[0] if len(units) == 1 else f"{units[0]} .. {units[-1]}",
                      percents[0] if len(set(percents)) == 1 else ", ".join(percents)))
        terms.setdefault(name.partition(".")[0], []).append(name)
        if min(shares) > MOSTLY:
            mostly["prior alone" if min(shares) == 1.0 else "mostly prior"].append(name)
    said = "; ".join(f"{what}: {', '.join(_terms(names, terms))}" for what, names in mostly.items() if names)
    table = Table.plain("The exported vehicle", ("parameter", "value", "unit", "prior %"), lines,
                        "100: these flights cannot identify it, and its prior is kept.")
    return [*([f"Exported vehicle, {said}."] if said else []), table]


def _terms(names: Sequence[str], terms: Mapping[str, Sequence[str]]) -> list[str]:
    """Terms in words; of a term that has other parameters, too, which are meant."""
    found = []
    for term in dict.fromkeys(name.partition(".")[0] for name in names):
        mine = [name.partition(".")[2] for name in terms[term] if name in names]
        found.append(in_words(term) + f" ({', '.join(mine)})" * (len(mine) < len(terms[term])))
    return found


def task1_commands(sysid: Mapping[str, Any], synthetic: bool) -> Table:
    """What every model answers to a command put into its inputs, and whether that is a vehicle."""
    rows = [row for row in one_truth(sysid.get("rows", [])) if row.get("command_response")]
    names = ("roll", "pitch", "yaw", "thrust")
    columns = (Column("model", "Model"), CLOCK, *(Column(name, f"{name} / physics", "score", decimals=3)
                                                  for name in names),
               Column("vehicle", "Is it a vehicle?"), Column("windows", "Windows", "count"), DATA)
    lines = tuple((text_of(row.get("model")), clock_of(row),
                   *(Score.of(row["command_response"][name]["ratio"]) for name in names),
                   row["command_response"]["vehicle"] or "signs are right",
                   count_of(row["command_response"]["windows"]), data_label(synthetic)) for row in rows)
    return clock_in_place(Table(
        "table_task1_commands", "Task 1: answer to a roll, pitch, yaw and thrust command put into the inputs", columns,
        lines, "Change of the rate (thrust: velocity) 0.2 s after a step of PWM, over that of rigid-body physics "
               "with parameters from firmware, scale and ruler. A value of 1 equals the physics; below 0 turns the "
               "other way."))


def task1_clocks(sysid: Mapping[str, Any], synthetic: bool) -> Table:
    """Every model on each clock, error at the last horizon over all test windows; empty unless there are several."""
    rows = [r for r in one_truth(sysid.get("rows", [])) if r.get("group", "all") == "all"]
    last = [h for h in _horizons(rows) if h.isdigit()][-1:]
    columns = (Column("model", "Model"), CLOCK, *(score_column(metric) for metric in SYSID_METRICS),
               Column("n_windows", "Windows", "count"), Column("information", "Given"), DATA)
    order = list(dict.fromkeys(text_of(row.get("model")) for row in rows))
    several = len({clock_of(row) for row in rows}) > 1 and last
    lines: tuple[tuple[Cell, ...], ...] = tuple(
        (text_of(row.get("model")), clock_of(row), *_horizon_scores(row.get("metrics"), row, last),
         count_of(row.get("n_windows")), text_of(row.get("information")), data_label(synthetic))
        for row in sorted(rows, key=lambda row: order.index(text_of(row.get("model")))) if several)
    return Table("table_task1_clocks", f"Task 1, before and after re-timing: error after {''.join(last)} steps",
                 columns, lines,
                 "Mean over windows with its 95 % interval. Fitted models were fitted to the training flights on the "
                 "same clock. Re-timed: the moving error of the clock is taken out of the vehicle's streams, off-line, "
                 "from the motion capture of the whole flight.").without_empty_columns()


def task1_ratios(sysid: Mapping[str, Any], synthetic: bool) -> Table:
    """Models over all test windows against the chosen one, and against themselves as recorded."""
    rows = [row for row in sysid.get("rows", []) if row.get("group", "all") == "all"]
    horizons = _horizons(rows)
    scores = tuple(Column(f"{metric} h={h}", f"{shown(metric).title} {'Σ' if h == 'sum' else f'h={h}'}", "score",
                          decimals=3, aside=h not in horizons[-2:]) for metric in SYSID_METRICS for h in horizons)
    columns = (Column("model", "Model"), Column("truth", "Truth"), CLOCK, Column("over", "Over"), *scores,
               Column("n_flights", "Flights", "count"), SESSIONS, WHY, DATA)
    lines = tuple((text_of(row.get("model")), text_of(row.get("truth")), text_of(row.get("clock")), text_of(row[to]),
                   *_horizon_scores(row[key], {"ci95": row[f"{key}_ci95"]}, horizons), count_of(row.get("n_flights")),
                   *session_cells(row), data_label(synthetic)) for key, to in RATIOS for row in rows if row.get(to))
    return Table("table_task1_ratios", "Task 1: errors against those of another row", columns, lines,
                 RATIO_NOTE).without_empty_columns()


def _horizons(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    found = {str(h) for row in rows for metric in SYSID_METRICS for h in ((row.get("metrics") or {}).get(metric) or {})}
    return sorted(found, key=lambda h: (not h.isdigit(), int(h) if h.isdigit() else 0))


def _horizon_scores(metrics: Any, row: Mapping[str, Any], horizons: Sequence[str], exact: bool = False) -> list[Score]:
    metrics, intervals = metrics or {}, row.get("ci95") or {}
    return [Score.of((metrics.get(m) or {}).get(h), (intervals.get(m) or {}).get(h), reason_of(row, m), exact)
            for m in SYSID_METRICS for h in horizons]


def task1_parameters(sysid: Mapping[str, Any], synthetic: bool) -> list[Table]:
    """Fitted or stated parameters with their intervals, if there are any."""
    columns = (Column("model", "Model"), Column("parameter", "Parameter"), Column("unit", "Unit"), CLOCK, DATA,
               Column("ci_why", "Remark"), Column("value", "Value", "score", decimals=4))

    common = _common_reason(sysid.get("parameters") or {})

    def rows(clock: str, models: Mapping[str, Any]) -> list[tuple[Cell, ...]]:
        return [(model, name, text_of(body.get("unit")), clock, data_label(synthetic),
                 text_of(body.get("ci_why")).removeprefix(common).removeprefix("; "), Score.of(body))
                for model, parameters in models.items() for name, body in _scalars(parameters)]

    lines = rows(text_of(sysid.get("clock")), sysid.get("parameters") or {})
    others = [line for clock, found in (sysid.get("by_clock") or {}).items()
              for line in rows(clock, found.get("parameters") or {})]
    if not lines:
        return []
    note = text_of(sysid.get("parameters_note"))
    note += f" Intervals: {common}." if common not in note else ""
    note += " Those fitted on another clock are in the CSV file." if others else ""
    table = Table("table_task1_parameters", "Task 1: parameters of the models", columns, (*lines, *others),
                  note.strip(), len(lines))
    return [clock_in_place(drop_blank(table, "ci_why"))]


def _common_reason(models: Mapping[str, Any]) -> str:
    """Remarks that apply to every interval, given once, below the table."""
    said = {text_of(body.get("ci_why")).split("; ")[0] for parameters in models.values()
            for body in parameters.values() if body.get("ci95")}
    return said.pop() if len(said) == 1 else ""


def _scalars(parameters: Mapping[str, Mapping[str, Any]]) -> Iterable[tuple[str, Mapping[str, Any]]]:
    """A vector parameter as one row per element."""
    for name, body in parameters.items():
        value, interval = body.get("value"), body.get("ci95")
        if not isinstance(value, (list, tuple)):
            yield name, body
            continue
        for i, element in enumerate(value):
            pair = interval[i] if isinstance(interval, (list, tuple)) and i < len(interval) else None
            yield f"{name}[{i}]", {**body, "value": element, "ci95": pair if isinstance(pair, (list, tuple)) else None}
