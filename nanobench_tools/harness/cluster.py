"""Items on a cluster: a Dask scheduler hands them to workers anywhere; values come back and are stored here.

Workers need the same packages and see the input files under the same paths.
"""

import gc
import logging
import socket
from typing import Any
from urllib.parse import urlsplit

from ..errors import MissingExtraError, UsageError
from .items import Item, Outcome, Results, execute
from .store import Store
from .threads import one_thread

CONNECT_S = 5.0
"""How long an address may stay silent before it is called wrong."""


def run_on_cluster(pending: list[Item], store: Store | None, address: str) -> Results:
    """Yields (item, outcome) as they come. An item whose worker is lost is given to another by the scheduler."""
    try:
        from distributed import as_completed
    except ImportError as error:
        raise MissingExtraError("distributed", "cluster") from error
    client = _connect(address)
    try:
        futures = {client.submit(_execute, item, key=f"nanobench-{item.key}", pure=False): item
                   for item in pending}
        for future in as_completed(futures):  # type: ignore[no-untyped-call]
            item = futures[future]
            try:
                outcome: Outcome = future.result()
            except Exception as error:  # lost with its workers, or not to be sent
                outcome = Outcome(error=" ".join(f"{type(error).__name__}: {error}".split()))
            if store is not None and outcome.value is not None:
                store.put(item.key, outcome.value, item.label)
            future.release()
            yield item, outcome
    finally:
        client.close(timeout=CONNECT_S)


def _execute(item: Item) -> Outcome:
    """One item on a worker. A worker may have several threads, so its limit is set once and never lifted."""
    one_thread()
    return execute(item, None)


def _connect(address: str) -> Any:
    """A client of the scheduler at ``address``; UsageError on one line within ``CONNECT_S`` when nobody answers."""
    from distributed import Client

    try:
        found = urlsplit(address)
        if found.scheme not in ("tcp", "tls") or not found.hostname or not found.port:
            raise ValueError("an address looks like tcp://HOST:PORT")
        # A client that fails to start can lock up the next one when it is collected: ask the port before
        socket.create_connection((found.hostname, found.port), CONNECT_S).close()
    except (OSError, ValueError) as error:
        raise UsageError(f"--scheduler {address}: no Dask scheduler answers there ({error})") from error
    gc.collect()
    for name in ("distributed", "tornado", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=CONNECT_S)  # type: ignore[no-untyped-call]
    except Exception as error:  # distributed raises OSError, TimeoutError, ValueError or its own
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UsageError(f"--scheduler {address}: no Dask scheduler answers there ({reason})") from error
    return client
