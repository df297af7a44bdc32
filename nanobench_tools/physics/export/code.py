"""A model as C without dependencies and as CasADi functions in files: nothing is lost."""

import tempfile
from pathlib import Path

from ...results.result_files import write_bytes
from .. import symbolic
from ..ccode import write_c
from ..model import Model
from .account import Account, Exported
from .rotors import Assumed

NAME = "model"


def write_code(model: Model, folder: Path, assumed: Assumed | None = None) -> Exported:
    """model.c and model.h: ``model_derivative``, ``model_step`` and ``model_parameters``."""
    return Exported(write_c(model, folder, NAME), _all_of(model))


def write_casadi(model: Model, folder: Path, assumed: Assumed | None = None) -> Exported:
    """model_step.casadi and model_derivative.casadi (``casadi.Function.load``), and model.py that loads them."""
    folder = Path(folder)
    functions = symbolic.derivative(model), symbolic.step(model)
    paths = tuple(folder / f"{NAME}_{function.name()}.casadi" for function in functions)
    for path, function in zip(paths, functions, strict=True):
        with tempfile.TemporaryDirectory() as scratch:
            function.save(f"{scratch}/function")
            write_bytes(path, Path(scratch, "function").read_bytes())
    parameters = "".join(f"    {name!r}: {value!r},  # {unit}\n" for name, value, unit in
                         zip(model.names, model.values.tolist(), model.units, strict=True))
    row_s = 1.0 / model.vehicle.rate_hz
    source = f'''"""A model of a vehicle as CasADi functions: derivative(x, u, p), and step(x, u, p) of {row_s:g} s.

World z up, body x forward, y left, z up, quaternion x, y, z, w body to world; SI; x, u and p in the orders below.
{model.vehicle}
"""

from pathlib import Path

import casadi

derivative = casadi.Function.load(str(Path(__file__).with_name("{paths[0].name}")))
step = casadi.Function.load(str(Path(__file__).with_name("{paths[1].name}")))
STATE = {list(model.state)!r}
INPUTS = {list(model.inputs)!r}
PARAMETERS = {{
{parameters}}}
p = casadi.DM(list(PARAMETERS.values()))
'''
    write_bytes(folder / f"{NAME}.py", source.encode())
    return Exported((folder / f"{NAME}.py", *paths), _all_of(model))


def _all_of(model: Model) -> Account:
    return Account(exact={term.name: term.equation for term in model.terms})
