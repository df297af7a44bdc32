"""``nb.report``: one page of flights and of the results in a folder."""

from collections.abc import Iterable
from pathlib import Path

from ..flight import Flight
from ..pages.report_page import RESULTS, write_report
from ..results.result_files import read_json
from .audited import audit
from .quiet_options import some, speaks_python


@speaks_python
def report(flights: Flight | Iterable[Flight], out_dir: str | Path = "results") -> Path:
    """Write report.html and its tables (CSV, LaTeX) into a folder.

    The flights are audited. Results that are already in ``out_dir`` are shown, too. Files of ``nanobench run``:
    audit.json, estimate.json, sysid.json, thrust.json and control.json. File of ``nanobench diagnose``: verdict.json.

    Parameters
    ----------
    flights : Flight or iterable of Flight
        As ``nb.load`` gives them.
    out_dir : path
        Folder of the page.

    Returns
    -------
    pathlib.Path
        Of the page.

    Raises
    ------
    InputError
        For an invalid result file.

    Examples
    --------
    >>> import tempfile
    >>> import nanobench_tools as nb
    >>> flights = nb.simulate(2, seed=1, seconds=12.0)
    >>> page = nb.report(flights, tempfile.mkdtemp())
    >>> page.name, "Recordings usable" in page.read_text()
    ('report.html', True)
    """
    found = some(flights)
    folder = Path(out_dir)
    results = {name: read_json(folder / f"{name}.json", name) for name in RESULTS
               if (folder / f"{name}.json").exists()}
    synthetic = any(f.provenance.synthetic for f in found) or any(body.get("synthetic") for body in results.values())
    folder.mkdir(parents=True, exist_ok=True)
    return write_report(folder, results, found, {a.flight.name: a.detail for a in audit(found)}, synthetic)
