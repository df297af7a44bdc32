"""What the vehicle's own filter said in flight, as an estimator among others."""

from nanobench_tools.signals.onboard_estimate import OnboardEkf

__all__ = ["OnboardEkf"]
