"""Motors identified against measured rotor speed: lag, speed from PWM and voltage, thrust and torque. Also the value
of a fast log of commands for the prediction of rotation.

    from identification.motors import identify
    found = identify(["flights/"], mass_kg=0.037)
    found.lag.parameters, found.body()["rotation"]
"""

from .motor_study import Study, identify

__all__ = ["Study", "identify"]
