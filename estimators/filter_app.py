"""``drag_matrix_ekf`` as C: a folder that builds within the Crazyflie firmware's tree as its out-of-tree estimator.

The files of ``firmware_filter`` are copied; ``filter_settings.h`` is written from the settings of the method.
"""

from collections.abc import Mapping
from pathlib import Path

from nanobench_tools.firmware.app_files import Operations, constant, header, write_folder

from . import inertial_core as core
from .drag_ekf import DragMatrixEkf

TARGET = "firmware-filter"
UNUSED = ("drawn",)
"""Settings of recordings alone: on board no packet is missing."""
RECORDED = {**core.SETTINGS, **DragMatrixEkf.settings, "late_moves": 0.0}
"""As searched on recordings; the state is wanted on the time of the IMU."""
SETTINGS = {**RECORDED, "late_sd": 0.0, "wander_sd": 0.0}
"""On board, rows and poses have one clock. In ten minutes of circles, an estimated delay drifts by tens of
milliseconds."""
UNITS = "SI; noise per root Hz, walks per root s"
_ERRORS = core.ERROR
_TRANSITION = _ERRORS * 60
"""Of half a covariance propagation: 60 a column, counted in ``transition`` of drag_filter.c."""


def _scalar(entries: int) -> Operations:
    """One scalar measurement with so many entries of h."""
    return Operations(_ERRORS * (entries + 2) + 4 * _ERRORS * (_ERRORS + 1) // 2, _ERRORS)


def costs() -> dict[str, Operations]:
    """Of a row of the IMU in flight, and of a pose in addition, by the loops of drag_filter.c."""
    drag, place, tilt = _scalar(8), _scalar(4), _scalar(4)
    row = Operations(2 * _TRANSITION + 400 + 2 * drag.multiply_adds, 30 + 2 * drag.divisions, 8)
    pose = Operations(3 * (place.multiply_adds + tilt.multiply_adds) + 12 * 10 + 16 * 10,
                      3 * (place.divisions + tilt.divisions) + 10, 2)
    return {"row of the IMU": row, "pose": pose}


def write_filter(folder: Path | str, settings: Mapping[str, float] = SETTINGS) -> tuple[Path, ...]:
    """Writes the folder with ``settings`` of the core; returns its files."""
    body = "".join(constant(name.upper(), value, UNITS) for name, value in settings.items() if name not in UNUSED)
    table = "\n".join(f"| {name} | {c.multiply_adds} | {c.cycles} | {c.milliseconds:.2f} |"
                      for name, c in costs().items())
    text = header("FILTER_SETTINGS_H", "Settings of drag_matrix_ekf; estimators/inertial_core.py has what each is.",
                  TARGET, body)
    return write_folder("estimators", "firmware_filter", Path(folder), {"src/filter_settings.h": text},
                        {"table": table})
