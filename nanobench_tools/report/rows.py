"""Result files (shape of the JSON contract) into tables: one builder per table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..labels import OTHER_FAMILIES
from ..protocols.sessions import interval_note
from .audit_entry import CLOCK_STREAMS, fault_counts, share_clean, total
from .quantities import shown
from .tables import Cell, Column, Score, Table

PUBLISHED = "as-published"
SPEEDS = ("slow", "medium", "fast")
TASK1_GROUPS = ("all", "seen", "unseen")
CORRECTED = "as-published-corrected"
PUBLISHED_METRICS = ("ate_rmse_m", "ate_mean_m", "rte_1m_m", "velocity_rmse_m_s", "attitude_rmse_deg")
ESTIMATE_METRICS = ("ate_rmse_m", "ate_unaligned_rmse_m", "rte_1m_m", "velocity_rmse_m_s", "attitude_geodesic_rmse_deg",
                    "attitude_frame_removed_rmse_deg", "delay_s", "across_track_delay_removed_rmse_m",
                    "end_error_1s_m", "end_error_5s_m", "end_error_10s_m", "end_error_20s_m", "drift_percent", "nees",
                    "nis")
"""What the page shows of an estimate; everything else is in the CSV files."""

BLACKOUT = "blackout"
TITLES = {"clean": "Task 3: every distinct recording, clean and airborne",
          BLACKOUT: "Task 3: dead reckoning after the last pose"}
CONTROL_METRICS = ("rmse_m", "ade_m", "velocity_rmse_m_s", "heading_deg", "divergence_percent", "lag_s",
                   "rmse_lag_removed_m", "contour_rmse_m", "z_bias_m", "worst_decile_m", "saturated_percent",
                   "solve_p99_ms")
SYSID_METRICS = ("position_mae_m", "velocity_mae_m_s", "attitude_mae_rad", "rate_mae_rad_s")
DATA = Column("data", "Data")
AS_RECORDED = "as-recorded"
CLOCK = Column("clock", "Clock")
VOTES = Column("clock_evidence", "Clock set by")
SESSIONS = Column("sessions", "Sessions", "count")
WHY = Column("ci_why", "Interval missing or not to be trusted", aside=True)
CLOCK_METRICS = ("ate_rmse_m", "along_track_rmse_m", "along_track_delay_removed_rmse_m", "across_track_rmse_m",
                 "delay_s")
STEPS = (("clean", AS_RECORDED, "cleaned"), ("clean", "offset", "constant offset removed"),
         ("clean", "retimed", "re-timed"))
"""(protocol, clock, its name) after the published row."""
NO_SUCH = "the published protocol has no such metric"


def clock_of(row: Mapping[str, Any]) -> str:
    """The clock of a row; results from before there were several are as recorded."""
    return str(row.get("clock") or AS_RECORDED)


def of_one_clock(rows: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The rows as recorded, if there are any, else those of the first other clock: never two clocks side by side."""
    rows = list(rows)
    clocks = {clock_of(row) for row in rows}
    chosen = AS_RECORDED if AS_RECORDED in clocks or not rows else clock_of(rows[0])
    return [row for row in rows if clock_of(row) == chosen]


def data_label(synthetic: bool) -> str:
    """The word in every row that says what the numbers were made from."""
    return "SYNTHETIC" if synthetic else "real"


