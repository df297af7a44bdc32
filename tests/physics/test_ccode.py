"""Generated C, compiled by the system's compiler and called through ctypes, against NumPy."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest
from physics_cases import draw, models

from nanobench_tools.errors import InputError
from nanobench_tools.physics import numeric
from nanobench_tools.physics.ccode import write_c

COMPILER = shutil.which("gcc") or shutil.which("cc")
DOUBLES = ctypes.POINTER(ctypes.c_double)


def call(library, name, *given, size):
    arrays = [np.ascontiguousarray(g) for g in given]
    out = np.empty(size)
    arguments = (DOUBLES * len(arrays))(*(a.ctypes.data_as(DOUBLES) for a in arrays))
    results = (DOUBLES * 1)(out.ctypes.data_as(DOUBLES))
    work = (ctypes.c_longlong * 4)()
    getattr(library, f"{name}_work")(*(ctypes.byref(work, 8 * i) for i in range(4)))
    memory = np.empty(max(work[3], 1))
    integers = (ctypes.c_longlong * max(work[2], 1))()
    assert getattr(library, name)(arguments, results, integers, memory.ctypes.data_as(DOUBLES), 0) == 0
    return out


@pytest.mark.skipif(COMPILER is None, reason="NO C COMPILER: generated code is not run")
@pytest.mark.parametrize("name", ["all", "all on rpm"])
def test_c_is_equal_to_numpy(name, tmp_path):
    model = models()[name]
    source, header = write_c(model, tmp_path, "plant")
    target = tmp_path / "plant.so"
    subprocess.run([COMPILER, "-O2", "-Wall", "-Werror=implicit-function-declaration", "-shared", "-fPIC", source, "-o",
                    target, "-lm"], check=True, capture_output=True)
    library = ctypes.CDLL(str(target))
    states, inputs = draw(model, 20, 3)
    for function, way in (("plant_derivative", numeric.derivative), ("plant_step", numeric.step)):
        wanted = way(model, states, inputs)
        for x, u, y in zip(states, inputs, wanted, strict=True):
            found = call(library, function, x, u, model.values, size=17)
            assert np.max(np.abs(found - y) / (1 + np.abs(y))) < 1e-12
    text = header.read_text()
    for words in ("x[16] thrust_4 [N]", "u[4] battery_V", "drag_linear.d[2] [N s/m]", "0.01 s", "plant_parameters["):
        assert words in text


@pytest.mark.skipif(COMPILER is None, reason="NO C COMPILER: generated code is not run")
def test_header_can_be_included(tmp_path):
    write_c(models()["all"], tmp_path, "plant")
    (tmp_path / "main.c").write_text('#include "plant.h"\nint main(void) { return plant_parameters[0] > 1.0; }\n')
    subprocess.run([COMPILER, tmp_path / "main.c", tmp_path / "plant.c", "-lm", "-o", tmp_path / "main"], check=True)
    subprocess.run([tmp_path / "main"], check=True)


def test_a_name_c_does_not_take(tmp_path):
    with pytest.raises(InputError, match="letters"):
        write_c(models()["all"], tmp_path, "my model")
