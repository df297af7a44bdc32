"""Vibration, clipping and battery of one flight, as log analysts look at them."""

from dataclasses import dataclass
from typing import Any

from ..flight import Flight, intersect_spans
from ..results.result import Result
from .battery_sag import Battery, battery_of
from .recording_audit import Audit
from .vibration_spectra import Vibration, vibration_of

SENSORS = {"gyro": ("gyro_x", "gyro_y", "gyro_z"), "acc": ("acc_x", "acc_y", "acc_z")}


@dataclass(frozen=True, repr=False)
class Health(Result):
    """``vibration`` by sensor; what could not be computed is in ``lacks``."""

    vibration: dict[str, Vibration]
    battery: Battery | None
    lacks: tuple[str, ...]


def health_of(flight: Flight, audit: Audit) -> Health:
    """Vibration and battery of the flight in the air. Pure."""
    air = audit.airborne or (audit.span,)
    lacks: list[str] = []
    vibration: dict[str, Vibration] = {}
    if "imu" not in flight:
        lacks.append("no vibration: no imu stream")
    else:
        spans = intersect_spans(air, audit.clean_for(["imu"]))
        for name, columns in SENSORS.items():
            if all(c in flight["imu"] for c in columns):
                found = vibration_of(flight, audit, columns, spans)
                if isinstance(found, str):
                    lacks.append(f"no vibration of the {name}: {found}")
                else:
                    vibration[name] = found
    battery = battery_of(flight, audit, air)
    if battery is None:
        lacks.append("no battery voltage in the air")
    return Health(vibration, battery, tuple(lacks))


def sentence_of(health: dict[str, Any]) -> str:
    """The entry ``health`` of audit.json in one line; empty without anything to report."""
    parts = []
    for name, v in health["vibration"].items():
        line = f", strongest at {v['peak_hz']:.0f} Hz" if v["peak_hz"] is not None else ""
        clipped = f", clipped in {v['clipped_rows']} rows" if v["clipped_rows"] else ""
        parts.append(f"{name} vibrates by {v['rms']:.3g} {v['unit']} RMS up to {v['up_to_hz']:.0f} Hz{line}{clipped}")
    b = health["battery"]
    if b is not None:
        sag = f", sags by {b['sag_V']:.2f} V" if b["sag_V"] is not None else ""
        ohm = f", {1e3 * b['resistance_ohm']['value']:.0f} mOhm" if b["resistance_ohm"] is not None else ""
        parts.append(f"battery {b['start_V']:.2f} to {b['end_V']:.2f} V{sag}{ohm}")
    return "; ".join(parts)
