"""Units of motor commands, of the collective command and of rotor speeds in a drafted map."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..settings import number, setting
from ..sources.column_map import PWM_STREAMS, allowed_units
from ..sources.column_names import words_of
from ..units import PWM_FULL_SCALE, factor
from . import column_evidence as evidence
from .draft import Draft, Key
from .plausible_ranges import ROTOR_RAD_S

LEAST_COMMAND = number("audit.draft_motors.least_command")
COUNTS_APART = number("audit.draft_motors.counts_apart")
SLOW_RPM = number("audit.draft_motors.slow_rpm")
PULSE_US = setting("audit.draft_motors.pulse_us")
FORCE_WORDS = frozenset({"thrust", "thrusts", "force", "forces", "collective"})


def judge_motors(draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    """Numbers and units of motors, of their collective and of rotor speeds."""
    for stream in (*sorted(PWM_STREAMS), "rpm"):
        keys = [k for k in draft.mapped if k[0] == stream]
        numbered = sorted(int(k[1][1:]) for k in keys if k[1][1:].isdigit())
        if numbered and all(draft.mapped[k].status == "assumed" for k in keys):
            if numbered[0] == 0:
                moved = {(s, f"m{int(q[1:]) + 1}"): draft.mapped.pop((s, q)) for s, q in keys}
                draft.mapped.update(moved)
                draft.notes.append(f"{', '.join(d.column for d in moved.values())}: counted from 0, so they are m1 to "
                                   f"m{len(moved)}, in the order of the table")
                keys = list(moved)
            elif numbered == [1, 2, 3]:
                draft.ask(keys, "three motors, counted from 0 or from 1? write m1, m2 ... yourself")
                continue
        for key in [k for k in keys if k[1] == "m0"]:
            draft.ask([key], "motors are m1 to m8; which one is it?")
        keys = [k for k in keys if k in draft.mapped]
        stated = [k for k in keys if draft.mapped[k].unit == "rpm" and draft.mapped[k].why == "stated"]
        if _electrical(draft, stated, values):
            continue
        keys = draft.open(keys)
        if not keys:
            continue
        if stream == "rpm":
            _rotors(draft, keys, values)
            continue
        cells = np.stack([values[draft.mapped[k].column] for k in keys], axis=1)
        tops = np.nanquantile(cells, 0.99, axis=0)
        if tops.min() > 0.0 and tops.max() > 2.0 * evidence.SAME * tops.min():
            draft.ask(keys, "they are of different size: are they all in one unit? write the unit of each")
            continue
        top, bottom = float(np.nanquantile(cells, 0.99)), float(np.nanmin(cells))
        if bottom < 0.0:
            draft.ask(keys, f"between {bottom:.3g} and {top:.4g}: a rotor is commanded no negative thrust; is it a "
                      "motor's command?")
        elif top <= 1.2 and (readings := _of_a_command(draft, keys, cells, values)):
            draft.ask(keys, f"between {bottom:.3g} and {top:.3g}: {readings}")
        elif top <= 1.2:
            draft.mapped.update({k: replace(draft.mapped[k], why=f"between {bottom:g} and {top:.3g}") for k in keys})
        elif PULSE_US[0] <= bottom and top <= PULSE_US[1]:
            draft.set_unit(keys, "pulse_us",
                           f"they lie between {bottom:g} and {top:g}: pulses (1000 us is 0, 2000 us 1)")
        elif 10.0 * PULSE_US[0] <= bottom and top <= 10.0 * PULSE_US[1]:
            draft.ask(keys, f"between {bottom:g} and {top:.4g}: 16 bits, or pulses in 0.1 us? write unit = \"pwm16\", "
                      "or convert them to us")
        elif bottom >= 0.0 and LEAST_COMMAND * PWM_FULL_SCALE < top <= PWM_FULL_SCALE:
            draft.set_unit(keys, "pwm16", f"they reach {top:.4g}")
        else:
            choices = ", ".join(allowed_units(*keys[0]))
            draft.ask(keys, f"between {bottom:g} and {top:.4g}: the unit is unknown; write unit = one of {choices}")


def _rotors(draft: Draft, keys: list[Key], values: Mapping[str, np.ndarray]) -> None:
    """The unit of rotor speeds: that of the name, or the only one in which rotors carry a vehicle."""
    if all("rpm" in draft.mapped[k].column.lower() for k in keys):
        if not _electrical(draft, keys, values):
            draft.set_unit(keys, "rpm", "the name says so", "known")
        return
    usual = _usual(draft, keys, values)
    fits = [u for u, f in (("rad/s", 1.0), ("rpm", factor("rpm")), ("turns a second", 2.0 * np.pi))
            if ROTOR_RAD_S[0] <= usual * f <= ROTOR_RAD_S[1]]
    if fits == ["rpm"]:
        draft.set_unit(keys, "rpm", f"the median is {usual:.4g}")
    else:
        draft.ask(keys, f"a median of {usual:.4g}: {' or '.join(fits) or 'which unit is it'}? write unit = \"rad/s\" "
                  "or \"rpm\" at each")


def _usual(draft: Draft, keys: list[Key], values: Mapping[str, np.ndarray]) -> float:
    """Median size of the numbers of rotors that turn; 0 where none does."""
    cells = np.abs(np.stack([values[draft.mapped[k].column] for k in keys], axis=1))
    turning = cells[np.isfinite(cells) & (cells > 0.0)]
    return float(np.median(turning)) if len(turning) else 0.0


def _electrical(draft: Draft, keys: list[Key], values: Mapping[str, np.ndarray]) -> bool:
    """Asks where numbers called rpm are those of large rotors, or electrical speeds as ESCs report them."""
    usual = _usual(draft, keys, values) if keys else SLOW_RPM
    slow, fast = usual < SLOW_RPM, usual * factor("rpm") > ROTOR_RAD_S[1]
    if slow:
        draft.ask(keys, f"a median of {usual:.4g}: rpm of large rotors, or eRPM/100 of an ESC? If rpm, write unit = "
                  "\"rpm\". Else multiply by 100 and divide by the pairs of poles")
    elif fast:
        draft.ask(keys, f"a median of {usual:.4g}: no rotor turns so fast. Divide eRPM by the pairs of poles")
    return slow or fast


def _of_a_command(draft: Draft, keys: list[Key], cells: np.ndarray, values: Mapping[str, np.ndarray]) -> str:
    """What else commands of (n, k) numbers up to 1 can be, or "": forces in N, where the name does not exclude them."""
    top = float(np.nanmax(cells))
    if top in (0.0, 1.0) or np.allclose(cells * PWM_FULL_SCALE, np.round(cells * PWM_FULL_SCALE), 0.0, COUNTS_APART,
                                        equal_nan=True):
        return ""
    path = draft.columns("mocap", ("px", "py", "pz")) or draft.columns("estimator", ("x", "y", "z"))
    if top < LEAST_COMMAND and path and evidence.spans(draft.si(path, values)).max() > evidence.SMALLEST_FLIGHT_M:
        return "no share of full command that lifts a vehicle. Forces in N, or counts? write the unit of each"
    if top <= 1.0 and not all(set(words_of(draft.mapped[k].column)[0]) & FORCE_WORDS
                              or re.fullmatch(r"(?i)u_?\d", draft.mapped[k].column) for k in keys):
        columns = ", ".join(draft.mapped[k].column for k in keys)
        if keys[0][0] != "command":
            draft.notes.append(f"{columns}: shares of full command are assumed; forces in N look alike: check it")
        return ""
    wholly = 'unit = "N"' if keys[0][0] == "command" else "leave them out, since a map reads no force of a rotor"
    return f"shares of full command, or forces in N? Both are possible: write unit = \"1\", or {wholly}"