def tables_of(results: Mapping[str, Mapping[str, Any]], synthetic: bool) -> list[Table]:
    """Every table the results allow, in the order of the page; a result that is absent makes none."""
    tables: list[Table] = []
    if sysid := results.get("sysid"):
        tables += [task1(sysid, synthetic), task1_commands(sysid, synthetic), task1_clocks(sysid, synthetic),
                   task1_ratios(sysid, synthetic), *task1_parameters(sysid, synthetic)]
    if thrust := results.get("thrust"):
        tables.append(thrust_maps(thrust, synthetic))
    if control := results.get("control"):
        tables += [*task2(control, synthetic), *task2_gate(control, synthetic)]
    if estimate := results.get("estimate"):
        tables += task3(estimate, synthetic)
    if audit := results.get("audit"):
        tables.append(audit_flights(audit, synthetic))
    return [table for table in tables if table.rows]


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
    groups = [_text(row.get("group")) for row in rows]
    rank = {group: (_rank(group, TASK1_GROUPS), groups.index(group)) for group in groups}
    first = clock_of(of_one_clock(rows)[0]) if rows else AS_RECORDED
    rows = sorted(rows, key=lambda row: (clock_of(row) != first, rank[_text(row.get("group"))],
                                         _text(row.get("truth")) != "onboard", row.get("start") == "past"))
    lines: list[tuple[Cell, ...]] = []
    main = 0
    for row in rows:
        model, group, truth = (_text(row.get(key)) for key in ("model", "group", "truth"))
        information = _text(row.get("information"))
        if (published := row.get("published")) and clock_of(row) == first:
            lines.append((f"{model} (published)", "published table", truth, "", "",
                          *_horizon_scores(published, {}, horizons, exact=True), None, None, None, "", information,
                          "published"))
        lines.append((model, group, truth, _text(row.get("start")), _text(row.get("clock")),
                      *_horizon_scores(row.get("metrics"), row, horizons),
                      _count(row.get("n_windows")), _count(row.get("n_flights")), *_sessions(row), information,
                      data_label(synthetic)))
        main = len(lines) if group in ("", *TASK1_GROUPS) and clock_of(row) == first else main
    note = _noted("Mean over windows with its 95 % interval; Σ is the sum over all steps.", rows)
    if main < len(lines):
        further = "groups and clocks" if any(clock_of(row) != first for row in rows) else "groups"
        note += f" Further {further} are in the CSV file."
    table = Table("table_task1", "Task 1: error of the predicted state after h steps of 10 ms", columns, tuple(lines),
                  note, main).without_empty_columns()
    return _clock_in_place(_drop_blank(table, "start"))


def task1_commands(sysid: Mapping[str, Any], synthetic: bool) -> Table:
    """What every model answers to a command put into its inputs, and whether that is a vehicle."""
    rows = [row for row in one_truth(sysid.get("rows", [])) if row.get("command_response")]
    names = ("roll", "pitch", "yaw", "thrust")
    columns = (Column("model", "Model"), CLOCK, *(Column(name, f"{name} / physics", "score", decimals=3)
                                                  for name in names),
               Column("vehicle", "Is it a vehicle?"), Column("windows", "Windows", "count"), DATA)
    lines = tuple((_text(row.get("model")), clock_of(row),
                   *(Score.of(row["command_response"][name]["ratio"]) for name in names),
                   row["command_response"]["vehicle"] or "signs are right", _count(row["command_response"]["windows"]),
                   data_label(synthetic)) for row in rows)
    return _clock_in_place(Table(
        "table_task1_commands", "Task 1: answer to a roll, pitch, yaw and thrust command put into the inputs", columns,
        lines, "Change of the rate (thrust: velocity) 0.2 s after a step of PWM, as a share of rigid-body physics of "
               "numbers from firmware, scale and ruler; 1 is the physics', below 0 turns the other way."))


def task1_clocks(sysid: Mapping[str, Any], synthetic: bool) -> Table:
    """Every model on each clock, error at the last horizon over all test windows; empty unless there are several."""
    rows = [r for r in one_truth(sysid.get("rows", [])) if r.get("group", "all") == "all"]
    last = [h for h in _horizons(rows) if h.isdigit()][-1:]
    columns = (Column("model", "Model"), CLOCK, *(_score_column(metric) for metric in SYSID_METRICS),
               Column("n_windows", "Windows", "count"), Column("information", "Given"), DATA)
    order = list(dict.fromkeys(_text(row.get("model")) for row in rows))
    several = len({clock_of(row) for row in rows}) > 1 and last
    lines: tuple[tuple[Cell, ...], ...] = tuple(
        (_text(row.get("model")), clock_of(row), *_horizon_scores(row.get("metrics"), row, last),
         _count(row.get("n_windows")), _text(row.get("information")), data_label(synthetic))
        for row in sorted(rows, key=lambda row: order.index(_text(row.get("model")))) if several)
    return Table("table_task1_clocks", f"Task 1, before and after re-timing: error after {''.join(last)} steps",
                 columns, lines,
                 "Mean over windows with its 95 % interval. Fitted models were fitted to the training flights on the "
                 "same clock. Re-timed: the moving error of the clock is taken out of the vehicle's streams, off-line, "
                 "from the motion capture of the whole flight.").without_empty_columns()


