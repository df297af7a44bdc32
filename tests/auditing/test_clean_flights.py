"""What a clean flight is told: nothing but its true end, what flew, when it was in the air, how often packets came."""

import numpy as np

from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.practice import PERFECT, LoggingChain


def test_no_false_alarms(audited_flights):
    """The straight line that the chain appends is a fault and must be found where it was put; nothing else may be."""
    for flight, result in audited_flights:
        stopped = flight.span.end_s - flight.metadata["practice"]["tail_s"]
        for fault in result.faults:
            if fault.kind == "dead_stream":
                assert abs(fault.start_s - stopped) < (1.2 if fault.stream == "battery" else 0.15), fault
            else:
                assert fault.kind == "interpolated", fault


def test_controller_air_and_rates(audited_flights):
    assert {flight.metadata["practice"]["controller"] for flight, _ in audited_flights} == {"pid", "mellinger"}
    for flight, result in audited_flights:
        assert result.controller == flight.metadata["practice"]["controller"]
        (air,) = result.airborne
        mocap = flight["mocap"]
        z = mocap["pz"] - np.median(mocap["pz"][:50])
        assert z[mocap.time_s < air.start_s - 0.02].max() < 0.051
        assert z[(mocap.time_s > air.start_s + 1.5) & (mocap.time_s < air.end_s - 3.0)].min() > 0.05
        for name, rate in result.rates.items():
            assert rate.samples == flight[name].samples
            lived = flight.span.end_s - (0.0 if name == "mocap" else flight.metadata["practice"]["tail_s"])
            assert rate.rate_hz == np.clip(rate.rate_hz, 0.97 * rate.samples / lived, 1.05 * rate.samples / lived)


def test_estimated_counts_are_near_the_true_ones(flights):
    from dataclasses import replace

    flight = flights[0]
    blind = flight.with_streams(**{name: replace(s, samples=None) for name, s in flight.streams.items()})
    rates = audit(blind).rates
    for name in ("imu", "estimator", "attitude"):
        assert abs(rates[name].samples / flight[name].samples - 1.0) < 0.05


def test_a_perfect_recording_has_no_dead_end(recorded):
    assert [f for f in audit(recorded(PERFECT)).faults if f.kind != "interpolated"] == []


def test_logs_that_reach_the_end_are_not_dead(recorded):
    assert not [f for f in audit(recorded(LoggingChain(tail_s=(0.0, 0.0)))).faults if f.kind != "interpolated"]
