"""A model into other simulators and languages, one file per target, each saying what it cannot express.

    export_model(model, "rotorpy", folder)      -> Exported(files, account)
"""

from collections.abc import Callable
from pathlib import Path

from ...errors import UsageError
from ..model import Model
from .account import Account, Exported
from .code import write_casadi, write_code
from .drone_models import write_drone_models
from .rotorpy_params import write_rotorpy
from .rotors import Assumed
from .urdf import write_urdf

TARGETS: dict[str, Callable[[Model, Path, Assumed | None], Exported]] = {
    "rotorpy": write_rotorpy, "crazyflow": write_drone_models, "urdf": write_urdf, "c": write_code,
    "casadi": write_casadi}
"""Name of a target -> its writer. ``crazyflow`` is also for drone-models, ``urdf`` for gym-pybullet-drones."""

__all__ = ["TARGETS", "Account", "Assumed", "Exported", "export_model"]


def export_model(model: Model, to: str, folder: Path | str, assumed: Assumed | None = None) -> Exported:
    """Writes a model for one target into a folder. Raises UsageError for an unknown target, InputError for a model that
    it cannot take, MissingExtraError where CasADi or tomlkit is needed and absent."""
    if to not in TARGETS:
        raise UsageError(f"no simulator {to!r}; there are {', '.join(TARGETS)}")
    return TARGETS[to](model, Path(folder), assumed)
