"""Goal and duration of a landing by the vehicle's own planner."""

LANDING_M_S, BLIND_M_S, SHORTEST_LANDING_S = 0.35, 0.5, 1.5
"""Mean speed, and without poses."""
SETTLES_S, BELOW_M = 1.2, 0.05
"""Time beyond what the height takes, and a goal below the ground. The vehicle follows its planner half a second late.
Its integrators are at first those of take-off. Without both it touches the ground with 0.5 m/s, bounces by 5 cm, and
falls when the planner ends. Its supervisor may take the bounce for a crash."""


def goal_m(ground_m: float) -> float:
    """Height to command."""
    return ground_m - BELOW_M


def lasts_s(ground_m: float, from_m: float, blind: bool = False) -> float:
    """Duration to command for a landing from a height. ``blind``: the vehicle gets no more poses, and its filter drifts
    from second to second."""
    if blind:
        return max(SHORTEST_LANDING_S, (from_m - ground_m) / BLIND_M_S)
    return max(SHORTEST_LANDING_S, (from_m - ground_m) / LANDING_M_S + SETTLES_S)