RATIO_NOTE = ("Error over that of the row named, the same flights and windows drawn for both, and its 95 % interval. "
              "An interval that holds 1 shows no difference.")
RATIOS = (("ratio", "ratio_to"), ("clock_ratio", "clock_ratio_to"))
"""Keys of a row that is compared: with another method on its clock, with itself as recorded."""


def task1_ratios(sysid: Mapping[str, Any], synthetic: bool) -> Table:
    """Models over all test windows against the chosen one, and against themselves as recorded."""
    rows = [row for row in sysid.get("rows", []) if row.get("group", "all") == "all"]
    horizons = _horizons(rows)
    scores = tuple(Column(f"{metric} h={h}", f"{shown(metric).title} {'Σ' if h == 'sum' else f'h={h}'}", "score",
                          decimals=3, aside=h not in horizons[-2:]) for metric in SYSID_METRICS for h in horizons)
    columns = (Column("model", "Model"), Column("truth", "Truth"), CLOCK, Column("over", "Over"), *scores,
               Column("n_flights", "Flights", "count"), SESSIONS, WHY, DATA)
    lines = tuple((_text(row.get("model")), _text(row.get("truth")), _text(row.get("clock")), _text(row[to]),
                   *_horizon_scores(row[key], {"ci95": row[f"{key}_ci95"]}, horizons), _count(row.get("n_flights")),
                   *_sessions(row), data_label(synthetic)) for key, to in RATIOS for row in rows if row.get(to))
    return Table("table_task1_ratios", "Task 1: errors against those of another row", columns, lines,
                 RATIO_NOTE).without_empty_columns()


def task3_ratios(rows: Sequence[Mapping[str, Any]], synthetic: bool) -> Table:
    """Methods over all flights against another one, and against themselves as recorded."""
    mine = [(row, key, to) for key, to in RATIOS for row in rows if row.get("group") == "all" and row.get(to)]
    names = _metrics([{"metrics": row[key]} for row, key, _ in mine], ESTIMATE_METRICS)
    scores = tuple(Column(name, shown(name).title, "score", decimals=3, aside=name not in ESTIMATE_METRICS)
                   for name in names)
    columns = (Column("protocol", "Protocol"), Column("method", "Method"), CLOCK, Column("over", "Over"), *scores,
               Column("n", "n", "count"), SESSIONS, WHY, DATA)
    lines = tuple((_text(row.get("protocol")), _text(row.get("method")), _text(row.get("clock")), _text(row[to]),
                   *_scores(row[key], {"ci95": row[f"{key}_ci95"]}, scores), _count(row.get("n")), *_sessions(row),
                   data_label(synthetic)) for row, key, to in mine)
    return Table("table_task3_ratios", "Task 3: errors against those of another row", columns, lines,
                 RATIO_NOTE).without_empty_columns()


