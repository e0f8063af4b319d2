"""Draw the packages, their sub-packages and who imports whom: docs/architecture.svg, from today's imports.

    python tests/draw_architecture.py            rewrite the picture
    python tests/draw_architecture.py --check    exit 1 if the picture is not up to date

Every arrow points down. Whole numbers and fixed orders only: the same sources give the same bytes on any machine.
"""

from __future__ import annotations

import ast
import sys
from functools import cache
from itertools import combinations, pairwise, permutations
from xml.sax.saxutils import escape

from helpers.import_graph import MODULES, ROOT, graph, imports_of, layer_of, tree_of

PICTURE = ROOT / "docs" / "architecture.svg"
BANDS = {
    "face": ("#595959", "#f4f4f4"),
    "bench": ("#0072b2", "#eaf3fa"),
    "baselines": ("#b34e00", "#fdf0e6"),
    "envs": ("#007a5a", "#e8f5f0"),
    "configs": ("#a3508a", "#f9eef5"),
    "planner": ("#6b5900", "#fbf6df"),
}
"""Packages from top to bottom, each with a dark and a light color, after Okabe and Ito's color-blind safe set."""
WIDTH, EDGE, LEFT, LANE, BETWEEN = 1000, 14, 104, 15, 14
"""Width, margin, left edge of the bands, distance of the lines beside them, and between bands [px]."""
PAD, HEAD, BOX, BOX_WIDTH, GAP, PITCH = 16, 46, 28, 116, 28, 150
"""Margin and head of a band, height and width of a box, space between levels, largest distance of columns [px]."""
PANEL, NAME, WIDE_NAME, LINE = 236, 114, 140, 16
"""Widths of the list of single files and of a name in it, with and without boxes beside it; height of a line [px]."""
STYLE = """<style>
text { font: 12px sans-serif; fill: #333333; }
.package { font-size: 18px; font-weight: bold; }
.box { font-size: 13px; font-weight: bold; text-anchor: middle; }
.file, .count { font-size: 11px; font-weight: normal; }
</style>"""
LEGEND = """Every arrow points down, to a part that is imported. On the left: which package imports from which.
In a band: sub-packages, each with its number of files; arrows implied by others are left out. Dashed: single files."""
Node = str | tuple[str, str, int]
"""A sub-package, or the place at a level where the arrow between two others passes."""
Arrows = dict[str, set[str]]


def files_of(layer: str) -> list[str]:
    """Return the modules that lie directly in a package or sub-package."""
    return sorted(name for name in graph() if name.rpartition(".")[0] == layer)


def sub_packages(package: str) -> list[str]:
    return sorted(m for m, path in MODULES.items() if path.name == "__init__.py" and m.rpartition(".")[0] == package)


def package_arrows() -> Arrows:
    """Return for each package the others that it imports; the root's face imports in its `__init__`."""
    found: Arrows = {package: set() for package in BANDS}
    for module, targets in {**graph(), "face": imports_of(MODULES["face"])}.items():
        package = module.split(".")[0]
        found[package] |= {target.split(".")[0] for target in targets} - {package}
    upward = [(one, other) for other, one in combinations(BANDS, 2) if other in found[one]]
    assert not upward, f"drawn below what they import: {upward}"
    return found


def arrows_of(package: str) -> Arrows:
    """Return for each sub-package the others that it imports, also through single files, without those implied."""
    direct: Arrows = {node: set() for node in sub_packages(package)}
    for module, targets in graph().items():
        if module.split(".")[0] == package:
            layers = {layer_of(target) for target in targets if target.split(".")[0] == package}
            direct.setdefault(layer_of(module), set()).update(layers - {layer_of(module)})

    @cache
    def below(node: str) -> frozenset[str]:
        return frozenset(direct[node].union(*map(below, direct[node])))

    found = {node: below(node) & set(sub_packages(package)) for node in sub_packages(package)}
    return {node: {b for b in under if not any(b in below(a) for a in under)} for node, under in found.items()}


def levels_of(arrows: Arrows) -> dict[Node, int]:
    """Return the level of each sub-package: above all that it imports, else near those that import it."""

    @cache
    def depth(node: str) -> int:
        return max((depth(other) + 1 for other in arrows[node]), default=0)

    level: dict[Node, int] = {node: depth(node) for node in arrows}
    for node in sorted(arrows, key=lambda each: (-depth(each), each)):
        above = [level[other] for other in arrows if node in arrows[other]]
        if len(above) > len(arrows[node]):
            level[node] = min(above) - 1
    return level


