"""Cases of Task 3 of one made flight, and estimators made of functions, for tests."""

from made_flights import verdict

from estimators.onboard_ekf import OnboardEkf
from nanobench_tools import Estimate
from nanobench_tools.protocols import task3

EKF = OnboardEkf()


def one_case(flight, *faults, protocol="clean"):
    return task3.select([flight], {flight.name: verdict(flight, *faults)}, protocol)[0]


def table(flights, audits, protocol, method=EKF):
    """Rows by group."""
    cases = task3.select(flights, audits, protocol)
    return {row.group: row for row in task3.tabulate(protocol, method, [
        (case, task3.score(case, method, protocol)) for case in cases])}


class From:
    """What ``make`` of the flight given."""

    name, causal = "mine", False

    def __init__(self, make):
        self.make = make

    def estimate(self, flight):
        return self.make(flight)


def poses(mocap, rows=slice(None), off_m=0.0):
    return Estimate(mocap.time_s[rows], mocap["px", "py", "pz"][rows] + off_m, mocap["qx", "qy", "qz", "qw"][rows])
