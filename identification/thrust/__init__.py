"""Thrust of a motor from PWM and battery voltage: maps fitted to stand series or to flights, one chosen, taken away.

    model = ThrustModel().fit(["stand/"])      # files, folders, or recordings already read
    model.predict(0.7, 3.6)                    # N per motor
    model.inverse(0.1, 3.6).pwm                # PWM ratio, with the limit the battery sets
    print(model.summary(), model.export().toml())
"""

from .inverse import Inverse
from .thrust_model import ThrustModel

__all__ = ["Inverse", "ThrustModel"]