def placed(arrows: Arrows) -> tuple[dict[Node, int], dict[Node, int], int, list[list[Node]]]:
    """Return levels, columns, the number of columns, and the nodes that each arrow passes."""
    level, routes = levels_of(arrows), []
    for one in arrows:
        for other in sorted(arrows[one]):
            passed = [(one, other, k) for k in range(level[one] - 1, level[other], -1)]
            level |= {node: node[2] for node in passed}
            routes.append([one, *passed, other])
    rows = [[node for node in level if level[node] == k] for k in range(max(level.values(), default=-1) + 1)]
    columns = max([3, *map(len, rows)])
    edges = [edge for route in routes for edge in pairwise(route)]

    def cost(column: dict[Node, int]) -> int:
        """Crossings of arrows first, then their widths and bends, then distances from the middle."""
        ends = [(level[a], column[a], column[b]) for a, b in edges]
        crossings = sum(k == m and (a - c) * (b - d) < 0 for (k, a, b), (m, c, d) in combinations(ends, 2))
        off = sum(abs(2 * column[node] - columns + 1) for node in level if isinstance(node, str))
        return 1000 * crossings + sum(4 * (a - b) ** 2 + 8 * (a != b) for _, a, b in ends) + off

    def settled(column: dict[Node, int]) -> dict[Node, int]:
        before = None
        while column != before:
            before = column
            for row in [*rows, *reversed(rows)]:
                choices = (zip(row, choice, strict=True) for choice in permutations(range(columns), len(row)))
                column = min([column, *({**column, **dict(choice)} for choice in choices)], key=cost)
        return column

    numbered = [(node, i, k) for i, row in enumerate(rows) for k, node in enumerate(row)]
    starts = [{node: (k + turn * i) % columns for node, i, k in numbered} for turn in range(columns)]
    return level, min(map(settled, starts), key=cost), columns, routes


def text(kind: str, x: int, y: int, words: str, color: str = "") -> str:
    style = f' style="fill:{color}"' if color else ""
    return f'<text class="{kind}" x="{x}" y="{y}"{style}>{escape(words)}</text>'


def head(x: int, y: int, dx: int, dy: int, color: str) -> str:
    """Return an arrowhead with its tip at (x, y), in direction (dx, dy)."""
    back = " ".join(f"{x - 8 * dx + 4 * dy * side},{y - 8 * dy + 4 * dx * side}" for side in (1, -1))
    return f'<polygon points="{x},{y} {back}" fill="{color}"/>'


