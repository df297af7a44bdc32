"""The vehicle's own code in compiled float32: PID cascade, Mellinger and Lee controllers, mixer, motors, Kalman filter.

Source: crazyflie-firmware 2025.12.1 (commit 252b413), default Crazyflie 2.x build; every function names its file there.
Scalar code of one vehicle (``*_step``) that other compiled code can call. ``advance`` and ``replay`` work over
batches. Each equation is written here once: practice flights and the rows of Task 2 fly behind the same functions.
"""
