"""Former place of ``nanobench_tools.auditing.faults.kind``."""

from ..lookup.deprecation import renamed

__getattr__ = renamed(__name__, {name: f"nanobench_tools.auditing.faults.kind:{name}"
                                 for name in ("Blind", "FaultKind", "Injection")})
