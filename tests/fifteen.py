"""The real recordings that ``make test`` reads, and the eight of them that it audits; ``make test-slow`` takes all."""

STOPPED = {  # time of the last packet, s
    "B2_circle_medium_rep1": 25.0,
    "B2_circle_medium_rep3": 31.3,
    "B5_helix_medium_rep2": 41.0,
    "B6_linear_ramp_rep4": 23.1,
    "B9_trefoil_fast_rep2": 12.5,
    "B9_trefoil_fast_rep3": 19.6,
    "B9_trefoil_fast_rep5": 19.2,
    "B9_trefoil_medium_rep5": 38.0,
    "B9_trefoil_medium_rep15": 34.4,
}
FIFTEEN = (
    *STOPPED,
    "B2_circle_fast_rep1",
    "B5_helix_rep1",
    "B6_linear_ramp_rep3",
    "B7_oval_slow_rep1",
    "B8_star_fast_rep3",
    "B9_trefoil_medium_rep3",
)
EIGHT = (
    "B2_circle_medium_rep1",
    "B9_trefoil_fast_rep2",
    "B9_trefoil_fast_rep5",
    "B2_circle_fast_rep1",
    "B6_linear_ramp_rep3",
    "B7_oval_slow_rep1",
    "B8_star_fast_rep3",
    "B9_trefoil_medium_rep3",
)
