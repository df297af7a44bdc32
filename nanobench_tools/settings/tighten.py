"""``python -m nanobench_tools.settings.tighten``: lowers ``unexplained.toml`` to what there is; it never raises it."""

from __future__ import annotations

from . import FOLDER
from .literals import allowed, by_module, unexplained

HEAD = """# Numbers of each module that nothing explains: neither plain, nor a setting, nor declared in origins.toml.
# They may only fall: python -m nanobench_tools.settings.tighten
"""


def main() -> None:
    """Writes the file and says how many are left."""
    now, before = by_module(unexplained()), allowed()
    kept = {module: min(n, before[module]) for module, n in now.items() if module in before}
    lines = [f'"{module}" = {n}\n' for module, n in kept.items()]
    (FOLDER / "unexplained.toml").write_text(HEAD + "".join(lines), encoding="utf-8")
    left = sum(kept.values())
    print(f"{left} numbers in {len(kept)} modules, {sum(before.values()) - left} fewer")
    for module in sorted(set(now) - set(before)):
        print(f"not allowed: {now[module]} in {module}")


if __name__ == "__main__":
    main()
