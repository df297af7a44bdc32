"""Introductions above each table. Every number is computed from the results that are there."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..metrics.statistics import excludes_one
from ..protocols.compare import verdict
from ..tables.method_names import person, quoted
from ..tables.quantities import format_duration, format_number, number, shown
from ..time_offsets.moving.votes import CLOCKS
from .audit_entry import fault_counts, lost_in_the_air, total
from .row_cells import AS_RECORDED, PUBLISHED, clock_of, of_one_clock, one_truth
from .task3_tables import BLACKOUT, CORRECTED, logged_method

Results = Mapping[str, Mapping[str, Any]]
Words = list[str | list[str]]
"""Paragraphs; a list among them is a list of points."""

MOSTLY = 0.8
"""An error of which re-timing leaves less than this share is largely a clock: a convention."""
ALIKE = 0.05
"""Two values within this share of each other are called unchanged."""


def overview(results: Results) -> Words:
    """A few sentences on the recordings and their state."""
    flights = (results.get("audit") or {}).get("flights") or []
    if not flights:
        return ["No audit of recordings is among the results."]
    flown = [f for f in flights if f.get("airborne")]
    lengths = [f["span"][1] - f["span"][0] for f in flights if f.get("span")]
    airborne = sum(total(f.get("airborne")) or 0.0 for f in flights)
    lines: Words = [f"{_count(len(flights), 'recording')}"
             + (f", {format_duration(sum(lengths))} in all" if lengths else "")
             + f"; {len(flown)} leave the ground and fly for {format_duration(airborne)}."]
    copies = _copies(results)
    slices = max((sum(str(entry.get("reason")).startswith("slice of") for entry in body.get("left_out") or [])
                  for body in results.values()), default=0)
    lost = [seconds for f in flights if (seconds := lost_in_the_air(f)) > 0]
    found: dict[str, int] = {}
    for flight in flights:
        for kind in fault_counts(flight):
            found[kind] = found.get(kind, 0) + 1
    if lost:
        lines.append(f"In {_count(len(lost), 'recording')} the log of a stream ends while the vehicle is in the air, "
                     f"in total {format_duration(sum(lost))} before it lands. The file goes on with rows that no "
                     "sensor sent, and these are cut.")
    repeats = " and ".join(text for n, text in ((copies, _count(copies, "copy", "copies")),
                                                (slices, _count(slices, "slice"))) if n)
    if repeats:
        lines.append(f"Among the recordings are {repeats} of others; repeated rows count once in the corrected tables.")
    if found:
        often = sorted(found.items(), key=lambda item: (-item[1], item[0]))
        kinds = ", ".join(f"{kind.replace('_', ' ')} in {n}" for kind, n in often)
        lines.append(f"Faults by number of recordings: {kinds}.")
    else:
        lines.append("No fault was found.")
    return lines


def task1(results: Results) -> Words:
    """Predictive models: which were scored, and how the published physics row does."""
    sysid = results.get("sysid")
    if not sysid or not sysid.get("rows"):
        return []
    rows = sysid["rows"]
    lines: Words = ["A model gets the state at one moment and the logged motor commands and battery voltage, and "
                    "predicts the next half second. The table gives its mean error after h steps of 10 ms."]
    everything = [r for r in rows if r.get("group", "all") == "all"]
    mine = of_one_clock(everything)
    last = last_horizon(mine)
    ranked = _ranked(one_truth(mine), last)
    if ranked:
        best_value, best = ranked[0]
        naive = next((v for v, r in ranked if "naive" in str(r.get("model"))), None)
        on_clock = ", as recorded" if len({clock_of(r) for r in everything}) > 1 else ""
        text = (f"Least position error at h = {last}{on_clock}: {person(best.get('model'))} with "
                f"{_show('position_mae_m', best_value)}")
        if naive is not None and best_value < naive:
            text += f", against {_show('position_mae_m', naive)} of a model that stands still"
        lines += [text + ".", *_near(one_truth(mine), last)]
    return [*lines, *_retimed_task1(everything, last), *_notes(sysid, "split")]


def _near(rows: Sequence[Mapping[str, Any]], last: str | None) -> list[str]:
    """Which models cannot be distinguished from the one that the rows are compared with; [] without comparisons."""
    to = next((r["ratio_to"] for r in rows if r.get("ratio_to")), None)
    ends = {str(r.get("model")): _at(r.get("ratio_ci95"), last) for r in rows if r.get("ratio_to") == to}
    if to is None or not any(ends.values()):
        return []
    near = [quoted(person(name)) for name, one in ends.items() if not excludes_one(one)]
    smaller = [quoted(person(name)) for name, one in ends.items() if excludes_one(one) and one[1] < 1.0]
    usual = quoted(person(to))
    same = (f"{', '.join(near)} cannot be distinguished from {usual}" if near else
            f"every other model differs from {usual}")
    less = f"; only {', '.join(smaller)} {'have' if len(smaller) > 1 else 'has'} less error" if smaller else ""
    return [f"By the interval of the ratio over the same windows, position error at h = {last}: {same}{less}."]


def _retimed_task1(rows: Sequence[Mapping[str, Any]], last: str | None) -> Words:
    """What re-timing does to each model; nothing unless both clocks are there."""
    mine = one_truth(rows)
    scores = {(r.get("model"), clock_of(r)): _at(r.get("metrics"), last) for r in mine}
    points: list[str] = []
    for row in mine:
        model, after = row.get("model"), scores[row.get("model"), clock_of(row)]
        before = scores.get((model, AS_RECORDED))
        if clock_of(row) == "retimed" and before and after:
            judgement = verdict(*(_at(row.get(key), last) for key in ("clock_ratio", "clock_ratio_ci95")))
            points.append(f"{person(model)}: position error at h = {last} is {_show('position_mae_m', before)} as "
                          f"recorded and {_show('position_mae_m', after)} re-timed"
                          f"{f': {judgement}' if judgement else ''}.")
    return ["With the moving error of the clock taken out of the vehicle's streams (off-line, from the motion capture "
            "of the whole flight):", points] if points else []


def _published_task1(row: Mapping[str, Any]) -> list[str]:
    """What the published numbers of one model say about it, computed from them."""
    published = row.get("published") or {}
    velocity = {h: mean_of(v) for h, v in (published.get("velocity_mae_m_s") or {}).items()}
    lines = []
    ours = mean_of(((row.get("metrics") or {}).get("position_mae_m") or {}).get("50"))
    theirs = mean_of((published.get("position_mae_m") or {}).get("50"))
    if ours is not None and theirs is not None:
        lines.append(f"{person(row.get('model'))}: position error at h = 50 is {_show('position_mae_m', theirs)} in "
                     f"the published table and {_show('position_mae_m', ours)} here ({_compared(theirs, ours)}).")
    first, tenth = velocity.get("1"), velocity.get("10")
    if first and tenth and "naive" not in str(row.get("model")):
        early, late = first / 0.01, tenth / 0.1
        if abs(early - late) <= 0.1 * early:
            lines.append(f"{person(row.get('model'))}: the published velocity error grows in proportion to time, by "
                         f"{format_number(early, 1)} m/s² from the first step on, {format_number(early / 9.81, 2)} of "
                         "gravity. This is a constant error of the thrust, which a right thrust curve removes, and no "
                         "limit of physics.")
    return lines


def task2(results: Results) -> Words:
    """Controllers on logged flights, and the plant's error bar."""
    control = results.get("control")
    if not control or not (control.get("rows") or control.get("gate")):
        return []
    lines: Words = []
    if any((r.get("plant") or "real") == "real" for r in control.get("rows") or []):
        lines.append("How far the vehicle was from the set-point of its controller, on logged flights.")
    gate = control.get("gate") or []
    if gate:
        passed = sum(bool(g.get("pass")) for g in gate)
        lines.append(f"The simulated plant passes its gate on {passed} of {len(gate)} logged flights; the gap is the "
                     "error bar of every simulated number.")
    return [*lines, *_notes(control, "gate_note")]


