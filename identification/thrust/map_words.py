"""Names of thrust maps in words, for screens and pages; files and Python keep the names."""

from .flight_fit import BALANCED, SUFFIX

WORDS = {"weight": "always the weight", "firmware_2_1_plus": "firmware, 2.1+ propellers",
         "firmware_legacy": "firmware, older propellers", "scaled_2_1_plus": "firmware 2.1+, scaled",
         "scaled_legacy": "firmware older, scaled", "thrust_pwm": "command alone",
         "thrust_voltage": "command times voltage", "power_law": "power law", "dc_motor": "DC motor",
         "switched_motor": "motor with switching drop", "pwm_voltage": "polynomial"}
KINDS = {BALANCED: ", balanced", SUFFIX: ", with inflow and warm motors"}


def in_words(name: str) -> str:
    """A map by its name, which may have what was added to it behind.

    >>> in_words("switched_motor_balanced, true level")
    'motor with switching drop, balanced, true level'
    """
    map_name, comma, level = name.partition(",")
    kind = next((k for k in KINDS if map_name.endswith(k)), "")
    base = map_name.removesuffix(kind)
    return WORDS.get(base, base.replace("_", " ")) + KINDS.get(kind, "") + comma + level
