"""Check a built site: every link, picture, script and style leads to a file and an anchor that exist, or to the web.

``python -m tools.docs_site.check_links SITE`` prints what is broken. Files that a page loads from the web are errors,
too: the site works offline.
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADED = {("script", "src"), ("img", "src"), ("link", "href"), ("source", "src"), ("iframe", "src")}
EXTERNAL = ("http://", "https://", "//")


class Page(HTMLParser):
    """Links, loaded files and anchors of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors: set[str] = set()
        self.without_text = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.anchors.update(value for key in ("id", "name") if (value := found.get(key)))
        if tag == "img" and not found.get("alt"):
            self.without_text += 1
        for name, value in attrs:
            if value and (tag, name) in LOADED and found.get("rel") != "canonical":
                self.loaded.append(value)
            elif value and tag == "a" and name == "href":
                self.links.append(value)


def problems(site: Path) -> list[str]:
    """Return one line for every broken link, file from the web and picture without alternative text."""
    pages = {}
    for path in sorted(site.rglob("*.html")):
        pages[path] = Page()
        pages[path].feed(path.read_text(encoding="utf-8"))
    found = []
    for path, page in pages.items():
        name = path.relative_to(site)
        if page.without_text:
            found.append(f"{name}: {page.without_text} pictures without alternative text")
        found += [f"{name}: loads {link} from the web" for link in page.loaded if link.startswith(EXTERNAL)]
        for link in (*page.links, *page.loaded):
            parts = urlsplit(link)
            if parts.scheme or link.startswith(EXTERNAL) or path.name == "404.html":
                continue
            target = path if not parts.path else (path.parent / unquote(parts.path)).resolve()
            if target.is_dir():
                target /= "index.html"
            if not target.exists():
                found.append(f"{name}: {link} leads nowhere")
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors \
                    and parts.fragment not in ("__skip", "__search", "__drawer"):
                found.append(f"{name}: {link} has no such anchor")
    return found


def main() -> int:
    site = Path(sys.argv[1]).resolve()
    found = problems(site)
    print("\n".join(found) or f"{sum(1 for _ in site.rglob('*.html'))} pages: every link leads somewhere")
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main())
