"""Parameters of the onboard filter from recordings: what ``estimate --tune-onboard`` and ``nb.tune_onboard`` do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..time_offsets.moving.votes import AS_RECORDED
from .options import Options

if TYPE_CHECKING:
    from ..auditing.recording_audit import Audit
    from ..flight import Flight
    from ..protocols.onboard_tuning import Drag, DragSums, OnboardTuning, Settings
    from ..protocols.task3 import Case

RETIMED = "retimed"
JUDGED = ("position", "velocity")
"""Logged estimates that get no vote on the clock that judges them."""
SHOWN = {"ate_m": "ATE", "velocity_m_s": "velocity error", "end_1s_m": "horizontal error after 1 s without poses",
         "end_5s_m": "after 5 s"}


def tune_onboard(options: Options, flights: Sequence[Flight], audits: Mapping[str, Audit],
                 delay_s: float | None = None) -> OnboardTuning:
    """Parameters from all flights, and scores of flights held out in parts; ``delay_s``: of the poses, instead of the
    one found. InputError where no flight has an IMU and poses, or all are too slow to show drag."""
    from estimators.firmware_ekf import FirmwareEkf

    from ..auditing.selection import distinct
    from ..auditing.usable import missing
    from ..auditing.verb_needs import INERTIAL
    from ..protocols import onboard_tuning as protocol
    from ..protocols.task3 import select

    kept = distinct(flights)[0]
    on: dict[str, dict[str, Case]] = {}
    for clock in (RETIMED, AS_RECORDED):
        moved = replace(options, clock=clock)
        seen = moved.see_on_clock(kept, audits, JUDGED) if clock != AS_RECORDED else None
        cases = select(seen.flights, seen.audits, "clean", INERTIAL) if seen else select(kept, audits, "clean",
                                                                                       INERTIAL)
        on[clock] = {case.flight.name: case for case in cases if missing(case.flight, INERTIAL) is None}
    names = [name for name in on[RETIMED] if name in on[AS_RECORDED]]
    runner = _Runner(options, on)
    near = _evenly(names, protocol.SEARCHED_ON)
    flown = protocol.as_flown(list(runner.each(protocol.distances, "as flown", near, firmware=FirmwareEkf).values()),
                              delay_s)
    sums = runner.each(protocol.drag_sums, "drag", names)
    names = [name for name in names if name in sums and sums[name].rows]
    if not names:
        raise InputError("data", "no flight has airborne rows of IMU and motion capture on both clocks")
    sessions = options.sessions.by_name(on[RETIMED][name].flight for name in names)
    groups, held_out = protocol.parts(names, np.array([sessions[name] for name in names]))
    if len(names) < 2:
        held_out = "nothing: one flight, which is judged with its own parameters"
    trained = [[name for name in names if name not in group] or names for group in groups]
    fits = [_fit(options, sums, sessions, train) for train in [*trained, names]]
    kwargs = [{"cases": [on[RETIMED][name] for name in _evenly(train, protocol.SEARCHED_ON)],
               "start": _with_drag(flown.settings, fit), "delay_s": flown.delay_s, "firmware": FirmwareEkf}
              for train, fit in zip([*trained, names], fits, strict=True)]
    found = runner.run(protocol.search, "search", kwargs)
    by_part = dict(zip(range(len(groups)), found, strict=False))
    variants: dict[str, dict[str, Settings]] = {
        what: {} for what in (protocol.FLOWN, protocol.DRAG, protocol.PRESSURE, protocol.TUNED)}
    for k, group in enumerate(groups):
        for name in group:
            drag = _with_drag(flown.settings, fits[k])
            variants[protocol.FLOWN][name] = flown.settings
            variants[protocol.DRAG][name] = drag
            variants[protocol.PRESSURE][name] = replace(drag, pressure_z_m=fits[k].pressure_z_m)
            variants[protocol.TUNED][name] = by_part[k]
    scores: dict[tuple[str, str], Mapping[str, Mapping[str, float]]] = {}
    for clock in (RETIMED, AS_RECORDED):
        logged = [name for name in names if "estimator" in on[clock][name].flight
                  and {"attitude", "attitude_qw"} & set(on[clock][name].flight.streams)]
        scores[protocol.LOGGED, clock] = runner.each(protocol.score_logged, f"logged {clock}", logged, clock)
        for what, settings in variants.items():
            scores[what, clock] = runner.each(
                protocol.score, f"{what} {clock}", names, clock, delay_s=flown.delay_s, firmware=FirmwareEkf,
                own={"settings": settings})
    rows = protocol.tabulate(scores, sessions, options.seed)
    return protocol.OnboardTuning(found[-1].named(), fits[-1], flown, held_out, rows, found[:-1], names)


def tune_onboard_flights(options: Options, flights: Sequence[Flight], delay_s: float | None = None) -> OnboardTuning:
    """``tune_onboard`` of flights that are not audited yet."""
    return tune_onboard(options, flights, options.audit(flights)[0], delay_s)


def _fit(options: Options, sums: Mapping[str, DragSums], sessions: Mapping[str, int], train: Sequence[str]) -> Drag:
    from ..protocols.onboard_tuning import fit_drag

    return fit_drag([sums[name] for name in train], np.array([sessions[name] for name in train]), options.seed)


def _with_drag(settings: Settings, drag: Drag) -> Settings:
    return replace(settings, drag_x_1_s=drag.drag_1_s[0], drag_y_1_s=drag.drag_1_s[1])


def _evenly(names: Sequence[str], n: int) -> list[str]:
    if not names:
        raise InputError("data", "no flight has an IMU and poses on both clocks")
    return [names[int(k)] for k in np.unique(np.linspace(0, len(names) - 1, n).round())]


class _Runner:
    """Items of the harness over the cases of both clocks."""

    def __init__(self, options: Options, on: Mapping[str, Mapping[str, Case]]) -> None:
        self.options, self.on = options, on

    def each(self, function: Any, what: str, names: Sequence[str], clock: str = RETIMED,
             own: Mapping[str, Mapping[str, Any]] | None = None, **kwargs: Any) -> dict[str, Any]:
        """{name: what the function gives of its case}; ``own``: arguments that differ by flight."""
        from ..harness import make_item

        items = {name: make_item(function, {
            "case": self.on[clock][name], **kwargs, **{key: values[name] for key, values in (own or {}).items()}},
            f"tune-onboard {what} {name}", file=self.on[clock][name].flight.provenance.path) for name in names}
        values = self.options.run(list(items.values()), what).values
        return {name: values[item.key] for name, item in items.items() if item.key in values}

    def run(self, function: Any, what: str, kwargs: Sequence[Mapping[str, Any]]) -> list[Any]:
        from ..harness import make_item

        items = [make_item(function, dict(given), f"tune-onboard {what} {k}") for k, given in enumerate(kwargs)]
        values = self.options.run(items, what).values
        if any(item.key not in values for item in items):
            raise InputError("data", self.options.failed[-1]["error"] if self.options.failed else f"{what} failed")
        return [values[item.key] for item in items]


def tuning_sentence(found: OnboardTuning) -> str:
    """Drag, and ratios of errors on held-out flights on the re-timed clock."""
    from ..protocols.onboard_tuning import DRAG, TUNED

    x, y = found.drag.drag_1_s
    text = f"drag {x:.2f} 1/s along x, {y:.2f} along y"
    parts = []
    for what in (DRAG, TUNED):
        row = found.row(what, RETIMED)
        if row is None or row.ratios is None:
            continue
        changes = [f"{name} x {told.ratio:.2f}" + (f" ({told.ci95[0]:.2f} .. {told.ci95[1]:.2f})" if told.ci95 else "")
                   for key, name in SHOWN.items() if (told := row.ratios.get(key)) and told.ratio is not None]
        parts.append(f"{what}: {', '.join(changes)}")
    return "; ".join([text, f"held out: {found.held_out}", *parts])


def parameters_toml(found: OnboardTuning) -> str:
    """The parameters as a file: a table ``[parameters]``, by the firmware's names."""
    lines = ["# Parameters of the onboard Kalman filter, found by nanobench estimate --tune-onboard.",
             f"# {len(found.flights)} flights; poses {1e3 * found.flown.delay_s:.0f} ms late. kalman.dragB_* need "
             "firmware 2026.04 or later.",
             "[parameters]", *(f'"{name}" = {value!r}' for name, value in found.parameters.items())]
    return "\n".join(lines) + "\n"
