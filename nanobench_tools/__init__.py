"""The ground of nanobench: recordings in, faults found, metrics, protocols, harness, report."""

from .errors import InputError, MissingExtraError, NanobenchError, UsageError
from .flight import Fault, Flight, Provenance, Span, Stream, make_stream
from .methods import Controller, Estimate, Estimator, Prediction, Predictor, Windows
from .version import __version__

__all__ = ["Controller", "Estimate", "Estimator", "Fault", "Flight", "InputError", "MissingExtraError",
           "NanobenchError", "Prediction", "Predictor", "Provenance", "Span", "Stream", "UsageError", "Windows",
           "__version__", "make_stream"]
