# SPDX-License-Identifier: MIT
"""Do all links of the built pages lead somewhere? ``python docs/_ext/check_pages.py build/docs/html``.

Looks at files only: pages, anchors, pictures, style sheets, programs of the page. Nothing is fetched; a page that
loads something from another host is a mistake, too. Exit code 1: something is missing; each is named.
"""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADED = {"img": "src", "script": "src", "link": "href", "source": "src"}
"""Elements that a browser loads by itself, and where they say from where."""


class Page(HTMLParser):
    """Anchors and links of one page; ``loaded`` are the links that the browser follows by itself."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take an element's id and link."""
        given = dict(attrs)
        self.anchors.update(value for key in ("id", "name") if (value := given.get(key)))
        if tag == "a" and (target := given.get("href")):
            self.links.append(target)
        if (key := LOADED.get(tag)) and (target := given.get(key)):
            self.loaded.append(target)


def problems(folder: Path) -> list[str]:
    """Return what is wrong with the pages below ``folder``, one line each."""
    pages = {path.resolve(): Page(path.read_text(encoding="utf-8")) for path in sorted(folder.rglob("*.html"))}
    found = []
    for path, page in pages.items():
        for target in page.links + page.loaded:
            problem = _problem(path, target, pages, by_itself=target in page.loaded)
            if problem:
                found.append(f"{path.relative_to(folder.resolve())}: {target}: {problem}")
    return found


def _problem(path: Path, target: str, pages: dict[Path, Page], *, by_itself: bool) -> str:
    parts = urlsplit(target)
    if parts.scheme == "data":
        return ""
    if parts.scheme or parts.netloc:
        return "comes from another host" if by_itself else ""
    file = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if not file.is_file():
        return "there is no such file"
    if parts.fragment and file in pages and unquote(parts.fragment) not in pages[file].anchors:
        return "there is no such place on that page"
    return ""


def main() -> int:
    """Check the folder that is named on the command line."""
    folder = Path(sys.argv[1])
    found = problems(folder)
    print("\n".join(found) or f"{folder}: all links of {sum(1 for _ in folder.rglob('*.html'))} pages lead somewhere")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