def task3(results: Results) -> Words:
    """The estimates: the effect of the clock, and dead reckoning."""
    estimate = results.get("estimate")
    if not estimate or not estimate.get("rows"):
        return []
    rows = estimate["rows"]
    return ["How far an estimate of the vehicle's position, velocity and attitude was from the motion capture.",
            *_clock_task3(rows), *_retimed_blackout(rows), *_notes(estimate)]


def mismatch(verdict: Mapping[str, Any] | None) -> Words:
    """The first lines of a diagnosis."""
    if not verdict or not verdict.get("outcome"):
        return []
    lines: Words = [str(verdict.get("headline") or ""), str(verdict.get("paragraph") or "")]
    return [line for line in lines if line]


def is_published(results: Results) -> bool:
    """Whether the recordings of a published table are among these."""
    return any(row.get("published") for body in results.values() for row in body.get("rows") or [])


def published(results: Results) -> Words:
    """The published tables against the same recordings corrected, with the reasons found in the data."""
    rows = (results.get("estimate") or {}).get("rows") or []
    flights = {f.get("flight"): f for f in (results.get("audit") or {}).get("flights") or []}
    lines: Words = []
    points: list[str] = []
    for (_, group), before, after in _pairs(rows):
        text = f"{group.capitalize()}: " + "; ".join(filter(None, (
            _change(metric, before, after) for metric in ("ate_rmse_m", "attitude_rmse_deg"))))
        names = [n for n in before.get("flights") or [] if n in flights]
        dead = sum(lost_in_the_air(flights[n]) > 0 for n in names)
        if dead:
            text += (f". In {dead} of its {len(names)} recordings the radio log ended in the air, and the file "
                     "continues every onboard stream as a straight line. The published table scores that line as the "
                     "estimate")
        dropped = (number(before.get("n")) or 0) - (number(after.get("n")) or 0)
        if dropped > 0:
            text += f". {_count(int(dropped), 'recording', 'recordings')} fewer, because copies count once"
        points.append(text + ".")
    if points:
        lines += ["State estimation:", points,
                  "The attitude error of the published protocol is a difference between degrees and radians. It also "
                  "mixes pitch with nose up positive (firmware) and nose down positive (motion capture). The "
                  "corrected one has one unit and one sign."]
    real = of_one_clock(r for r in (results.get("control") or {}).get("rows") or []
                        if (r.get("plant") or "real") == "real")
    points = [f"{person(before.get('controller'))}: " + "; ".join(filter(None, (
        _change(metric, before, after) for metric in
        ("rmse_m", "velocity_rmse_m_s", "heading_deg", "divergence_percent")))) + "."
        for before, after in _pairs_by_flights(real)]
    if points:
        lines += ["Control. The published protocol counts take-off, landing and the wait on the ground as tracking, "
                  "and goes on after a log has ended. It subtracts headings in different units (degrees taken as "
                  "radians). The corrected rows use the streamed trajectory only, in one unit.", points]
    models = one_truth(of_one_clock(r for r in (results.get("sysid") or {}).get("rows") or []
                                    if r.get("group", "all") == "all"))
    points = [point for row in models for point in _published_task1(row)]
    if points:
        lines += ["Prediction:", points]
    return lines


