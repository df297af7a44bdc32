"""What the correcting network sees of a window, in body axes, and how that looks to a vehicle turned or mirrored.

A quadrotor looks the same after a quarter turn about z and in a mirror, if its inputs are given as moments and a sum.
``Kinds`` has the kind of every feature: component of a moving vector (velocity, force), of a turning one (rate,
moment), or a scalar. Training can thus show every window in all eight positions.
"""

from dataclasses import dataclass

import numpy as np

from identification.greybox.balance_features import BEFORE, MIX, VOLTS
from nanobench_tools import so3
from nanobench_tools.methods import Prediction, Windows
from nanobench_tools.settings import number
from nanobench_tools.units import GRAVITY_M_S2

UP = np.array([0.0, 0.0, 1.0])
POSITIONS = 8
"""Four quarter turns, each also in a mirror."""
BACK = 50
"""Rows before the start that class ``past`` looks at."""
HOVER = number("learned.features.hover")


@dataclass(frozen=True)
class Seen:
    """Features of windows.

    - context (n, C): at the start and before.
    - steps (n, H, S): along the window.
    - thrust (n, H, 3) m/s^2: specific force along the predicted path, body.
    - kinds: of the columns of both, a letter for every column or triple. ``m``: moving vector, ``t``: turning vector,
      ``s``: scalar."""

    context: np.ndarray
    steps: np.ndarray
    thrust: np.ndarray
    kinds: tuple[str, str]


def seen(windows: Windows, predicted: Prediction, past: bool = False) -> Seen:
    """Features of n windows. ``past``: of all streams before the start, too; else inputs before it and the start."""
    volts = windows.motor * windows.battery_V[..., None]
    before = volts[:, :1] if windows.motor_past is None or windows.battery_past is None else (
        windows.motor_past * windows.battery_past[..., None])
    turned = so3.conjugate(windows.quaternion)
    columns, kinds = [], []

    def add(values: np.ndarray, kind: str) -> None:
        columns.append(values)
        kinds.append(kind)

    for mean in _binned(before @ MIX.T):
        add(mean[:, :3], "t")
        add(mean[:, 3:] - 4.0 * VOLTS * HOVER, "s")
    add(so3.rotate(turned, windows.velocity_m_s), "m")
    add(windows.rate_rad_s, "t")
    add(so3.rotate(turned, UP) - UP, "m")
    add(windows.battery_V[:, :1] - VOLTS, "s")
    if past and windows.past is not None:
        old = windows.past
        axes = turned[:, None]
        force = np.nan_to_num(old.specific_force_m_s2[:, -BACK:] - GRAVITY_M_S2 * UP)
        for rate, felt, moved in zip(_binned(old.rate_rad_s[:, -BACK:]), _binned(force),
                                     _binned(so3.rotate(axes, old.velocity_m_s[:, -BACK:])), strict=True):
            add(rate, "t")
            add(felt, "m")
            add(moved, "m")
    start = (windows.quaternion, windows.velocity_m_s, windows.rate_rad_s)
    attitude, speed, rate = (np.concatenate([first[:, None], path[:, :-1]], axis=1) for first, path in zip(
        start, (predicted.quaternion, predicted.velocity_m_s, predicted.rate_rad_s), strict=True))
    gained = (predicted.velocity_m_s - speed) * windows.rate_hz + GRAVITY_M_S2 * UP
    steps = np.concatenate([volts @ MIX.T - [0.0, 0.0, 0.0, 4.0 * VOLTS * HOVER],
                            so3.rotate_inverse(attitude, speed), rate, so3.rotate_inverse(attitude, UP) - UP], axis=2)
    return Seen(np.concatenate(columns, axis=1), steps, so3.rotate_inverse(attitude, gained),
                ("".join(kinds), "tsmtm"))


def _binned(rows: np.ndarray) -> list[np.ndarray]:
    """Means (n, k) of rows (n, P, k) over BEFORE, the newest first."""
    length = rows.shape[1]
    return [rows[:, max(length - high, 0):max(length - low, 1)].mean(axis=1) for low, high in BEFORE]


def position_matrices(kinds: str) -> np.ndarray:
    """(POSITIONS, F, F): how features of these kinds look to the vehicle turned k quarter turns, then mirrored.

    >>> (position_matrices("ms")[1] @ [1.0, 0.0, 5.0, 7.0]).tolist()
    [0.0, 1.0, 5.0, 7.0]
    """
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    mirror = {"m": np.diag([1.0, -1.0, 1.0]), "t": np.diag([-1.0, 1.0, -1.0])}
    found = []
    for position in range(POSITIONS):
        blocks = []
        for kind in kinds:
            block = np.eye(1)
            if kind != "s":
                block = np.linalg.matrix_power(turn, position % 4)
                block = mirror[kind] @ block if position >= 4 else block
            blocks.append(block)
        size = sum(len(block) for block in blocks)
        matrix, at = np.zeros((size, size)), 0
        for block in blocks:
            matrix[at:at + len(block), at:at + len(block)] = block
            at += len(block)
        found.append(matrix)
    return np.array(found)
