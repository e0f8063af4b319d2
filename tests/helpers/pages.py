"""HTML pages of reports: what is in them, and how a browser draws them."""

from __future__ import annotations

import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

BROWSERS = ("chromium", "chromium-browser", "chromium-headless-shell", "google-chrome")
BROWSER = next(filter(None, map(shutil.which, BROWSERS)), None)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed: apt install chromium")
TAGS = {
    "html", "head", "meta", "title", "style", "body", "h1", "h2", "h3", "p", "ul", "li", "div", "table", "thead",
    "tbody", "tr", "th", "td", "span", "i", "b", "small", "figure", "figcaption", "img", "a", "pre", "code", "details",
    "summary",
}  # fmt: skip
"""All that a page consists of."""


class Page(HTMLParser):
    """All tags with their attributes, and the text; of a table's entry the whole of it."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.words, self._entry = [], [], None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag in ("td", "th"):
            self._entry = []

    def handle_endtag(self, tag):
        if tag in ("td", "th"):
            self.words.append("".join(self._entry))
            self._entry = None

    def handle_data(self, data):
        (self.words if self._entry is None else self._entry).append(data)


def needs_nothing_else(page: Page, folder: Path, kind: str = "svg+xml") -> bool:
    """Nothing in it runs, its pictures are in it, and the files that it leads to are there."""
    assert {tag for tag, _ in page.tags} <= TAGS
    policy = next(each["content"] for tag, each in page.tags if each.get("http-equiv"))
    assert "default-src 'none'" in policy
    begins = f"data:image/{kind};base64,"
    for _, attributes in page.tags:
        assert not any(name.startswith("on") for name in attributes)
        assert attributes.get("src", begins).startswith(begins)
        if "href" in attributes:
            assert (folder / attributes["href"]).is_file()
    return True


def same_numbers(page: Page, text: str) -> bool:
    """Every entry of the tables of a Markdown text is in the page."""
    words, tables = set(page.words), 0
    for line in text.splitlines():
        if line.startswith("| ") and "---" not in line:
            tables += 1
            for cell in line.replace("\\|", "/").strip("| ").split(" | "):
                assert cell.replace("\\", "") in words, cell
    return tables > 0


def browse(page: Path, profile: Path, *options):
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}", *options]
    return subprocess.run([*command, page.as_uri()], capture_output=True, text=True, timeout=120)


def screenshot(page: Path, folder: Path, width: int, height: int) -> np.ndarray:
    """Pixels (height, width, 3) of the top of a page."""
    from PIL import Image

    picture = folder / "page.png"
    size = f"--window-size={width},{height}"
    browse(page, folder / "profile", size, f"--screenshot={picture}", "--hide-scrollbars")
    return np.asarray(Image.open(picture).convert("RGB")).astype(int)
