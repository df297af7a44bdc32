"""The few functions an equation may use in addition to + - * /, once for NumPy arrays and once for CasADi expressions.

Equations are written over components (each a float, an array (n,) of a batch, or a CasADi scalar). The same function
thus gives numbers and symbols.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..errors import MissingExtraError


class Ops(NamedTuple):
    """``where(condition, a, b)``: a where the condition holds, else b."""

    sqrt: Callable[..., Any]
    exp: Callable[..., Any]
    sin: Callable[..., Any]
    cos: Callable[..., Any]
    fabs: Callable[..., Any]
    fmin: Callable[..., Any]
    fmax: Callable[..., Any]
    where: Callable[..., Any]


NUMPY = Ops(np.sqrt, np.exp, np.sin, np.cos, np.abs, np.minimum, np.maximum, np.where)


def import_casadi() -> Any:
    """The module casadi; raises MissingExtraError when the extra is not installed."""
    try:
        import casadi
    except ImportError:
        raise MissingExtraError("casadi", "identification") from None
    return casadi


@functools.cache
def casadi_ops() -> Ops:
    """The same functions for CasADi SX."""
    ca = import_casadi()
    return Ops(ca.sqrt, ca.exp, ca.sin, ca.cos, ca.fabs, ca.fmin, ca.fmax, ca.if_else)
