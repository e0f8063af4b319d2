"""Content of a report, independent of its format: headings, paragraphs, tables, pictures, code, links."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..statistics import Rate


@dataclass(frozen=True, slots=True)
class Heading:
    """A title; level 1 is the report's own."""

    level: int
    text: str


@dataclass(frozen=True, slots=True)
class Paragraph:
    """A text, which may quote untrusted words."""

    text: str


@dataclass(frozen=True, slots=True)
class Bullets:
    """A list of short texts."""

    items: list[str]


@dataclass(frozen=True, slots=True)
class Code:
    """Lines to copy."""

    text: str


@dataclass(frozen=True, slots=True)
class Link:
    """A word linked to a file of the report's folder.

    Attributes:
        text: the displayed word.
        file: path relative to the report, of letters, digits, `-_./` and `%` only; see `untrusted_text.link_to`.
    """

    text: str
    file: str


Entry = str | Rate | Link
"""Entry of a table."""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows below a head.

    Attributes:
        head: names of the columns.
        rows: one entry per column; a rate is shown with its interval.
        words: number of leading columns that hold words; the others hold numbers.
        title: "", or the title of a table that is collapsed because of its length.
    """

    head: list[str]
    rows: list[list[Entry]]
    words: int = 1
    title: str = ""


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure.

    Attributes:
        file: its PNG, relative to the report; a PDF lies beside it.
        image: the figure as bytes, for embedding in a page.
        text: description of the figure.
        kind: image subtype by MIME, like "svg+xml".
    """

    file: str
    image: bytes
    text: str
    kind: str = "svg+xml"


@dataclass(frozen=True, slots=True)
class Pictures:
    """Figures with a common caption."""

    pictures: list[Picture]
    caption: str


Block = Heading | Paragraph | Bullets | Code | Table | Pictures
"""Part of a report."""


@dataclass(slots=True)
class Document:
    """A report: title and blocks."""

    title: str
    blocks: list[Block] = field(default_factory=list)


def rate_words(rate: Rate) -> str:
    """Return share and interval of a rate in words; a dash without episodes."""
    return f"{rate.share:.2f} [{rate.low:.2f}, {rate.high:.2f}]" if rate.episodes else "–"