def _retimed_blackout(rows: Sequence[Mapping[str, Any]]) -> Words:
    """What re-timing does to dead reckoning; nothing unless both clocks are there."""
    mine = {(r.get("method"), clock_of(r)): r for r in rows if (r.get("protocol"), r.get("group")) == (BLACKOUT, "all")}
    points: list[str] = []
    for (method, clock), row in mine.items():
        before, after = (r.get("metrics") or {} for r in (mine.get((method, AS_RECORDED), {}), row))
        ends = [(h, f"end_error_{h}s_m") for h in (1, 5, 10) if clock == "retimed"]
        course = [f"{_show(metric, a)} as recorded and {_show(metric, b)} re-timed {h} s later{_on_clock(row, metric)}"
                  for h, metric in ends if (a := mean_of(before.get(metric))) and (b := mean_of(after.get(metric)))]
        if course:
            points.append(f"{method}: {', '.join(course)}.")
        if clock == "joint":
            points.append(f"{method} on every clock, 5 s later: {_bracket(mine, method)}. Streams that set the "
                          f"joint clock: {', '.join(row.get('clock_evidence') or [])}.")
    return ["Dead reckoning, after the last pose. Mean position error over flights, before and after the moving "
            "error of the clock is removed:", points] if points else []


def _bracket(rows: Mapping[tuple[Any, str], Mapping[str, Any]], method: Any) -> str:
    """The mean error of one method 5 s after the last pose on each clock, from least to most taken out."""
    metric, found = "end_error_5s_m", []
    for clock in CLOCKS:
        value = mean_of((rows.get((method, clock), {}).get("metrics") or {}).get(metric))
        if value is not None:
            found.append(f"{_show(metric, value)} {clock.replace('-', ' ')}")
    return ", ".join(found)


