"""Where poses come from while flying: a simulated motion capture, the package ``motioncapture``, anybody's callable."""

from urllib.parse import urlparse

from ...errors import UsageError
from .mocap_callable import CallableMocap
from .mocap_package import PackageMocap
from .mocap_simulated import SimulatedMocap, address_of
from .pose_source import PoseSource

FORMS = "simulated, simulated://HOST:PORT, TYPE://HOST/BODY of the package motioncapture, or module:callable"


def pose_source(spec: str, uri: str) -> PoseSource:
    """The source that ``--mocap`` names, not yet started. Raises UsageError or MissingExtraError."""
    if spec == "simulated" or spec.startswith("simulated://"):
        return SimulatedMocap(address_of(spec, uri))
    if "://" in spec:
        found = urlparse(spec)
        body = found.path.strip("/")
        if not found.hostname or not body:
            raise UsageError(f"--mocap {spec}: write TYPE://HOST/BODY, such as vicon://192.168.1.5/cf1")
        return PackageMocap(found.scheme, found.netloc, body)
    if ":" in spec:
        return CallableMocap(spec)
    raise UsageError(f"--mocap: unknown source {spec!r}; known: {FORMS}")
