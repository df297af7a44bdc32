"""Items, runner, store, manifest, progress and result files."""

from ..results.result_files import envelope, read_json, write_json
from .identity import item_key, method_identity
from .items import Item, make_item
from .manifest import manifest
from .progress import Progress
from .runner import RunResult, run_items

__all__ = ["Item", "Progress", "RunResult", "envelope", "item_key", "make_item", "manifest", "method_identity",
           "read_json", "run_items", "write_json"]
