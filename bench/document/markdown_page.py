"""Documents as Markdown."""

from __future__ import annotations

from ..statistics import Rate
from .document import Block, Bullets, Code, Document, Entry, Heading, Link, Paragraph, Pictures, Table, rate_words
from .untrusted_text import markdown_text, plain

LONGEST = 2000
"""Largest number of characters of a paragraph or a line of code."""


def markdown_of(document: Document) -> str:
    """Return the Markdown text of a document."""
    parts = [f"# {markdown_text(document.title)}", *(_block(block) for block in document.blocks)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _block(block: Block) -> str:
    if isinstance(block, Heading):
        return f"{'#' * block.level} {markdown_text(block.text, LONGEST)}"
    if isinstance(block, Paragraph):
        return markdown_text(block.text, LONGEST)
    if isinstance(block, Bullets):
        return "\n".join(f"- {markdown_text(item, LONGEST)}" for item in block.items)
    if isinstance(block, Code):
        lines = [plain(line, LONGEST).replace("`", "'") for line in block.text.splitlines()]
        return "\n".join(["```", *lines, "```"])
    if isinstance(block, Table):
        return _table(block)
    if isinstance(block, Pictures):
        shown = [f"![{markdown_text(picture.text)}]({picture.file})" for picture in block.pictures]
        return "\n".join([*shown, "", f"*{markdown_text(block.caption, LONGEST)}*"])
    raise TypeError(f"a {type(block).__name__} cannot be printed")


def _table(table: Table) -> str:
    marks = ["---" if k < table.words else "---:" for k in range(len(table.head))]
    rows = [[_entry(entry) for entry in row] for row in table.rows]
    lines = [[markdown_text(name) for name in table.head], marks, *rows]
    title = [f"### {markdown_text(table.title)}", ""] if table.title else []
    return "\n".join([*title, *("| " + " | ".join(line) + " |" for line in lines)])


def _entry(entry: Entry) -> str:
    if isinstance(entry, Rate):
        return markdown_text(rate_words(entry))
    if isinstance(entry, Link):
        return f"[{markdown_text(entry.text)}]({entry.file})"
    return markdown_text(entry)
