"""The first things a person asks, each as one number with what it is worth and where to read on."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from ..tables.method_names import person
from ..tables.quantities import format_duration, format_number, number, shown
from .audit_entry import total
from .row_cells import AS_RECORDED, clock_of, of_one_clock, one_truth
from .task3_tables import logged_method
from .words import last_horizon, mean_of

State = Literal["good", "warn", "bad", ""]
FINE_SHARE = 0.9
"""More usable than this is good, less is worth a look: a convention."""


@dataclass(frozen=True)
class Tile:
    """title: the question; value: the answer; detail: n, interval and the comparison; section: where the page has
    more."""

    title: str
    value: str
    detail: str
    state: State
    section: str


def tiles(results: Mapping[str, Mapping[str, Any]]) -> list[Tile]:
    """Those whose results are there."""
    audit, estimate, sysid, control, verdict = (results.get(name) or {} for name in
                                                ("audit", "estimate", "sysid", "control", "verdict"))
    found = [*of_audit(audit.get("flights") or []), of_estimate(estimate.get("rows") or []),
             of_sysid(sysid.get("rows") or []), of_control(control), of_verdict(verdict)]
    return [tile for tile in found if tile is not None]


def of_audit(flights: Sequence[Mapping[str, Any]]) -> list[Tile]:
    """Usable flights, and faults that take something away."""
    judged = [f for f in flights if f.get("severity")]
    if not judged:
        return []
    good = [f for f in judged if f["severity"] != "unusable"]
    usable, flown = (sum(total(f.get(key)) or 0.0 for f in judged) for key in ("usable", "airborne"))
    share = usable / flown if flown else 0.0
    first = Tile("Recordings usable", f"{len(good)} of {len(judged)}",
                 f"{format_duration(usable)} of {format_duration(flown)} in the air",
                 "bad" if not good else "warn" if share <= FINE_SHARE or len(good) < len(judged) else "good", "flights")
    hurt = [f for f in judged if f["severity"] in ("cut", "unusable")]
    kinds = Counter(event["kind"].replace("_", " ") for f in hurt for event in f.get("events") or []
                    if event["seconds_cut"])
    detail = ", ".join(f"{kind} in {n}" for kind, n in kinds.most_common(2))
    second = Tile("Faults that matter", f"{len(hurt)} recording{'s' * (len(hurt) != 1)}" if hurt else "none",
                  detail or ("seen in the air or the whole file" if hurt else f"n = {len(judged)} recordings"),
                  "warn" if hurt else "good", "flights")
    return [first, second]


def of_estimate(rows: Sequence[Mapping[str, Any]]) -> Tile | None:
    """ATE of the logged estimate over clean recordings, and what re-timing leaves of it."""
    everything = [r for r in rows if r.get("protocol") == "clean" and r.get("group") == "all"]
    method = logged_method(rows) or next((str(r.get("method")) for r in everything), None)
    mine = {clock_of(r): r for r in everything if str(r.get("method")) == method}
    row = mine.get(AS_RECORDED) or next(iter(mine.values()), None)
    found = ((row or {}).get("metrics") or {}).get("ate_rmse_m")
    value = mean_of(found)
    if row is None or value is None:
        return None
    detail = f"ATE RMSE, n = {row.get('n')}"
    if isinstance(found, Mapping) and found.get("ci95") and row.get("n") != 1:
        detail += f", 95 % [{_value('ate_rmse_m', found['ci95'][0])}, {_value('ate_rmse_m', found['ci95'][1])}]"
    after = mean_of(((mine.get("retimed") or {}).get("metrics") or {}).get("ate_rmse_m"))
    if after is not None and clock_of(row) == AS_RECORDED:
        detail += f"; {_unit('ate_rmse_m', after)} with the clock re-timed"
    return Tile(f"Position error, {person(method)}", _unit("ate_rmse_m", value), detail, "", "where")


def of_sysid(rows: Sequence[Mapping[str, Any]]) -> Tile | None:
    """The model that predicts best, against standing still."""
    mine = one_truth(of_one_clock(r for r in rows if r.get("group", "all") == "all"))
    last = last_horizon(mine)
    ranked = sorted((v, str(r.get("model")), r) for r in mine
                    if (v := mean_of(((r.get("metrics") or {}).get("position_mae_m") or {}).get(last))) is not None)
    if not ranked or last is None:
        return None
    value, model, row = ranked[0]
    naive = next((v for v, name, _ in ranked if "naive" in name), None)
    flights = row.get("n_flights")
    detail = f"{int(last) * 0.01:g} s ahead, n = {flights} flight{'s' * (flights != 1)}, {person(model)}"
    if naive is not None and naive > value:
        detail += f"; standing still: {_unit('ate_rmse_m', naive)}"
    return Tile("Prediction error, position", _unit("ate_rmse_m", value), detail, "", "physics")


def of_control(control: Mapping[str, Any]) -> Tile | None:
    """How many logged flights the plant reproduces; else how well was flown."""
    gate = control.get("gate") or []
    if gate:
        passed = sum(bool(g.get("pass")) for g in gate)
        return Tile("Plant validation", f"{passed} of {len(gate)}",
                    "logged flights that the plant reproduces in simulation",
                    "good" if passed > FINE_SHARE * len(gate) else "warn", "control")
    rows = [r for r in control.get("rows") or [] if (r.get("metrics") or {}).get("rmse_m") is not None]
    most = max(rows, key=lambda r: r.get("n") or 0, default=None)  # as the sentence of the verb
    value = None if most is None else mean_of(most["metrics"]["rmse_m"])
    if most is None or value is None:
        return None
    pilot = person(most.get("controller"))
    path = " ".join(str(most[key]).replace("_", " ") for key in ("reference", "speed") if most.get(key))
    return Tile("Tracking error", _unit("ate_rmse_m", value), f"RMSE, {pilot}" + f", {path}" * bool(path)
                + f", n = {most.get('n')}", "", "control")


def of_verdict(verdict: Mapping[str, Any]) -> Tile | None:
    """Where the simulator is wrong."""
    if not verdict.get("outcome"):
        return None
    names = [str(f.get("term") or " or ".join(f.get("causes") or ())).replace("_", " ")
             for f in verdict.get("findings") or []]
    value = ", ".join(names[:2]) or str(verdict["outcome"]).replace("_", " ")
    return Tile("Simulator and flights", value, str(verdict.get("headline") or verdict.get("paragraph") or ""),
                "warn" if names else "", "mismatch")


def _value(metric: str, value: float | None) -> str:
    how = shown(metric)
    value = number(value)
    return format_number(None if value is None else value * how.factor, how.decimals)


def _unit(metric: str, value: float) -> str:
    return f"{_value(metric, value)} {shown(metric).unit}"