def _on_clock(row: Mapping[str, Any], metric: str) -> str:
    """The paired ratio to the row as recorded, in brackets; empty without one."""
    judgement = verdict(*((row.get(key) or {}).get(metric) for key in ("clock_ratio", "clock_ratio_ci95")))
    return f" ({judgement.replace(' (', ', ').removesuffix(')')})" if judgement else ""


def _clock_task3(rows: Sequence[Mapping[str, Any]]) -> Words:
    """How much of the position error is a clock, which streams told, and what the answer is good for."""
    method = logged_method(rows)
    found = {clock_of(r): r for r in rows if (r.get("protocol"), r.get("method"), r.get("group")) ==
             ("clean", method, "all")}
    before, after = found.get(AS_RECORDED), found.get("retimed")
    if before is None or after is None:
        return []
    names = {AS_RECORDED: "as recorded", "offset": "less a constant offset", "retimed": "re-timed"}
    steps = [(found[clock], name) for clock, name in names.items() if clock in found]

    def course(metric: str) -> str:
        values = ((mean_of((row.get("metrics") or {}).get(metric)), name) for row, name in steps)
        return ", ".join(f"{_show(metric, value)} {name}" for value, name in values if value is not None)

    a, b = (mean_of((row.get("metrics") or {}).get("ate_rmse_m")) for row in (before, after))
    head = ""
    if a and b and b < MOSTLY * a and excludes_one((after.get("clock_ratio_ci95") or {}).get("ate_rmse_m")):
        head = ("The position error is largely a clock error and not an estimator error. The timestamps of the "
                "vehicle's streams wander against those of the motion capture. A moving vehicle turns a late "
                "timestamp into an error along its track. ")
    across, delay = course("across_track_rmse_m"), course("delay_s")
    lines: Words = [f"{head}Means over {_count(int(number(before.get('n')) or 0), 'distinct flight')}:",
                    [f"ATE: {course('ate_rmse_m')}{_on_clock(after, 'ate_rmse_m')}.",
                     f"Along the track, best constant delay removed: {course('along_track_delay_removed_rmse_m')}.",
                     *([f"Across the track, where a clock hardly shows: {across}."] if across else []),
                     *([f"Best constant delay: {delay}; what re-timing leaves of it is the estimator's own."]
                       if delay else [])]]
    moving = number(after.get("n_moving"))
    if moving is not None:
        lines.append(f"A moving error was shown in {moving:.0f} of {after.get('n')} flights. {_voters(after)}")
    lines.append("This is an offline analysis: it uses motion capture from the whole flight, so it does not show what "
                 "the vehicle could know in flight.")
    return lines


def _voters(row: Mapping[str, Any]) -> str:
    """Which streams set the clock of a re-timed row, and that nothing judged is among them."""
    places, turns = (", ".join(row.get(key) or []) for key in ("clock_evidence", "clock_evidence_attitude"))
    if not places:
        return "Which streams set this clock is not in the result file."
    attitude = f" Attitudes are judged on a clock from {turns}." if turns else ""
    return (f"This clock was set by {places} against the motion capture. The estimated position and velocity were not "
            f"used for it, so they can be judged on it.{attitude}"
            " The remaining error includes the error of the clock "
            "correction.")


def _notes(body: Mapping[str, Any], *keys: str) -> list[str]:
    """Sentences of the result file itself, and how many recordings are in no row, by reason."""
    judgement = [f"{text[:1].upper()}{text[1:]}." for key in keys if (text := str(body.get(key) or "").rstrip("."))]
    reasons: dict[str, int] = {}
    for entry in body.get("left_out") or []:
        reason = str(entry.get("reason"))
        kind = next((f"{kind} another" for kind in ("copy of", "slice of") if reason.startswith(kind)), reason)
        reasons[kind] = reasons.get(kind, 0) + 1
    if reasons:
        kinds = "; ".join(f"{n} ({kind})" for kind, n in sorted(reasons.items(), key=lambda item: -item[1]))
        judgement.append(f"Excluded: {_count(sum(reasons.values()), 'recording')}, {kinds}.")
    return judgement


