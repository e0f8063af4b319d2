"""What a report consists of, whatever it is printed as: headings, paragraphs, tables, pictures, code, links."""

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
    """A text of our own words and of others'."""

    text: str


@dataclass(frozen=True, slots=True)
class Bullets:
    """Short texts one below the other."""

    items: list[str]


@dataclass(frozen=True, slots=True)
class Code:
    """Lines to be copied."""

    text: str


@dataclass(frozen=True, slots=True)
class Link:
    """A word that leads to a file of the folder.

    Attributes:
        text: what is shown.
        file: path relative to the report, made of letters, digits, `-_./` and `%` alone; see `escaping.link_to`.
    """

    text: str
    file: str


Entry = str | Rate | Link


@dataclass(frozen=True, slots=True)
class Table:
    """Rows under a head.

    Attributes:
        head: names of the columns.
        rows: as many entries each; a rate is shown with its interval.
        words: how many of the first columns hold words; numbers follow.
        title: "" or what it is called where it is too long to be shown at once.
    """

    head: list[str]
    rows: list[list[Entry]]
    words: int = 1
    title: str = ""


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure.

    Attributes:
        file: its PNG relative to the report; a PDF lies beside it.
        image: the same, to be shown in a page.
        text: what it shows.
        kind: of the image, as MIME calls it.
    """

    file: str
    image: bytes
    text: str
    kind: str = "svg+xml"


@dataclass(frozen=True, slots=True)
class Pictures:
    """Figures that belong together, with one caption."""

    pictures: list[Picture]
    caption: str


Block = Heading | Paragraph | Bullets | Code | Table | Pictures


@dataclass(slots=True)
class Document:
    """A report."""

    title: str
    blocks: list[Block] = field(default_factory=list)


def rate_words(rate: Rate) -> str:
    """Share and interval; a dash without episodes."""
    return f"{rate.share:.2f} [{rate.low:.2f}, {rate.high:.2f}]" if rate.episodes else "–"
