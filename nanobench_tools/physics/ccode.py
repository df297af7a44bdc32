"""A model as C without dependencies: one source file, and a header that says what goes in and comes out."""

import re
import tempfile
from pathlib import Path

from ..errors import InputError
from ..results.result_files import write_bytes
from . import symbolic
from .model import Model
from .ops import import_casadi

RIGID_UNITS = ("m",) * 3 + ("m/s",) * 3 + ("1",) * 4 + ("rad/s",) * 3


def write_c(model: Model, folder: Path | str, name: str = "model", row_hz: float | None = None) -> tuple[Path, Path]:
    """Write NAME.c and NAME.h with ``NAME_derivative`` and ``NAME_step``; returns both paths.

    A step is one row of 1 / row_hz (by default of the model's rate). Raises InputError for a name C does not take.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise InputError("name of the C code", repr(name), "use letters, digits and _, a letter first")
    ca = import_casadi()
    row_hz = row_hz or model.vehicle.rate_hz
    generator = ca.CodeGenerator(f"{name}.c", {"with_header": True})
    for made in (symbolic.derivative(model, row_hz), symbolic.step(model, row_hz)):
        arguments = [made.sx_in(i) for i in range(made.n_in())]
        generator.add(ca.Function(f"{name}_{made.name()}", arguments, made.call(arguments), made.name_in(),
                                  made.name_out()))
    with tempfile.TemporaryDirectory() as scratch:
        generator.generate(f"{scratch}/")
        source, header = ((Path(scratch) / f"{name}.{kind}").read_text() for kind in "ch")
    comment = _comment(model, name, row_hz)
    source_path, header_path = Path(folder) / f"{name}.c", Path(folder) / f"{name}.h"
    write_bytes(source_path, (comment + source).encode())
    write_bytes(header_path, (comment + header + _values(model, name)).encode())
    return source_path, header_path


def _comment(model: Model, name: str, row_hz: float) -> str:
    n = model.rotors
    units = RIGID_UNITS + ("N",) * n
    state = "\n".join(f" *   x[{i}] {key} [{unit}]"
                      for i, (key, unit) in enumerate(zip(model.state, units, strict=True)))
    inputs = "\n".join(f" *   u[{i}] {key}" for i, key in enumerate(model.inputs))
    parameters = "\n".join(f" *   p[{i}] {key} [{unit}]"
                           for i, (key, unit) in enumerate(zip(model.names, model.units, strict=True)))
    row_s = f"{1.0 / row_hz:.9g} s"
    delay = "" if "command_delay" not in model else f"""
 * u[0..{n - 1}] are the commands u[{2 * n + 1}] = floor(delay / row) rows ago, u[{n + 1}..{2 * n}] those one row
 * earlier."""
    return f"""/* {name}_derivative(x, u, p) -> dx/dt and {name}_step(x, u, p) -> x one row of {row_s} later.
 * World frame z up, body x forward, y left, z up, quaternion x, y, z, w body to world; doubles, contiguous:
 *   const double *arg[3] = {{x, u, p}}; double *res[1] = {{out}}; iw and w as {name}_step_work says; returns 0.
{state}
{inputs}{delay}
{parameters}
 * Vehicle: {model.vehicle}
 */
"""


def _values(model: Model, name: str) -> str:
    """The parameter vector, after the declarations of the header."""
    numbers = "".join(f"  {value!r}, /* {key} [{unit}] */\n"
                      for key, unit, value in zip(model.names, model.units, model.values.tolist(), strict=True))
    return f"static const double {name}_parameters[{len(model.names)}] = {{\n{numbers}}};\n"
