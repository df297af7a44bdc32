"""What others import from this package must not pull in the readers."""

from __future__ import annotations

import subprocess
import sys

import pytest

from nanobench_tools import sources


def test_small_modules_do_not_load_pyarrow():
    code = ("import sys; from nanobench_tools.sources import interpolation, nanobench_columns; "
            "print('pyarrow' in sys.modules)")
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
        == "False"
    )


def test_public_names():
    assert all(callable(getattr(sources, name)) for name in sources.__all__)
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = sources.no_such_name
