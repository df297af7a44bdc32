"""The audit of a recording: its faults, its verdict, and which of it is usable."""

from ..lookup.deprecation import renamed

__getattr__ = renamed(__name__, {
    "CUTTING_KINDS": "nanobench_tools.auditing.faults.kinds:cutting()",
    **{name: f"nanobench_tools.auditing.recording_audit:{name}"
       for name in ("Audit", "audit", "find_copies", "with_copies")}})
