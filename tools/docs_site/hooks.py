"""MkDocs hooks: pages written from the code, and the pages of the project's root with their links turned round."""

import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))  # MkDocs loads this file by its path

PROJECT = {"ARCHITECTURE.md": "project/architecture.md", "CONTRIBUTING.md": "project/contributing.md",
           "CHANGELOG.md": "project/changelog.md"}
"""Page of the root -> its place in the site."""
_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)#]+)(#[^)]*)?\)")


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages and those of the root."""
    from tools.docs_site.generated import PAGES

    for name, write in PAGES.items():
        files.append(File.generated(config, name, content=write()))
    for name, place in PROJECT.items():
        files.append(File.generated(config, place, content=from_root((ROOT / name).read_text(encoding="utf-8"))))
    return files


def from_root(text: str) -> str:
    """Return a page of the root with links for its place in the site; links to source files become their names."""
    def turned(match: re.Match[str]) -> str:
        label, target, anchor = match[1], match[2], match[3] or ""
        if target.startswith("docs/"):
            return f"[{label}](../{target.removeprefix('docs/')}{anchor})"
        if target in PROJECT:
            return f"[{label}]({Path(PROJECT[target]).name}{anchor})"
        return f"[{label}](../index.md)" if target == "README.md" else match[0] if "://" in target else f"`{target}`"
    return _LINK.sub(turned, text)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Lead links to the README to the first page."""
    return markdown.replace("](../README.md)", "](index.md)")
