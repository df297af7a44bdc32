"""Names of methods as people write them, for screens and pages; results keep the names."""

PEOPLE = {"pid": "PID", "mellinger": "Mellinger", "onboard_ekf": "onboard EKF", "naive": "standing still",
          "published_physics": "published physics",
          "published_physics_ratio2": "published physics, parameters as released"}
FITS = {"fit_observed": "all terms, from all streams before", "fit_balanced": "all terms, from the inputs before",
        "fit_thrust_pwm": "thrust from PWM alone", "fit_thrust_voltage": "thrust from PWM and voltage",
        "fit_lag": "thrust and motor lag", "fit_drag": "thrust, lag and drag",
        "fit_torque": "thrust, lag, drag and moments",
        "fit_full": "all terms", "fit_vehicle": "a physical vehicle, which is exported"}
"""Models that ``nanobench sysid`` fits, which no option names."""


def person(name: object) -> str:
    """A method as people write it; its own name where it has no other."""
    return PEOPLE.get(str(name)) or fit_in_words(name)


def fit_in_words(name: object) -> str:
    """A fitted model in words; other methods by the name that an option takes.

    >>> fit_in_words("fit_balanced"), fit_in_words("naive")
    ('all terms, from the inputs before', 'naive')
    """
    return FITS.get(str(name), str(name))


def quoted(words: str) -> str:
    """In quotes where it is of several words."""
    return f'"{words}"' if " " in words else words
