"""The audit of a flight that ``fly`` has just recorded: one line, and a page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import NanobenchError
from ...steps.options import Options
from ..audit import audit_body

if TYPE_CHECKING:
    from ...auditing.recording_audit import Audit

CLOCK_KINDS = ("clock_wander", "clock_drift")
"""Fault kinds of which a busy computer may be the cause: a clock that moves. A constant lag is a filter's or link's."""
BUSY_SHARE = 0.5
"""Delay of the loop (99th percentile) as a share of the clock's error, from which on the computer may explain it."""


def audit_recording(options: Options, csv: Path, raw: Path) -> Path | None:
    """Report the verdict on a recording in one line and write its page next to it.

    Parameters
    ----------
    options : Options
        Of the verb, for its messages.
    csv, raw : Path
        The recording, and the folder of its raw tables: audit.json goes there.

    Returns
    -------
    Path or None
        The page; None if the recording could not be audited.
    """
    quiet = replace(options, data=(csv,), out=raw, json=None, quiet=True, failed=[], flights=[], said=[])
    try:
        flights = quiet.load([csv])
        audits, copies = quiet.audit(flights)
        body = audit_body(flights, audits, copies)
        if quiet.failed or not body["flights"]:
            options.say(f"{csv}: not audited" + (f": {quiet.failed[0]['error']}" if quiet.failed else ""))
            return None
        page = _page(quiet, csv, body, flights, audits)
    except (NanobenchError, OSError) as error:
        options.say(f"{csv}: not audited: {error}")
        return None
    entry = body["flights"][0]
    options.say(f"audit: {entry['severity']}. {entry['verdict']}; page: {page}")
    if line := load_line(flights[0].metadata, audits[flights[0].name]):
        options.say(line)
    return page


def _page(options: Options, csv: Path, body: Mapping[str, Any], flights: list[Any], audits: Mapping[str, Audit]
          ) -> Path:
    from ...harness import write_json
    from ...pages.report_page import write_report

    assert options.out is not None
    content = options.envelope("audit", body)
    write_json(options.out / "audit.json", content)
    made = write_report(options.out, {"audit": content}, flights, audits, options.synthetic)
    return made.replace(csv.with_suffix(".html"))


def load_line(sheet: Mapping[str, Any], audit: Audit) -> str:
    """Whether the load of this computer may explain a clock error that the audit found; "" without such an error.

    The sheet of a recording holds the delay of the host's loop (``recorder.loop``).
    """
    loop = (sheet.get("recorder") or {}).get("loop")
    errors = [fault.size for fault in audit.faults if fault.kind in CLOCK_KINDS and fault.unit == "s"]
    if not loop or not errors:
        return ""
    error_ms, late_ms = 1e3 * max(map(abs, errors)), float(loop["late_p99_ms"])
    said = (f"the clock error of {error_ms:.1f} ms", f"this computer's loop was {late_ms:.1f} ms late (p99, most "
            f"{float(loop['late_most_ms']):.1f} ms)")
    if late_ms >= BUSY_SHARE * error_ms:
        return f"{said[0]} may be the load of this computer: {said[1]}"
    return f"{said[0]} is not the load of this computer: {said[1]}"
