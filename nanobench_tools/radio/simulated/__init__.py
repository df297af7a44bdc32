"""A Crazyflie that is not there: the firmware's services over CRTP before any vehicle that steps the firmware's loop.

Source: crazyflie-firmware 2025.12.1 (protocol version 10); every file names the modules it stands for. Nothing here
imports cflib; it is what the tests connect with.
"""
