"""Commands act later than their stamp."""

from ..term import Parameter, Stage, Term


def delayed(inputs, p, at, ops):
    """The mean over the row of the held input shifted by the delay: exact, and linear in delay_s within a row."""
    share = p.delay_s / at.row_s - at.whole_rows
    return [new + share * (old - new) for new, old in zip(inputs, at.before, strict=True)]


TERM = Term(
    name="command_delay",
    sentence="Every motor command acts a constant time after the stamp it is logged with.",
    equation="u_i <- u_i(t - d)",
    parameters=(Parameter("delay_s", "s", 0.0, 0.2, 0.01, neutral=0.0,
                          source="prototype on NanoBench recordings: 20 ms beside a first-order lag"),),
    acts={Stage.INPUT_DELAY: delayed},
    confused_with={"motor_lag": "steps of the command logged faster than 100 Hz: a delay does nothing at first",
                   "clock_offset": "the audit's clock of the motor stream against the others"},
)