def one_truth(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Rows of Task 1 judged by the truth the published table used, or by the only one there is, from its start."""
    rows = [r for r in rows if r.get("start", "centred") == "centred"]
    truths = list(dict.fromkeys(r.get("truth") for r in rows))
    chosen = "onboard" if "onboard" in truths else (truths or [None])[0]
    return [r for r in rows if r.get("truth") == chosen]


def _horizons(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    found = {str(h) for row in rows for metric in SYSID_METRICS for h in ((row.get("metrics") or {}).get(metric) or {})}
    return sorted(found, key=lambda h: (not h.isdigit(), int(h) if h.isdigit() else 0))


def _horizon_scores(metrics: Any, row: Mapping[str, Any], horizons: Sequence[str], exact: bool = False) -> list[Score]:
    metrics, intervals = metrics or {}, row.get("ci95") or {}
    return [Score.of((metrics.get(m) or {}).get(h), (intervals.get(m) or {}).get(h), _reason(row, m), exact)
            for m in SYSID_METRICS for h in horizons]


def task1_parameters(sysid: Mapping[str, Any], synthetic: bool) -> list[Table]:
    """Fitted or stated parameters with their intervals, if there are any."""
    columns = (Column("model", "Model"), Column("parameter", "Parameter"), Column("unit", "Unit"), CLOCK, DATA,
               Column("value", "Value", "score", decimals=4))

    def rows(clock: str, models: Mapping[str, Any]) -> list[tuple[Cell, ...]]:
        return [(model, name, _text(body.get("unit")), clock, data_label(synthetic), Score.of(body))
                for model, parameters in models.items() for name, body in _scalars(parameters)]

    lines = rows(_text(sysid.get("clock")), sysid.get("parameters") or {})
    others = [line for clock, found in (sysid.get("by_clock") or {}).items()
              for line in rows(clock, found.get("parameters") or {})]
    if not lines:
        return []
    note = _text(sysid.get("parameters_note"))
    note += " Those fitted on another clock are in the CSV file." if others else ""
    table = Table("table_task1_parameters", "Task 1: parameters of the models", columns, (*lines, *others),
                  note.strip(), len(lines))
    return [_clock_in_place(table)]


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


def thrust_maps(thrust: Mapping[str, Any], synthetic: bool) -> Table:
    """Rows of ``thrust``."""
    scores = tuple(_score_column(name) for name in ("rms_N", "rms_m_s2"))
    lines = tuple((_text(r.get("model")), _text(r.get("split")), _count(r.get("n")), data_label(synthetic),
                   *(Score.of(r.get(c.key), reason=_reason(r, c.key)) for c in scores)) for r in thrust.get("rows", []))
    return Table("table_thrust", "Thrust maps: error of the predicted thrust",
                 (Column("model", "Model"), Column("split", "Split"), Column("n", "n", "count"), DATA, *scores),
                 lines).without_empty_columns()


def task2(control: Mapping[str, Any], synthetic: bool) -> list[Table]:
    """Rows of ``control``: real flights in one table, simulated ones (if any) in another."""
    rows = [row if row.get("plant") == "simulated" else {**row, "metrics": row.get("statistics") or row.get("metrics")}
            for row in control.get("rows", [])]
    scores = tuple(_score_column(name) for name in _metrics(rows, CONTROL_METRICS))
    columns = (Column("protocol", "Protocol"), CLOCK, Column("controller", "Controller"),
               Column("reference", "Reference"), Column("speed", "Speed"),
               Column("speed_m_s", "Speed", "score", "m/s", 1.0, 2), Column("n", "n", "count"), SESSIONS, WHY,
               *scores, Column("information", "Given"), DATA)
    titles = {"real": ("table_task2", "Task 2: tracking on logged flights"),
              "simulated": ("table_task2_simulated", "Task 2: tracking on the simulated plants")}
    tables = []
    for plant, (name, title) in titles.items():
        lines: list[tuple[Cell, ...]] = []
        mine = [row for row in rows if (row.get("plant") or "real") == plant]
        for row in mine:
            head = (_text(row.get("controller")), _text(row.get("reference")), _text(row.get("speed")),
                    Score.of(row.get("speed_m_s"), reason="no single reference speed"))
            information = _text(row.get("information"))
            if published := row.get("published"):
                lines.append(("published table", "", *head, _count(row.get("published_n")), None, "",
                              *_scores(published, {}, scores, exact=True), information, "published"))
            lines.append((_text(row.get("protocol")), _text(row.get("clock")), *head, _count(row.get("n")),
                          *_sessions(row),
                          *_scores(row.get("metrics"), row, scores), information, data_label(synthetic)))
        dropped = dict.fromkeys(name for row in mine for name in row.get("dropped") or [])
        note = _noted("Mean ± SD over flights and 95 % interval of the mean.", mine)
        if plant == "simulated":
            note = _simulated_note(mine)
        if dropped:
            note += f" Left out of the published rows, as was published: {', '.join(map(str, dropped))}."
        tables.append(Table(name, title, columns, tuple(lines), note).without_empty_columns())
    return [_clock_in_place(_drop_blank(_drop_blank(table, "protocol"), "speed")) for table in tables if table.rows]


def _simulated_note(rows: Sequence[Mapping[str, Any]]) -> str:
    bar = next((row["error_bar"] for row in rows if row.get("error_bar")), None)
    note = "Medians over an ensemble of plants; the worst decile is the RMSE that one plant in ten exceeds."
    if bar is None:
        return f"{note} No flight has judged this plant: these numbers have no error bar."
    return (f"{note} Error bar of every RMSE by the gate ({bar['n']} flights): {100.0 * bar['rmse_share']:.0f} % "
            f"(median), {100.0 * bar['rmse_share_p90']:.0f} % (one flight in ten is further off).")


def task2_gate(control: Mapping[str, Any], synthetic: bool) -> list[Table]:
    """How close the simulated plant comes to each logged flight."""
    gate = control.get("gate") or []
    scores = tuple(_score_column(name) for name in ("rmse_real_m", "rmse_sim_m", "ratio", "lag_diff_s", "path_gap_m"))
    lines = tuple((_text(g.get("flight")), _text(g.get("controller")), data_label(g.get("synthetic", synthetic)),
                   "yes" if g.get("pass") else "no", _text(g.get("reason")), *_scores(g, g, scores))
                  for g in gate)
    columns = (Column("flight", "Flight"), Column("controller", "Controller"), DATA, Column("pass", "Passes"),
               Column("reason", "Reason"), *scores)
    title = "Task 2: the plant against the logged flights (its error bar)"
    return [Table("table_task2_gate", title, columns, lines).without_empty_columns()] if lines else []


def task3(estimate: Mapping[str, Any], synthetic: bool) -> list[Table]:
    """Rows of ``estimate``: the published recordings, as published and corrected, in one table, every other protocol
    in its own."""
    rows = estimate.get("rows", [])
    protocols = list(dict.fromkeys(str(row.get("protocol")) for row in rows))
    sets = [(name, title, chosen, known) for name, title, chosen, known in (
        ("table_task3", "Task 3: the published protocol, and the same recordings corrected",
         [p for p in (PUBLISHED, CORRECTED) if p in protocols], PUBLISHED_METRICS),
        *((f"table_task3_{p.replace('-', '_')}", TITLES.get(p, f"Task 3: {p}"), [p], ESTIMATE_METRICS)
          for p in protocols if p not in (PUBLISHED, CORRECTED))) if chosen]
    tables = [_task3_table(name, title, [r for r in rows if r.get("protocol") in chosen], known, synthetic)
              for name, title, chosen, known in sets]
    return [task3_clocks(rows, synthetic), *tables, task3_ratios(rows, synthetic)]


def logged_method(rows: Sequence[Mapping[str, Any]]) -> str | None:
    """The method the published table is about, else the first that was scored on a moved clock."""
    found = [row for row in rows if row.get("protocol") == PUBLISHED]
    found += [row for row in rows if clock_of(row) != AS_RECORDED]
    return str(found[0].get("method")) if found else None


def task3_clocks(rows: Sequence[Mapping[str, Any]], synthetic: bool) -> Table:
    """What is a clock and what is the estimator: one method as published, cleaned, with the constant offset removed,
    and re-timed; empty unless rows of more than one clock are there."""
    method = logged_method(rows)
    mine = [row for row in rows if str(row.get("method")) == method]
    found = {(row.get("protocol"), clock_of(row), _place(row)): row for row in mine}
    scores = tuple(_score_column(metric) for metric in CLOCK_METRICS)
    columns = (Column("group", "Flights"), Column("step", "Position estimate"), Column("n", "n", "count"), SESSIONS,
               WHY, *scores,
               Column("n_moving", "Moving error", "count"), CLOCK, VOTES, DATA)
    steps = ((PUBLISHED, AS_RECORDED, "by the published protocol" if synthetic else "as published"), *STEPS)
    lines: list[tuple[Cell, ...]] = []
    for group in ("all", *(f"{speed}/trefoil" for speed in SPEEDS)):
        here = [(step, clock, row) for protocol, clock, step in steps if (row := found.get((protocol, clock, group)))]
        if len({clock for _, clock, _ in here}) < 2:
            continue
        name = "all" if group == "all" else f"trefoil, {group.partition('/')[0]}"
        for step, clock, row in here:
            why = {**row, "reason": NO_SUCH} if row.get("protocol") == PUBLISHED else row
            moving = _count(row.get("n_moving")) if clock == "retimed" else None
            lines.append((name, step, _count(row.get("n")), *_sessions(row), *_scores(row.get("metrics"), why, scores),
                          moving, clock, ", ".join(row.get("clock_evidence") or []), data_label(synthetic)))
    who = "the onboard EKF" if method == "onboard_ekf" else method
    first = "by the published protocol" if synthetic else "as published"
    note = ("Mean ± SD over flights and 95 % interval of the mean. Moving error: flights in which one was shown; "
            "of the others the constant was removed, or nothing where not even that shows. Delay: the one that fits "
            "the estimated positions best; with it removed, along track holds what moves. Offset and re-timed use the "
            "motion capture of the whole flight.")
    note = _noted(note, mine)
    return Table("table_task3_clocks", f"Task 3, {who}: {first}, cleaned, constant offset removed, re-timed", columns,
                 tuple(lines), note).without_empty_columns()


def _place(row: Mapping[str, Any]) -> str:
    """The group of a row in the names of the clean protocol: the published one has speeds of the trefoil alone."""
    group = _group(row)
    return f"{group}/trefoil" if row.get("protocol") == PUBLISHED and group in SPEEDS else group


def _task3_table(name: str, title: str, rows: list[Mapping[str, Any]], known: Sequence[str], synthetic: bool) -> Table:
    """Rows sorted by group; metrics that are not ``known`` stand aside, in the CSV file only."""
    scores = tuple(replace(_score_column(metric), aside=metric not in known) for metric in _metrics(rows, known))
    one = len({row.get("protocol") for row in rows}) == 1
    columns = (Column("group", "Group"), Column("protocol", "Protocol", aside=one), CLOCK, Column("method", "Method"),
               Column("n", "n", "count"), SESSIONS, WHY, *scores, Column("causal", "Causal"),
               Column("given", "Given", noted=True),
               DATA)
    order = {_group(row): _group_rank(_group(row)) for row in rows}
    lines: list[tuple[Cell, ...]] = []
    main = 0
    first, named = clock_of(of_one_clock(rows)[0]), any(row.get("clock") for row in rows)
    # what the clock does to dead reckoning is the point of its table: both stand on the page, group by group
    together = any(row.get("protocol") == BLACKOUT for row in rows)

    def place(row: Mapping[str, Any]) -> tuple[Any, ...]:
        other = clock_of(row) != first
        return (order[_group(row)], _text(row.get("method")), other) if together else (other, order[_group(row)])

    for row in sorted(rows, key=place):
        causal, method = row.get("causal"), _text(row.get("method"))
        if published := row.get("published"):
            lines.append((_group(row), "published table", "", method, _count(row.get("published_n")), None, "",
                          *_scores(published, {}, scores, exact=True), "", "", "published"))
        lines.append((_group(row), _text(row.get("protocol")), clock_of(row) if named else "", method,
                      _count(row.get("n")), *_sessions(row), *_scores(row.get("metrics"), row, scores),
                      "" if causal is None else "yes" if causal else "no",
                      _text(row.get("given")), data_label(synthetic)))
        main = len(lines) if "/" not in _group(row) and (together or clock_of(row) == first) else main
    note = _noted("Mean ± SD over flights and 95 % interval of the mean.", rows, known)
    if any(c.aside for c in scores) or main < len(lines):
        further = "metrics, groups and clocks" if len({clock_of(r) for r in rows}) > 1 else "metrics and groups"
        note += f" Further {further} are in the CSV file."
    return _clock_in_place(Table(name, title, columns, tuple(lines), note, main).without_empty_columns())


def _group(row: Mapping[str, Any]) -> str:
    """The group as shown: the published protocol writes speeds with a capital, the others do not."""
    group = _text(row.get("group"))
    return group.lower() if group.lower() in SPEEDS else group


def _group_rank(group: str) -> tuple[int, str]:
    """``all``, the speeds, the families, then speed and family together."""
    first = ("all", OTHER_FAMILIES, *SPEEDS)
    return (_rank(group, first), "") if group in first else (len(first) + group.count("/"), group)


def _rank(name: str, order: Sequence[str]) -> int:
    return order.index(name) if name in order else len(order)


def audit_flights(audit: Mapping[str, Any], synthetic: bool) -> Table:
    """One row per recording: what flew, how much of it is usable, what is wrong, how late the clock is."""
    columns = (Column("flight", "Flight"), Column("controller", "Controller"), DATA,
               Column("length_s", "Length", "score", "s", 1.0, 1),
               Column("airborne_s", "Airborne", "score", "s", 1.0, 1),
               Column("clean_s", "Clean", "score", "s", 1.0, 1), Column("clean_percent", "Clean", "score", "%", 1.0, 1),
               Column("clock_offset_s", "Clock offset", "score", "ms", 1e3, 1),
               Column("clock_wander_s", "Clock wander SD", "score", "ms", 1e3, 1), Column("faults", "Faults"),
               Column("sha256", "SHA-256"))
    lines = []
    for flight in audit.get("flights", []):
        share = share_clean(flight)
        stream = next((s for s in CLOCK_STREAMS if s in (flight.get("clock") or {})), None)
        clock = (flight.get("clock") or {}).get(stream) or {}
        why = clock.get("reason") or "no clock was compared with the motion capture"
        lines.append((
            _text(flight.get("flight")), _text(flight.get("controller")), data_label(synthetic),
            Score.of(total([flight["span"]]) if flight.get("span") else None), Score.of(total(flight.get("airborne"))),
            Score.of(total(flight.get("clean"))), Score.of(None if share is None else 100 * share),
            Score.of(clock.get("offset_s") if clock.get("identifiable", True) else None, clock.get("ci95_s"), why),
            Score.of(clock.get("wander_sd_s"), reason="the wander of the clock is not known"),
            ", ".join(f"{kind} ×{n}" if n > 1 else kind for kind, n in fault_counts(flight).items()) or "none",
            _text(flight.get("sha256"))[:12]))
    return Table("audit_flights", "Data audit: every recording", columns, tuple(lines),
                 f"Clock offset of {' or '.join(CLOCK_STREAMS[:1])} against motion capture, positive when the stamps "
                 "are late.")


def _score_column(name: str) -> Column:
    how = shown(name)
    return Column(name, how.title, "score", how.unit, how.factor, how.decimals)


def _metrics(rows: Sequence[Mapping[str, Any]], order: Sequence[str]) -> list[str]:
    """The metrics in ``rows``: the known ones in their order, then the others as found."""
    found = dict.fromkeys(name for row in rows for name in (row.get("metrics") or {}))
    return [name for name in order if name in found] + [name for name in found if name not in order]


def _scores(metrics: Any, row: Mapping[str, Any], columns: Sequence[Column], exact: bool = False) -> list[Score]:
    metrics, intervals = metrics or {}, row.get("ci95") or {}
    return [Score.of(metrics.get(c.key), intervals.get(c.key), _reason(row, c.key), exact) for c in columns]


def _reason(row: Mapping[str, Any], metric: str) -> str:
    reasons = row.get("reasons") or {}
    return str(reasons.get(metric) or row.get("reason") or Score(None).reason)


def _drop_blank(table: Table, key: str) -> Table:
    """Less the column ``key`` when no row has anything in it."""
    i = next(k for k, c in enumerate(table.columns) if c.key == key)
    return table if any(row[i] for row in table.rows) else table.without_column(key)


def _clock_in_place(table: Table) -> Table:
    """Clocks stand among the names of the rows where readers see several, else at the end, and nowhere where no row
    says one."""
    i, end = ([c.key for c in table.columns].index(key) for key in ("clock", "data"))
    clocks = {str(row[i] or "") for row in table.rows[:table.main]} - {""}
    if len(clocks) > 1:
        return table
    if not any(row[i] for row in table.rows):
        return table.without_column("clock")
    order = [*range(i), *range(i + 1, end), i, *range(end, len(table.columns))]
    return replace(table, columns=tuple(table.columns[k] for k in order),
                   rows=tuple(tuple(row[k] for k in order) for row in table.rows))


def _sessions(row: Mapping[str, Any]) -> tuple[Cell, Cell]:
    """Number of sessions, and why the row's intervals are missing or not to be trusted."""
    return _count(row.get("sessions")), _text(row.get("ci_why"))


def _noted(note: str, rows: Sequence[Mapping[str, Any]], metrics: Sequence[str] = ()) -> str:
    """``note`` with what the intervals of the table are."""
    return f"{note} {interval_note(rows, metrics)}".strip()


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, (list, tuple)):
        return ", ".join(map(str, value))
    return str(value)


def _count(value: Any) -> int | None:
    return int(value) if isinstance(value, int) and not isinstance(value, bool) else None
