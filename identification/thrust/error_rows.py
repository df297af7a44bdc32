"""What the tables and pictures of a thrust result hold: errors of maps on files, and the chosen map drawn."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from nanobench_tools.protocols.sessions import Drawn
from nanobench_tools.results.result import INLINE, OPTIONAL, Result, named


@dataclass(frozen=True, repr=False)
class ErrorRow(Result):
    """One model on the files of one split.

    - ci95: of the RMS by drawing sessions and files, None where ``drawn`` gives the reason.
    - bias; coverage95: share of rows inside the 95 % interval; files_covered90: share of files with nine tenths of
      their rows inside.
    - given: inputs of the predictions; clock, clock_evidence: of flights."""

    model: str
    split: str
    kind: str
    rms_N: float | None
    rms_m_s2: float | None
    n: int
    files: int
    ci95: tuple[float, float] | None
    drawn: Drawn = field(metadata=INLINE)
    bias: float
    coverage95: float | None
    status: str
    uses: str
    given: str
    files_covered90: float | None
    clock: str = field(default="", metadata=OPTIONAL)
    clock_evidence: Sequence[str] | None = field(default=None, metadata=OPTIONAL)

    @property
    def rms(self) -> float:
        """N per motor of stand series, m/s^2 of flights."""
        return _rms(self)


@dataclass(frozen=True, repr=False)
class FileError(Result):
    """One model on one file."""

    file: str
    model: str
    split: str
    rms_N: float | None = field(metadata=OPTIONAL)
    rms_m_s2: float | None = field(metadata=OPTIONAL)
    bias: float
    n: int

    @property
    def rms(self) -> float:
        """N per motor of stand series, m/s^2 of flights."""
        return _rms(self)


@dataclass(frozen=True, repr=False)
class OwnBands(Result):
    """A series without another one of its propeller, each PWM band predicted from the rest. Has the chosen map, its
    RMS, and that of the firmware's closer curve."""

    best: str | None
    rms_N: float | None
    firmware_N: float | None


@dataclass(frozen=True, repr=False)
class ChosenWithout(Result):
    """Fit without one series: the chosen map, its training series, and whether these have its propeller (None:
    unknown)."""

    best: str | None
    fitted_to: tuple[str, ...]
    same_propeller: bool | None
    own_bands: OwnBands | None


@dataclass(frozen=True, repr=False)
class Points(Result):
    """Rows (m,) of a file for plots: PWM ratio (mean of the motors), voltage, measurement and fit. In N per motor of a
    stand series, m/s^2 of a flight."""

    file: str
    split: str
    pwm: np.ndarray
    voltage_V: np.ndarray = field(metadata=named("voltage"))
    measured: np.ndarray
    predicted: np.ndarray


@dataclass(frozen=True, repr=False)
class InverseTable(Result):
    """PWM ratios (voltages, thrusts) of a fitted map, nan where the motor cannot; limit_N: thrust at full PWM."""

    voltage_V: tuple[float, ...]
    thrust_N: tuple[float, ...]
    limit_N: np.ndarray
    pwm: np.ndarray


@dataclass(frozen=True, repr=False)
class AgainstFirmware(Result):
    """RMS on one test file, N per motor or m/s^2.

    Of the chosen map, of the better of the firmware's two published cubics, and of the better one with the inputs of
    the chosen map.

    Those inputs are a scale from the training files, and the carried weight if that map has it. None without such a
    row.
    """

    file: str
    rms: float
    firmware: float
    beaten: bool
    firmware_scaled: float | None
    scaled_beaten: bool | None


def _rms(row: ErrorRow | FileError) -> float:
    found = row.rms_N if row.rms_m_s2 is None else row.rms_m_s2
    assert found is not None  # a row is of stand series or of flights
    return found
