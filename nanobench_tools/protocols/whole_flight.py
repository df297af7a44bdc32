"""Task 3, whole flight: poses until take-off and none afterwards; how far off at landing, per metre flown."""

from dataclasses import replace

import numpy as np

from ..auditing.usable import POSE
from ..flight import Flight, Span, make_stream
from ..methods import Estimator
from .result_rows import Scored
from .task3 import WHOLE_FLIGHT, Case, is_logged, score_given

GIVEN = "motion capture poses until take-off, none afterwards, all other streams"
INPUTS = "poses until take-off"


def given_to(case: Case) -> Flight:
    """The flight with the poses before the first airborne row only (columns px py pz qx qy qz qw)."""
    start, end = case.spans[0].start_s, case.spans[-1].end_s
    flight = case.flight.without_streams("mocap").during(Span(-np.inf, end))
    mocap = case.flight["mocap"]
    early = (mocap.time_s < start) & np.isfinite(mocap[POSE]).all(axis=1)
    poses = make_stream("mocap", mocap.time_s[early], mocap[POSE][early], POSE, rate_hz=mocap.rate_hz)
    return replace(flight, streams={"mocap": poses, **flight.streams})


def score(case: Case, method: Estimator) -> Scored:
    """As ``task3.score``, over all airborne and clean rows; drift in % of the path, horizontal and vertical apart."""
    flight = case.flight if is_logged(method) else given_to(case)
    return score_given(case, method, WHOLE_FLIGHT, flight, -np.inf)
