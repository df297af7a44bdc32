"""Tables of Task 3 from estimate.json."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..protocols.sessions import interval_note, short_note
from ..protocols.task3 import DERIVED
from ..sources.labels import OTHER_FAMILIES
from ..tables.quantities import shown
from ..tables.result_table import Cell, Column, Score, Table
from .row_cells import (
    AS_RECORDED,
    CLOCK,
    DATA,
    PUBLISHED,
    RATIO_NOTE,
    RATIOS,
    SESSIONS,
    SPEEDS,
    WHY,
    clock_in_place,
    clock_of,
    count_of,
    data_label,
    metrics_of,
    noted,
    of_one_clock,
    rank_of,
    score_column,
    scores_of,
    session_cells,
    text_of,
)

CORRECTED = "as-published-corrected"
PUBLISHED_METRICS = ("ate_rmse_m", "ate_mean_m", "rte_1m_m", "velocity_rmse_m_s", "attitude_rmse_deg")
COVERED = "covered_percent"
ESTIMATE_METRICS = ("ate_rmse_m", "ate_unaligned_rmse_m", "rte_1m_m", "velocity_rmse_m_s", "attitude_geodesic_rmse_deg",
                    "attitude_frame_removed_rmse_deg", "delay_s", "across_track_delay_removed_rmse_m",
                    "end_error_1s_m", "end_error_5s_m", "end_error_10s_m", "end_error_20s_m", "drift_percent", "nees",
                    "nis", COVERED)
"""What the page shows of an estimate; everything else is in the CSV files."""
BLACKOUT = "blackout"
TITLES = {"clean": "Task 3: every distinct recording, clean and airborne",
          BLACKOUT: "Task 3: dead reckoning after the last pose"}
VOTES = Column("clock_evidence", "Clock set by")
CLOCK_METRICS = ("ate_rmse_m", "along_track_rmse_m", "along_track_delay_removed_rmse_m", "across_track_rmse_m",
                 "delay_s")
STEPS = (("clean", AS_RECORDED, "cleaned"), ("clean", "offset", "constant offset removed"),
         ("clean", "retimed", "re-timed"))
"""(protocol, clock, its name) after the published row."""
NO_SUCH = "the published protocol has no such metric"


def task3_ratios(rows: Sequence[Mapping[str, Any]], synthetic: bool) -> Table:
    """Methods over all flights against another one, and against themselves as recorded."""
    mine = [(row, key, to) for key, to in RATIOS for row in rows if row.get("group") == "all" and row.get(to)]
    names = metrics_of([{"metrics": row[key]} for row, key, _ in mine], ESTIMATE_METRICS)
    scores = tuple(Column(name, shown(name).title, "score", decimals=3, aside=name not in ESTIMATE_METRICS)
                   for name in names)
    columns = (Column("protocol", "Protocol"), Column("method", "Method"), CLOCK, Column("over", "Over"), *scores,
               Column("n", "n", "count"), SESSIONS, WHY, DATA)
    lines = tuple((*(text_of(row.get(name)) for name in ("protocol", "method", "clock", to)),
                   *scores_of(row[key], {"ci95": row[f"{key}_ci95"]}, scores), count_of(row.get("n")),
                   *session_cells(row), data_label(synthetic)) for row, key, to in mine)
    return Table("table_task3_ratios", "Task 3: errors against those of another row", columns, lines,
                 RATIO_NOTE).without_empty_columns()


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


SCREEN_METRICS = {"clean": ("ate_rmse_m", "rte_1m_m", "velocity_rmse_m_s", "attitude_rmse_deg"),
                  "aided": ("ate_rmse_m", "rte_1m_m", "velocity_rmse_m_s", "nees", "nis"),
                  BLACKOUT: ("end_error_1s_m", "end_error_5s_m", "end_error_10s_m", "end_error_20s_m"),
                  "whole-flight": ("drift_percent", "drift_horizontal_percent", "drift_vertical_percent")}
"""What one screen shows of a protocol; of the published ones what ``clean`` has."""


def task3_screen(estimate: Mapping[str, Any], synthetic: bool) -> list[Table]:
    """One table a protocol for a terminal: all flights, or the published groups, as many metrics as say most. What
    differs between rows has a column: protocol, group, clock, what methods were given. Published protocols are last."""
    protocols = dict.fromkeys(str(row["protocol"]) for row in estimate["rows"])
    sets = dict.fromkeys(tuple(p for p in protocols if p.startswith(PUBLISHED)) if name.startswith(PUBLISHED) else
                         (name,) for name in protocols)
    return [_screen_of([row for row in estimate["rows"] if row["protocol"] in names], names, synthetic)
            for names in sorted(sets, key=lambda names: names[0].startswith(PUBLISHED))]


def _screen_of(rows: list[Mapping[str, Any]], names: Sequence[str], synthetic: bool) -> Table:
    published = names[0].startswith(PUBLISHED)
    rows = [row for row in rows if published or row["group"] == "all"] or rows
    metrics = SCREEN_METRICS.get(names[0], SCREEN_METRICS["clean"])
    if any(COVERED in row["metrics"] and row["causal"] is None for row in rows):  # a trajectory file
        metrics = (metrics[0], COVERED, "ate_unaligned_rmse_m", *metrics[1:])
    elif any((row["metrics"].get(COVERED) or {}).get("mean") not in (None, 100.0) for row in rows):
        metrics = (metrics[0], COVERED, *metrics[1:])
    scores = tuple(replace(score_column(m), title=shown(m).title.replace(" RMSE", "")) for m in metrics
                   if any(m in row["metrics"] for row in rows))
    heads = {"protocol": "Protocol", "group": "Group", "clock": "Clock", "method": "Method", "inputs": "Given"}
    heads = {key: title for key, title in heads.items()
             if key == "method" or len({str(row.get(key)) for row in rows}) > 1}
    columns = (*(Column(key, title) for key, title in heads.items()), Column("n", "n", "count"), *scores)
    lines: list[tuple[Cell, ...]] = []
    for row in sorted(rows, key=lambda row: _group_rank(_group(row))):
        lines.append((*(text_of(row.get(key)) for key in heads), count_of(row["n"]),
                      *scores_of(row["metrics"], row, scores)))
        if theirs := row.get("published"):
            lines.append((*("published" if key == "protocol" else text_of(row.get(key)) for key in heads),
                          count_of(row.get("published_n")), *scores_of(theirs, {}, scores, exact=True)))
    word = "the published protocol" if published else names[0]
    derived = "Velocity of the truth is derived from its positions." * any(DERIVED in row["given"] for row in rows)
    return Table(f"screen_{names[0]}", f"Task 3, {word}, {data_label(synthetic)} data: mean ± SD over flights [95 %]",
                 columns, tuple(lines), " ".join(filter(None, (short_note(rows), derived)))).without_empty_columns()


IN_BAND, INSIDE = "nees_in_band_{:.0f}s", "inside_3_sigma_{:.0f}s_percent"


def _mean_of(row: Mapping[str, Any], metric: str) -> float | None:
    found = (row["metrics"].get(metric) or {}).get("mean")
    return None if found is None else float(found)


def task3_windows(estimate: Mapping[str, Any]) -> Table:
    """Blackouts over the windows of all flights: median and p90, in space, horizontal and vertical."""
    from ..protocols.blackout import HORIZONS_S, KINDS

    rows = [row for row in estimate["rows"] if row.get("over_windows") and row["group"] in ("all", OTHER_FAMILIES)]
    lines: list[tuple[Cell, ...]] = []
    for row in sorted(rows, key=lambda row: str(row["group"])):
        for kind in KINDS:
            found = [row["over_windows"].get(f"end_error_{kind}{h:.0f}s_m") for h in HORIZONS_S]
            lines.append((row["group"], row["method"], clock_of(row), kind.strip("_") or "3-D", *(
                f"{f['median']:.3f} / {f['p90']:.3f} ({f['n']})" if f else "-" for f in found)))
    return Table.plain("Blackout, end error over windows, m: median / p90 (windows)",
                       ("group", "method", "clock", "error", *(f"{h:.0f} s" for h in HORIZONS_S)), lines,
                       "Windows of one flight, and flights of one session, are alike. Their number therefore does not "
                       "show how sure a median is.")


def task3_consistency(estimate: Mapping[str, Any]) -> Table:
    """Blackouts: whether stated covariances are as large as the errors, by time since the last pose."""
    from ..protocols.blackout import CONSISTENT_S

    lines: list[tuple[Cell, ...]] = []
    for row in estimate["rows"]:
        if row["group"] != "all" or _mean_of(row, "nees_1s") is None:
            continue
        for name, key, factor, digits in (("NEES (3)", "nees_{:.0f}s", 1.0, 1),
                                          ("flights in band %", IN_BAND, 100.0, 0),
                                          ("inside 3 SD %", INSIDE, 1.0, 0)):
            means = [_mean_of(row, key.format(h)) for h in CONSISTENT_S]
            lines.append((row["method"], clock_of(row), name, *(
                "-" if mean is None else f"{factor * mean:.{digits}f}" for mean in means)))
    return Table.plain("Blackout, stated covariance against the error, by time since the last pose",
                       ("method", "clock", "", *(f"{h:.0f} s" for h in CONSISTENT_S)), lines,
                       "Errors of one flight have a common cause, such as the bias of its accelerometer. A consistent "
                       "estimator is therefore in the band on fewer than 95 % of flights.")


def task3_attribution(attribution: Mapping[str, Any]) -> list[Table]:
    """Where the error of the onboard filter comes from: by clock, and run again with one thing changed."""
    parts = (("logged", f"Logged estimate of the onboard filter by clock, n = {attribution['n']}",
              {"ate_m": "ATE", "along_m": "along", "across_m": "across"}),
             ("replayed", f"The filter run again, a pose every 10 ms, n = {attribution['n_replayed']}",
              {"ate_m": "ATE", "change_m": "change of ATE", "moves_m": "moves by"}))
    found = []
    for key, title, heads in parts:
        columns = (Column("what", ""), *(Column(name, head, "score", "mm", 1e3, 2) for name, head in heads.items()))
        lines = tuple((row["what"], *(Score.of(row["metrics"].get(name)) for name in heads))
                      for row in attribution[key])
        found.append(Table(f"attribution_{key}", title, columns, lines, interval_note(attribution[key], list(heads))))
    return found


def onboard_parameters(tuning: Mapping[str, Any]) -> Table:
    """Parameters of the onboard filter to set."""
    ends = zip("xy", tuning["drag"]["ci95"] or (), strict=False)
    within = {f"kalman.dragB_{axis}": f"{low:.3f} .. {high:.3f}" for axis, (low, high) in ends}
    rows = [(name, f"{value:g}", within.get(name, "")) for name, value in tuning["parameters"].items()
            if not name.startswith("kalman.cop") or value]
    flown = tuning["flown"]
    how = (f"In flight, poses were {1e3 * flown['delay_s']:.0f} ms late, with SDs of "
           f"{1e3 * flown['position_sd_m']:.0f} mm and {flown['attitude_sd_rad']:g} rad. With these, the replay is "
           f"{1e3 * flown['apart_m']:.0f} mm from the logged estimate (median of {flown['n']} flights)."
           if flown["n"] else "No estimate is logged: delay and settings in flight are assumed.")
    return Table.plain("Onboard filter, parameters to set", ("parameter", "value", "95 % interval"), rows, how)


def onboard_tuning(tuning: Mapping[str, Any]) -> list[Table]:
    """Errors of the onboard filter before and after, on held-out flights, a table per clock."""
    heads = {"ate_m": ("ATE", "mm", 1e3, 1), "velocity_m_s": ("velocity", "mm/s", 1e3, 0),
             "attitude_deg": ("attitude", "deg", 1.0, 2), "end_1s_m": ("1 s", "mm", 1e3, 0),
             "end_5s_m": ("5 s", "mm", 1e3, 0)}
    columns = (Column("what", ""), *(Column(key, name, "score", unit, factor, digits)
                                     for key, (name, unit, factor, digits) in heads.items()))
    found = []
    for clock in dict.fromkeys(row["clock"] for row in tuning["rows"]):
        mine = [row for row in tuning["rows"] if row["clock"] == clock]
        lines = tuple((row["what"], *(Score.of(row["metrics"].get(key)) for key in heads)) for row in mine)
        title = (f"Onboard filter on held-out flights, clock {clock}, n = {max(row['n'] for row in mine)}; "
                 "1 s, 5 s: without poses")
        found.append(Table(f"onboard_{clock}", title, columns, lines, interval_note(mine, list(heads))))
    return found


def logged_method(rows: Sequence[Mapping[str, Any]]) -> str | None:
    """The method the published table is about, else the first that was scored on a moved clock."""
    found = [row for row in rows if row.get("protocol") == PUBLISHED]
    found += [row for row in rows if clock_of(row) != AS_RECORDED]
    return str(found[0].get("method")) if found else None


def task3_clocks(rows: Sequence[Mapping[str, Any]], synthetic: bool) -> Table:
    """The effect of the clock and of the estimator: one method as published, cleaned, with the constant offset
    removed, and re-timed. Empty unless there are rows of more than one clock."""
    method = logged_method(rows)
    mine = [row for row in rows if str(row.get("method")) == method]
    found = {(row.get("protocol"), clock_of(row), _place(row)): row for row in mine}
    scores = tuple(score_column(metric) for metric in CLOCK_METRICS)
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
            moving = count_of(row.get("n_moving")) if clock == "retimed" else None
            lines.append((name, step, count_of(row.get("n")), *session_cells(row),
                          *scores_of(row.get("metrics"), why, scores),
                          moving, clock, ", ".join(row.get("clock_evidence") or []), data_label(synthetic)))
    who = "the onboard EKF" if method == "onboard_ekf" else method
    first = "by the published protocol" if synthetic else "as published"
    note = ("Mean ± SD over flights and 95 % interval of the mean. Moving error: flights in which one was shown; "
            "of the others the constant was removed, or nothing where not even that shows. Delay: the one that fits "
            "the estimated positions best; with it removed, along track holds what moves. Offset and re-timed use the "
            "motion capture of the whole flight.")
    note = noted(note, mine)
    return Table("table_task3_clocks", f"Task 3, {who}: {first}, cleaned, constant offset removed, re-timed", columns,
                 tuple(lines), note).without_empty_columns()


def _place(row: Mapping[str, Any]) -> str:
    """The group of a row in the names of the clean protocol: the published one has speeds of the trefoil alone."""
    group = _group(row)
    return f"{group}/trefoil" if row.get("protocol") == PUBLISHED and group in SPEEDS else group


def _task3_table(name: str, title: str, rows: list[Mapping[str, Any]], known: Sequence[str], synthetic: bool) -> Table:
    """Rows sorted by group; metrics that are not ``known`` are in the CSV file only."""
    scores = tuple(replace(score_column(metric), aside=metric not in known) for metric in metrics_of(rows, known))
    one = len({row.get("protocol") for row in rows}) == 1
    columns = (Column("group", "Group"), Column("protocol", "Protocol", aside=one), CLOCK, Column("method", "Method"),
               Column("n", "n", "count"), SESSIONS, WHY, *scores, Column("causal", "Causal"),
               Column("given", "Given", noted=True),
               DATA)
    order = {_group(row): _group_rank(_group(row)) for row in rows}
    lines: list[tuple[Cell, ...]] = []
    main = 0
    first, named = clock_of(of_one_clock(rows)[0]), any(row.get("clock") for row in rows)
    # the table shows the effect of the clock on dead reckoning, so the page has both clocks, group by group
    together = any(row.get("protocol") == BLACKOUT for row in rows)

    def place(row: Mapping[str, Any]) -> tuple[Any, ...]:
        other = clock_of(row) != first
        return (order[_group(row)], text_of(row.get("method")), other) if together else (other, order[_group(row)])

    for row in sorted(rows, key=place):
        causal, method = row.get("causal"), text_of(row.get("method"))
        if published := row.get("published"):
            lines.append((_group(row), "published table", "", method, count_of(row.get("published_n")), None, "",
                          *scores_of(published, {}, scores, exact=True), "", "", "published"))
        lines.append((_group(row), text_of(row.get("protocol")), clock_of(row) if named else "", method,
                      count_of(row.get("n")), *session_cells(row), *scores_of(row.get("metrics"), row, scores),
                      "" if causal is None else "yes" if causal else "no",
                      text_of(row.get("given")), data_label(synthetic)))
        main = len(lines) if "/" not in _group(row) and (together or clock_of(row) == first) else main
    note = noted("Mean ± SD over flights and 95 % interval of the mean.", rows, known)
    if any(c.aside for c in scores) or main < len(lines):
        further = "metrics, groups and clocks" if len({clock_of(r) for r in rows}) > 1 else "metrics and groups"
        note += f" Further {further} are in the CSV file."
    return clock_in_place(Table(name, title, columns, tuple(lines), note, main).without_empty_columns())


def _group(row: Mapping[str, Any]) -> str:
    """The group as shown: the published protocol writes speeds with a capital, the others do not."""
    group = text_of(row.get("group"))
    return group.lower() if group.lower() in SPEEDS else group


def _group_rank(group: str) -> tuple[int, str]:
    """``all``, the speeds, the families, then speed and family together."""
    first = ("all", OTHER_FAMILIES, *SPEEDS)
    return (rank_of(group, first), "") if group in first else (len(first) + group.count("/"), group)
