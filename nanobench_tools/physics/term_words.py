"""Terms of the equations of motion in words, for screens and reports; files keep the names."""

WORDS = {"com_offset": "centre of mass", "drag_linear": "linear drag", "drag_quadratic": "quadratic drag",
         "drag_rotor": "rotor drag", "drag_torque": "moment of drag", "force_world": "constant force",
         "frame_tilt": "tilt of the tracked body", "motor_imbalance": "unequal motors",
         "rotor_gyro": "gyroscopic moment of the rotors", "rotor_reaction": "reaction of the rotors",
         "thrust_pwm": "thrust by command", "thrust_rpm": "thrust by rotor speed",
         "thrust_voltage": "thrust by battery voltage"}
"""Terms whose names are not words."""


def in_words(term: str) -> str:
    """``linear drag`` of ``drag_linear``."""
    return WORDS.get(term, term.replace("_", " "))
