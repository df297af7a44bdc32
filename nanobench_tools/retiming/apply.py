"""Former place of ``nanobench_tools.time_offsets.moving.apply``."""

from ..lookup.deprecation import renamed

__getattr__ = renamed(__name__, {"retimed": "nanobench_tools.time_offsets.moving.apply:retimed"})
