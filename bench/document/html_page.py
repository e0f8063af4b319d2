"""Documents as one self-contained HTML file: no server, no script, no request.

The page is built as a tree, never as text: the standard library's serializer turns untrusted names and errors into
plain text. In addition, a content security policy in the page forbids scripts and requests. Pictures are images, in
which nothing can run.
"""

from __future__ import annotations

import base64
from xml.etree.ElementTree import Element, SubElement, tostring

from ..statistics import Rate
from .document import Block, Bullets, Code, Document, Entry, Heading, Link, Paragraph, Pictures, Table, rate_words
from .untrusted_text import plain

LONGEST = 2000
"""Largest number of characters of a paragraph or a line of code."""
SHORT = 28
"""Largest number of characters of a table entry that is not broken into lines."""
MANY = 9
"""Number of columns above which a table is set narrowly: names and entries are broken into lines."""
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
STYLE = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem 1rem 4rem; max-width: 70rem; color: #222; background: #fff;
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: 0 0 .5rem; }
h2 { font-size: 1.25rem; margin: 2.5rem 0 .5rem; padding-top: .5rem; border-top: 1px solid #ddd; }
h3 { font-size: 1rem; margin: 1.5rem 0 .5rem; }
p, ul { max-width: 48rem; }
.wide { overflow-x: auto; margin: .75rem 0 1rem; }
table { border-collapse: collapse; font-size: .875rem; font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: 600; border-bottom: 1.5px solid #222; vertical-align: bottom; }
th, td { padding: .25rem 1rem .25rem 0; white-space: nowrap; overflow-wrap: normal; }
td { border-bottom: 1px solid #eee; vertical-align: top; }
td small { color: #666; }
.many th, .many td.number { white-space: normal; padding-right: .7rem; }
.many td small { display: block; white-space: nowrap; }
th:first-child, td:first-child { position: sticky; left: 0; background: #fff; z-index: 1; }
td.again { color: #bbb; }
td.long { white-space: normal; min-width: 14rem; max-width: 26rem; overflow-wrap: anywhere; }
.number { text-align: right; }
tr.begins td { border-top: 1px solid #aaa; }
.rate { display: block; position: relative; width: 100%; height: .3rem; background: #eceff2; }
.rate i { position: absolute; top: 0; bottom: 0; left: 0; background: #8fb8d8; }
.rate b { position: absolute; top: 35%; height: 1.5px; background: #222; }
details { margin: .75rem 0; }
summary { cursor: pointer; color: #0060a8; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 20rem), 1fr)); gap: 1rem;
  align-items: start; }
figure { margin: 1rem 0; }
.figures.photos { grid-template-columns: repeat(auto-fit, minmax(min(100%, 30rem), 1fr)); }
.figures img { width: 100%; max-width: 28rem; height: auto; }
.figures img.photo { max-width: 60rem; }
.figures a, .figures span { font-size: .8rem; }
figcaption { color: #555; font-size: .875rem; max-width: 48rem; margin-top: .25rem; }
pre { background: #f5f6f7; padding: .75rem; overflow-x: auto; font-size: .85rem; }
a { color: #0060a8; }
@media print { h2 { break-after: avoid; } figure, tr { break-inside: avoid; } }
"""


def html_of(document: Document) -> str:
    """Return the HTML file of a document."""
    page = Element("html", lang="en")
    head = SubElement(page, "head")
    SubElement(head, "meta", charset="utf-8")
    SubElement(head, "meta", {"http-equiv": "Content-Security-Policy", "content": POLICY})
    SubElement(head, "meta", name="viewport", content="width=device-width, initial-scale=1")
    SubElement(head, "title").text = plain(document.title)
    SubElement(head, "style").text = STYLE
    body = SubElement(page, "body")
    SubElement(body, "h1").text = plain(document.title)
    for block in document.blocks:
        _add(body, block)
    return "<!DOCTYPE html>\n" + tostring(page, encoding="unicode", method="html") + "\n"


def _add(body: Element, block: Block) -> None:
    if isinstance(block, Heading):
        SubElement(body, f"h{block.level}").text = plain(block.text)
    elif isinstance(block, Paragraph):
        SubElement(body, "p").text = plain(block.text, LONGEST)
    elif isinstance(block, Bullets):
        items = SubElement(body, "ul")
        for item in block.items:
            SubElement(items, "li").text = plain(item, LONGEST)
    elif isinstance(block, Code):
        lines = [plain(line, LONGEST) for line in block.text.splitlines()]
        SubElement(SubElement(body, "pre"), "code").text = "\n".join(lines)
    elif isinstance(block, Table):
        _add_table(body, block)
    elif isinstance(block, Pictures):
        _add_pictures(body, block)
    else:
        raise TypeError(f"a {type(block).__name__} cannot be printed")


def _add_table(body: Element, table: Table) -> None:
    if table.title:
        body = SubElement(body, "details")
        SubElement(body, "summary").text = plain(table.title)
    kinds = "wide many" if len(table.head) > MANY else "wide"
    element = SubElement(SubElement(body, "div", {"class": kinds}), "table")
    line = SubElement(SubElement(element, "thead"), "tr")
    for k, name in enumerate(table.head):
        SubElement(line, "th", {"class": "words" if k < table.words else "number"}).text = plain(name)
    rows, before = SubElement(element, "tbody"), ""
    for row in table.rows:
        first = row[0] if isinstance(row[0], str) else ""
        again = first == before
        line = SubElement(rows, "tr", {} if again or not before else {"class": "begins"})
        for k, entry in enumerate(row):
            names = ["words" if k < table.words else "number"]
            names += ["again"] if k == 0 and again and table.words > 1 else []
            names += ["long"] if isinstance(entry, str) and len(entry) > SHORT else []
            _fill(SubElement(line, "td", {"class": " ".join(names)}), entry)
        before = first


def _fill(cell: Element, entry: Entry) -> None:
    if isinstance(entry, Link):
        SubElement(cell, "a", href=entry.file).text = plain(entry.text)
    elif isinstance(entry, Rate):
        share, _, interval = rate_words(entry).partition(" ")
        cell.text = share
        if entry.episodes:
            # the space separates share and interval in copied text
            cell.text += " "
            SubElement(cell, "small").text = interval
            low, high = 100.0 * entry.low, 100.0 * entry.high
            bar = SubElement(cell, "span", {"class": "rate", "aria-hidden": "true"})
            SubElement(bar, "i", style=f"width:{100.0 * entry.share:.1f}%")
            SubElement(bar, "b", style=f"left:{low:.1f}%;width:{high - low:.1f}%")
    else:
        cell.text = plain(entry)


def _add_pictures(body: Element, block: Pictures) -> None:
    figure = SubElement(body, "figure")
    photos = " photos" if any(picture.kind == "png" for picture in block.pictures) else ""
    grid = SubElement(figure, "div", {"class": f"figures{photos}"})
    for picture in block.pictures:
        place = SubElement(grid, "div")
        data = base64.b64encode(picture.image).decode()
        image = {"src": f"data:image/{picture.kind};base64,{data}", "alt": plain(picture.text)}
        SubElement(place, "img", image | ({"class": "photo"} if picture.kind == "png" else {}))
        files = SubElement(place, "div")
        for suffix in (".pdf", ".png"):
            name = picture.file.removesuffix(".png") + suffix
            link = SubElement(files, "a", href=name)
            link.text, link.tail = suffix[1:].upper(), " "
    SubElement(figure, "figcaption").text = plain(block.caption, LONGEST)
