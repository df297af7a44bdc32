"""Units as tables write them -> as column maps do (``units.SI_FACTOR``)."""

from __future__ import annotations

import re

WRITTEN: dict[str, tuple[str, ...]] = {
    "m": ("m", "meter", "meters", "metre", "metres"),
    "mm": ("mm", "millimeter", "millimeters", "millimetre", "millimetres"),
    "cm": ("cm", "centimeter", "centimeters", "centimetre", "centimetres"),
    "in": ("in", "inch", "inches"),
    "ft": ("ft", "foot", "feet"),
    "m/s": ("m/s", "mps", "ms-1", "m_s", "m_per_s", "meters/second"),
    "mm/s": ("mm/s", "mms-1", "mm_s"),
    "cm/s": ("cm/s", "cms-1", "cm_s"),
    "in/s": ("in/s", "inch/s", "inches/second"),
    "ft/s": ("ft/s", "fps", "feet/second"),
    "km/h": ("km/h", "kmh", "kph", "kmh-1"),
    "mph": ("mph", "mi/h", "miles/hour"),
    "m/s^2": ("m/s2", "m/s/s", "ms-2", "m_s2", "mps2", "m_per_s2"),
    "mm/s^2": ("mm/s2", "mms-2", "mm_s2"),
    "g": ("g", "g0", "gee", "gs", "g-force"),
    "mg": ("mg", "milli-g"),
    "rad": ("rad", "radian", "radians"),
    "deg": ("deg", "degree", "degrees", "°"),
    "mrad": ("mrad",),
    "rad/s": ("rad/s", "rads-1", "rad_s", "rad/sec", "radps", "rps_rad", "radians/second"),
    "deg/s": ("deg/s", "degs-1", "deg_s", "deg/sec", "dps", "°/s", "degps", "degrees/second"),
    "mdeg/s": ("mdeg/s", "mdegs-1", "mdeg_s", "mdps", "millidegrees/second"),
    "mrad/s": ("mrad/s", "mrads-1", "mrad_s"),
    "rpm": ("rpm", "rev/min", "r/min", "min-1", "1/min"),
    "V": ("v", "volt", "volts"),
    "mV": ("mv", "millivolt", "millivolts"),
    "A": ("a", "amp", "amps", "ampere"),
    "mA": ("ma", "milliamp"),
    "N": ("n", "newton", "newtons"),
    "mN": ("mn", "millinewton", "millinewtons"),
    "gram_force": ("gf", "gram_force", "gramforce", "grams", "gram", "gr", "gram-force"),
    "kgf": ("kgf", "kg", "kg_force", "kilogram_force", "kilograms", "kg-force"),
    "lbf": ("lbf", "lb", "lbs", "pound-force"),
    "s": ("s", "sec", "secs", "second", "seconds"),
    "min": ("min", "mins", "minute", "minutes"),
    "h": ("h", "hr", "hour", "hours"),
    "ms": ("ms", "msec", "millisecond", "milliseconds"),
    "us": ("us", "usec", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nanosecond", "nanoseconds"),
    "%": ("%", "percent", "pct", "per cent", "prozent"),
    "pwm16": ("pwm16", "uint16", "counts16"),
    "dshot": ("dshot",),
    "1": ("1", "-", "ratio", "normalized", "normalised", "unitless", "dimensionless"),
}
"""Unit of a map -> its spellings: lower case, micro as ``u``, without ``^`` and blanks."""
_OF = {spelling: unit for unit, spellings in WRITTEN.items() for spelling in spellings}


def unit_as_written(text: str) -> str | None:
    """``m s^-1`` -> ``m/s``, ``µs`` -> ``us``; None for text that is no known unit.

    >>> unit_as_written("rad s^-1"), unit_as_written("°/s"), unit_as_written("name")
    ('rad/s', 'deg/s', None)
    """
    plain = text.strip().lower().replace("µ", "u").replace("μ", "u").replace("²", "2").replace("⁻", "-")
    plain = plain.replace("¹", "1").replace("**", "").replace("^", "").replace("·", "").replace("*", "")
    plain = re.sub(r"[\s{}()]", "", plain)
    return _OF.get(plain)
