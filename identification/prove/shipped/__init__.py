"""Public simulators that shipped with a wrong parameter, before and after their makers' correction, on real flights.

``cases.toml`` has the facts of each, with its thread. Nothing in a case depends on what a diagnosis finds.
"""

from .shipped_cases import ShippedCase, shipped_cases
from .shipped_run import ShippedJudge, ShippedProof, prove_shipped

__all__ = ["ShippedCase", "ShippedJudge", "ShippedProof", "prove_shipped", "shipped_cases"]