def _pairs(rows: Sequence[Mapping[str, Any]]) -> list[tuple[tuple[Any, str], Mapping[str, Any], Mapping[str, Any]]]:
    """((method, group), as-published row, corrected row); ``clean`` where nothing nearer corrects it."""
    rows = of_one_clock(rows)
    protocols = {r.get("protocol") for r in rows}
    mended = CORRECTED if CORRECTED in protocols else "clean"
    published, corrected = ({(r.get("method"), str(r.get("group")).lower()): r for r in rows
                             if r.get("protocol") == protocol} for protocol in (PUBLISHED, mended))
    return [(k, published[k], corrected[k]) for k in published if k in corrected]


def _pairs_by_flights(rows: Sequence[Mapping[str, Any]]) -> list[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    """(as-published row, corrected row of the same controller with most of its flights)."""
    found = []
    for before in (r for r in rows if r.get("protocol") == PUBLISHED):
        flights = set(before.get("flights") or [])
        others = [r for r in rows if r.get("protocol") != PUBLISHED and r.get("controller") == before.get("controller")]
        shared = [(len(flights & set(r.get("flights") or [])), r) for r in others]
        n, after = max(shared, key=lambda pair: pair[0], default=(0, before))
        if n:
            found.append((before, after))
    return found


def _change(metric: str, before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
    a, b = (mean_of((row.get("statistics") or row.get("metrics") or {}).get(metric)) for row in (before, after))
    if a is None or b is None:
        return ""
    name = shown(metric).title
    if abs(a - b) <= ALIKE * max(abs(a), abs(b)):
        return f"{name} {_show(metric, b)}, unchanged by the correction"
    off = f" ({_times(a, b)})" if b > 0 else ""
    return f"{name} {_show(metric, a)} as published, {_show(metric, b)} corrected{off}"


def _compared(theirs: float, ours: float) -> str:
    """In words, two numbers of which neither need be wrong."""
    ratio = theirs / ours if ours else float("inf")
    return "alike" if abs(ratio - 1) <= ALIKE else f"the published one is {format_number(ratio, 2)} of ours"


def _times(before: float, after: float) -> str:
    """In words, how far off ``before`` was."""
    ratio = before / after
    if abs(ratio - 1) <= ALIKE:
        return "alike"
    if ratio >= 2:
        return f"{format_number(ratio, 0 if ratio >= 10 else 1)} times too large"
    return f"{format_number(abs(ratio - 1) * 100, 0)} % too {'large' if ratio > 1 else 'small'}"


def _ranked(rows: Sequence[Mapping[str, Any]], horizon: str | None) -> list[tuple[float, Mapping[str, Any]]]:
    found = [(mean_of(((r.get("metrics") or {}).get("position_mae_m") or {}).get(horizon)), r) for r in rows]
    return sorted(((v, r) for v, r in found if v is not None), key=lambda pair: pair[0])


def last_horizon(rows: Sequence[Mapping[str, Any]]) -> str | None:
    found = {h for r in rows for h in ((r.get("metrics") or {}).get("position_mae_m") or {}) if str(h).isdigit()}
    return max(found, key=int, default=None)


def _at(found: Mapping[str, Any] | None, horizon: str | None) -> Any:
    """Of the position error at one horizon."""
    one = ((found or {}).get("position_mae_m") or {}).get(horizon)
    return one if isinstance(one, list) else mean_of(one)


def mean_of(found: Any) -> float | None:
    return number(found.get("mean", found.get("value"))) if isinstance(found, Mapping) else number(found)


def _show(metric: str, value: float) -> str:
    how = shown(metric)
    return f"{format_number(value * how.factor, how.decimals)} {how.unit}".strip()


def _copies(results: Results) -> int:
    return sum(len(group) - 1 for group in (results.get("audit") or {}).get("copies") or [])


def _count(n: int, one: str, many: str | None = None) -> str:
    return f"{n} {one if n == 1 else many or one + 's'}"
