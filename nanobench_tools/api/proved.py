"""``nb.prove``: what a diagnosis is worth, on made-up cases whose truth is sealed until all verdicts are there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..errors import UsageError
from ..steps import diagnosing
from ..steps.blind_proofs import blind_proof, proof_sentence
from ..steps.options import cores
from .quiet_options import given, speaks_python

if TYPE_CHECKING:
    import pandas as pd

    from identification.prove.blind_proof import Proof

ENGINES = ("practice", "rotorpy", "both")


@dataclass(frozen=True, repr=False)
class BlindProof:
    """Score of the diagnosis on blind cases.

    Attributes
    ----------
    proof : Proof
        As in prove.json.
    failed : tuple of dict
        Cases that failed: item, file and error.
    """

    proof: Proof
    failed: tuple[dict[str, str], ...]

    @property
    def sentence(self) -> str:
        """How often the diagnosis was right, and how often it identified a false effect."""
        found = self.proof.summary
        return proof_sentence(found.right, found.cases, found.false_names)

    @property
    def table(self) -> pd.DataFrame:
        """One row per kind of case.

        Columns: cases, numbers and shares (0 to 1) of right verdicts and of false effects, with exact 95 % intervals
        (nan
        without a case).
        """
        import pandas as pd

        rows, nan = [], (float("nan"),) * 2
        for kind, row in self.proof.summary.by_kind.items():
            (low, high), (least, most) = row.ci95 or nan, row.false_names.ci95 or nan
            rows.append((kind, row.n, row.right, row.share, low, high, row.false_names.right, row.false_names.share,
                         least, most))
        return pd.DataFrame(rows, columns=["kind", "cases", "right", "right_share", "right_low", "right_high",
                                           "false_names", "false_share", "false_low", "false_high"]).set_index("kind")

    def __repr__(self) -> str:
        return self.sentence

    def _repr_html_(self) -> str:
        found: str = self.table.to_html()
        return found


@speaks_python
def prove(cases: int = 200, kind: Sequence[str] = (), engine: str = "both", seed: int = 0,
          diagnosed_by: str = "posterior") -> BlindProof:
    """Diagnose SYNTHETIC cases whose truth is sealed until the last verdict, and score the verdicts.

    ``nanobench prove --concealed`` and ``--real`` do the same with recordings.

    Parameters
    ----------
    cases : int
        Number of cases.
    kind : list of str
        null, single, twin, pair, fault, change, foreign; empty: all, in fixed shares.
    engine : str
        The simulator that flies the cases: ``practice``, ``rotorpy`` or ``both``.
    seed : int
        Of everything random. The same seed gives the same result.
    diagnosed_by : str
        ``posterior`` or ``rules``.

    Returns
    -------
    BlindProof
        A row per kind of case, with exact intervals.

    Raises
    ------
    UsageError
        For an unknown kind, engine or method.

    Examples
    --------
    >>> nb.prove(20, seed=3).table  # doctest: +SKIP
    """
    if engine not in ENGINES:
        raise UsageError(f"engine {engine!r} is none of {', '.join(ENGINES)}")
    if diagnosed_by not in diagnosing.ENGINES:
        raise UsageError(f"diagnosed_by={diagnosed_by!r}: give one of {', '.join(diagnosing.ENGINES)}")
    if cases < 1:
        raise UsageError(f"cases={cases}: at least one is needed")
    options = given(jobs=cores(), seed=seed)
    found = blind_proof(options, cases, [kind] if isinstance(kind, str) else kind, engine, diagnosed_by)
    return BlindProof(found, tuple(options.failed))