class Band:
    """A package in the picture: sub-packages, arrows between them, and single files."""

    def __init__(self, package: str, top: int):
        self.package, self.top, (self.dark, self.light) = package, top, BANDS[package]
        self.level, self.column, columns, self.routes = placed(arrows_of(package))
        rows, space = max(self.level.values(), default=-1) + 1, WIDTH - EDGE - LEFT - 2 * PAD
        self.panel, self.name = (PANEL, NAME) if rows else (space, WIDE_NAME)
        files = [name.split(".")[1] for name in files_of(package)]
        lines = -(-len(files) // (self.panel // self.name))
        self.files = [files[k::lines] for k in range(lines)]
        self.inner = max(rows * (BOX + GAP) - GAP, lines * LINE + 14)
        self.height, space = HEAD + self.inner + PAD, space - PANEL - PAD
        self.pitch = min(PITCH, space // columns)
        self.width = min(BOX_WIDTH, self.pitch - 12)
        self.first = LEFT + PAD + (space - self.pitch * (columns - 1)) // 2

    def point(self, node: Node) -> tuple[int, int]:
        """Return the middle of the upper edge of a node."""
        lowest = self.top + HEAD + self.inner - BOX
        return self.first + self.pitch * self.column[node], lowest - self.level[node] * (BOX + GAP)

    def drawn(self) -> list[str]:
        about = (ast.get_docstring(tree_of(MODULES[self.package])) or "").partition("\n")[0].replace("`", "")
        frame = f'height="{self.height}" rx="8" fill="{self.light}" stroke="{self.dark}"'
        lines = [f'<rect x="{LEFT}" y="{self.top}" width="{WIDTH - EDGE - LEFT}" {frame}/>']
        lines.append(text("package", LEFT + PAD, self.top + 30, self.package, self.dark))
        lines += [text("about", LEFT + PAD + 112, self.top + 29, about), *self.listed(), *self.arrows()]
        for node in sub_packages(self.package):
            (x, y), frame = self.point(node), f'rx="6" fill="#ffffff" stroke="{self.dark}" stroke-width="1.5"'
            name = f'{node.split(".")[1]} <tspan class="count">{len(files_of(node))}</tspan>'
            lines.append(f'<rect x="{x - self.width // 2}" y="{y}" width="{self.width}" height="{BOX}" {frame}/>')
            lines.append(f'<text class="box" x="{x}" y="{y + 19}">{name}</text>')
        return lines

    def listed(self) -> list[str]:
        """Return the single files of the package."""
        x, y, height = WIDTH - EDGE - PAD - self.panel, self.top + HEAD, len(self.files) * LINE + 14
        frame = f'rx="6" fill="#ffffff" fill-opacity="0.6" stroke="{self.dark}" stroke-dasharray="3 3"'
        lines = [f'<rect x="{x}" y="{y}" width="{self.panel}" height="{height}" {frame}/>'] if self.files else []
        for k, names in enumerate(self.files):
            lines += [text("file", x + 10 + self.name * j, y + 19 + LINE * k, name) for j, name in enumerate(names)]
        return lines

    def port(self, node: Node, other: Node, others: list[Node]) -> int:
        """Return where on a node's edge the arrow from or to another node is: the middle, or on the other's side."""
        *offsets, offset = (self.column[each] - self.column[node] for each in (*others, other))
        rank = sum(0 < each * offset <= offset**2 for each in offsets) if len(others) > 1 else 0
        return self.point(node)[0] + 16 * rank * (1 if offset > 0 else -1)

    def arrows(self) -> list[str]:
        """Return the arrows between the sub-packages."""
        edges, lines = [edge for route in self.routes for edge in pairwise(route)], []
        for route in self.routes:
            path = ""
            for a, b in pairwise(route):
                x = self.port(a, b, [other for one, other in edges if one == a])
                x2 = self.port(b, a, [one for one, other in edges if other == b])
                y, y2 = self.point(a)[1] + BOX, self.point(b)[1] - 6 * (b == route[-1])
                path += f" L{x},{y}" if path else f"M{x},{y}"
                path += f" C{x},{y + GAP // 2} {x2},{y2 - GAP // 2} {x2},{y2}"
            lines.append(f'<path d="{path}" fill="none" stroke="{self.dark}" stroke-width="1.3"/>')
            lines.append(head(x2, y2 + 6, 0, 1, self.dark))
        return lines


def between(bands: dict[str, Band]) -> list[str]:
    """Return the arrows between packages: a line on the left for each package that imports."""
    arrows, lines = package_arrows(), []
    lanes = [package for package in BANDS if arrows[package]]
    for package in lanes:
        x, color, tips = EDGE + LANE * lanes.index(package), BANDS[package][0], []
        for target in sorted(arrows[package], key=list(BANDS).index):
            inner = [lane for lane in reversed(lanes) if target in arrows[lane]]
            tips.append(bands[target].top + 16 + LANE * inner.index(package))
        begin = f"M{LEFT},{bands[package].top + bands[package].height - 14} H{x}"
        for style in ('stroke="#ffffff" stroke-width="6"', f'stroke="{color}" stroke-width="2"'):
            path = " ".join([f"{begin} V{tips[-1]}", *(f"M{x},{y} H{LEFT - 7}" for y in tips)])
            lines.append(f'<path d="{path}" fill="none" {style}/>')
        lines += [head(LEFT - 1, y, 1, 0, color) for y in tips]
    return lines


def picture() -> str:
    bands, top = {}, 58
    for package in BANDS:
        bands[package] = Band(package, top)
        top += bands[package].height + BETWEEN
    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {top}" width="{WIDTH}" height="{top}">']
    lines += ["<title>The packages of OneDemo, their sub-packages, and who imports whom</title>", STYLE]
    lines.append(f'<rect width="{WIDTH}" height="{top}" fill="#ffffff"/>')
    lines += [text("about", LEFT, 24 + 18 * k, words) for k, words in enumerate(LEGEND.splitlines())]
    lines += [*between(bands), *(line for band in bands.values() for line in band.drawn()), "</svg>"]
    return "\n".join(lines) + "\n"


def main() -> int:
    if "--check" not in sys.argv[1:]:
        PICTURE.write_text(picture(), encoding="utf-8", newline="\n")
    elif not PICTURE.is_file() or PICTURE.read_text(encoding="utf-8") != picture():
        print(f"{PICTURE.relative_to(ROOT)} is out of date: run `make picture`")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
