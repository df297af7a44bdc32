"""Motors and propellers before take-off, by the firmware's own test (``health.startPropTest``, health.c).

Every motor turns for a moment. The variance of the accelerometer shows a motor that does not turn, and a propeller that
is missing, loose or damaged. The firmware has no threshold by default. Motors are then compared with each other,
and with what is usual for this vehicle, once some tests were kept.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import InputError
from ..blocks import Block
from ..host_clock import Clock
from ..vehicle_link import CflibLink

START, BATTERY = "health.startPropTest", "health.startBatTest"
VARIANCES = tuple(f"health.motorVar{axis}M{motor}" for motor in (1, 2, 3, 4) for axis in "XY")
PASS, COUNT, SAG, BATTERY_PASS = ("health.motorPass", "health.motorTestCount", "health.batterySag",
                                  "health.batteryPass")
FIRST_S, TEST_S, BATTERY_S = 1.0, 20.0, 0.6
"""Limits for the first log packets, the test of four motors (4 s brushed, 12 s brushless), and that of the battery."""
EVERY_S = 0.1
FINISHED = 1 << 7
FEWEST, KEPT = 3, 20
"""Tests that are needed before they are what is usual, and that are kept."""
AMONG, USUAL = 5.0, 3.0
"""Factor between a motor and the median of the others, and between it and its usual value, that is a failure. A
convention: not calibrated with damaged propellers."""


@dataclass(frozen=True)
class MotorTest:
    """``variance`` (4,): sum of squares of x and y, g^2, as the firmware has it; ``passed``: its bits; ``sag_V``."""

    variance: tuple[float, float, float, float]
    passed: int
    sag_V: float
    battery_passed: bool


def run_test(link: CflibLink, clock: Clock) -> MotorTest:
    """Turns every motor for a moment. Raises InputError if the vehicle has no such test or it does not end."""
    missing = sorted(({START, BATTERY} - link.parameters) | ({*VARIANCES, PASS, COUNT, SAG} - set(link.log_types)))
    if missing:
        raise InputError(link.uri, f"the vehicle does not have {', '.join(missing)}",
                         "fly without --check-motors, or flash firmware 2025.12; not armed")
    link.start_blocks([Block("propellers", 100, VARIANCES[:6], ("",) * 6),
                       Block("propeller_test", 100, (*VARIANCES[6:], PASS, COUNT, SAG, BATTERY_PASS), ("",) * 6)])
    values = link.values

    def heard(done: Callable[[], bool], most_s: float) -> bool:
        """Waits; a vehicle that hears nothing for a second stops its log."""
        until = clock.now() + most_s
        while not done():
            if clock.now() > until:
                return False
            link.request_echo()
            clock.sleep_until(clock.now() + EVERY_S)
        return True

    if not heard(lambda: COUNT in values and VARIANCES[0] in values, FIRST_S):
        raise InputError(link.uri, "the results of the motor test do not come", "is the link good enough? not armed")
    before = int(values[COUNT])
    link.write_parameter(START, 1)
    if not heard(lambda: int(values[COUNT]) != before, TEST_S):
        raise InputError(link.uri, f"the motor test did not end in {TEST_S:.0f} s", "see its console; not armed")
    link.write_parameter(BATTERY, 1)
    heard(lambda: False, BATTERY_S)
    found = np.array([values[name] for name in VARIANCES]).reshape(4, 2).sum(axis=1)
    return MotorTest(tuple(float(v) for v in found), int(values[PASS]), float(values[SAG]),  # type: ignore[arg-type]
                     bool(values[BATTERY_PASS]))


def failures(test: MotorTest, usual: Sequence[Sequence[float]] = ()) -> list[str]:
    """Failures in words. ``usual``: (n, 4) variances of earlier tests of this vehicle."""
    found = []
    bits = test.passed & 0b1111
    judged_on_board = bool(test.passed & FINISHED and bits)
    median = np.median(np.array(usual, float), axis=0) if len(usual) >= FEWEST else None
    for motor, value in enumerate(test.variance):
        others = float(np.median([v for m, v in enumerate(test.variance) if m != motor]))
        if judged_on_board and not bits & 1 << motor:
            found.append(f"M{motor + 1} fails the vehicle's own propeller test (variance {value:.2f})")
        elif not np.isfinite(value):
            found.append(f"M{motor + 1} was not measured")
        elif words := _odd(value, others, AMONG):
            found.append(f"M{motor + 1} shakes {words} the others: {_cause(value, others)}")
        elif median is not None and (words := _odd(value, float(median[motor]), USUAL)):
            found.append(f"M{motor + 1} shakes {words} usual: {_cause(value, float(median[motor]))}")
    if not test.battery_passed:
        found.append(f"the battery sags by {test.sag_V:.2f} V under load: old, cold, or a bad contact")
    return found


def _odd(value: float, reference: float, factor: float) -> str:
    """How far a value is from a reference, in words; "" within ``factor``."""
    if not reference > 0.0:
        return ""
    ratio = value / reference
    if 1.0 / factor <= ratio <= factor:
        return ""
    return f"{ratio:.1f} times as much as" if ratio >= 1.0 else f"{ratio:.2f} times as much as"


def _cause(value: float, reference: float) -> str:
    return "a bent, cut or loose propeller?" if value > reference else "does it turn, is its propeller on?"


def check_motors(link: CflibLink, clock: Clock, say: Callable[[str], None], store: Path | None = None) -> None:
    """Tests motors and battery, and keeps a test that is passed. Raises InputError for a failure. ``store``: file with
    earlier tests by URI, None to compare motors with each other only."""
    say("testing the motors: each turns for a moment")
    earlier = _earlier(store)
    usual = earlier.get(link.uri, [])
    test = run_test(link, clock)
    wrong = failures(test, usual)
    if wrong:
        raise InputError(link.uri, "; ".join(wrong), "mend it; not armed")
    reference = f"{len(usual)} earlier tests" if len(usual) >= FEWEST else "each other"
    say(f"motors: variance {', '.join(f'{v:.3g}' for v in test.variance)} g^2, like {reference}; the battery sags by "
        f"{test.sag_V:.2f} V")
    if store is not None:
        earlier[link.uri] = [*usual, list(test.variance)][-KEPT:]
        store.parent.mkdir(parents=True, exist_ok=True)
        store.write_text(json.dumps(earlier), encoding="utf-8")


def _earlier(store: Path | None) -> dict[str, list[list[float]]]:
    """Earlier tests; a file that cannot be read holds none."""
    try:
        found = json.loads(store.read_text(encoding="utf-8")) if store is not None else {}
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}
