"""Lists of robots in YAML: where the file of each lies in which package, and what of it is the arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any, NamedTuple

from ...configs import BadConfig
from ...configs.dataclass_settings import settings_from
from ...configs.strict_yaml import load_mapping
from ..robot.load_robot import RobotRequest

NAME = frozenset("abcdefghijklmnopqrstuvwxyz0123456789_-")
"""Characters of a robot's name, which is also that of its file of results."""


@dataclass(frozen=True)
class PackageEntry:
    """A package of robots.

    Attributes:
        folder: its robots' folder, from where packages are installed.
        install: the line that installs it; None: pip with its name, without what it needs.
    """

    folder: str
    install: str | None = None


@dataclass(frozen=True)
class RobotEntry:
    """A robot of a list.

    Attributes:
        name: unique in the list.
        file: URDF or MJCF file in the package's folder, or beside the list.
        package: name of the package; None: the file lies beside the list.
        tool: see `RobotRequest`, as all below.
        base_link: see `RobotRequest`.
        locked: see `RobotRequest`.
        package_dirs: like `file`.
        srdf: like `file`.
        visuals: see `RobotRequest`.
        velocity_limits: one number or one per joint [rad/s or m/s]; MJCF needs them.
        kind: what is special about it, a few words for the table.
    """

    name: str
    file: str
    package: str | None = None
    tool: str | None = None
    base_link: str | None = None
    locked: dict[str, float] = field(default_factory=dict)
    package_dirs: list[str] | None = None
    srdf: str | None = None
    visuals: bool = False
    velocity_limits: float | list[float] | None = None
    kind: str = ""


class ListedRobot(NamedTuple):
    """A robot of a list, and where it is.

    Attributes:
        entry: its entry.
        folder: where its files are; None: the package is not installed.
        install: the line that installs the package; "" without a package.
        version: of the package; "" without.
    """

    entry: RobotEntry
    folder: Path | None
    install: str
    version: str

    @property
    def request(self) -> RobotRequest:
        """The request that loads it.

        Raises:
            BadConfig: its package is not installed.
        """
        entry, folder = self.entry, self.folder
        if folder is None:
            raise BadConfig(entry.name, "package", f"{entry.package} is not installed: {self.install}")
        return RobotRequest(
            folder / entry.file,
            entry.tool,
            velocity_limits=entry.velocity_limits,
            base_link=entry.base_link,
            locked=entry.locked,
            package_dirs=None if entry.package_dirs is None else [folder / each for each in entry.package_dirs],
            srdf=None if entry.srdf is None else folder / entry.srdf,
            visuals=entry.visuals,
        )


def read_robot_list(path: Path) -> list[ListedRobot]:
    """Read a list of robots.

    Args:
        path: YAML file with `robots`, a list, and `packages`, a mapping; see `RobotEntry` and `PackageEntry`.

    Raises:
        BadConfig: names the file, the entry and the key.
    """
    values = load_mapping(path)
    for key in values:
        if key not in ("packages", "robots"):
            raise BadConfig(path, key, "unknown key; allowed: packages, robots")
    packages = _mapping(path, "packages", values.get("packages", {}))
    known = {name: settings_from(PackageEntry, each, f"{path}: packages.{name}") for name, each in packages.items()}
    given = values.get("robots")
    if not isinstance(given, list) or not given:
        raise BadConfig(path, "robots", "is no list of robots")
    found: dict[str, ListedRobot] = {}
    for k, each in enumerate(given):
        entry = settings_from(RobotEntry, _mapping(path, f"robots[{k}]", each), f"{path}: robots[{k}]")
        if not entry.name or set(entry.name) - NAME:
            raise BadConfig(path, f"robots[{k}].name", f"{entry.name!r}: allowed are a to z, 0 to 9, _ and -")
        if entry.name in found:
            raise BadConfig(path, f"robots[{k}].name", f"{entry.name!r} stands twice")
        if entry.package is not None and entry.package not in known:
            raise BadConfig(path, f"robots[{k}].package", f"{entry.package!r} is not under packages")
        found[entry.name] = _located(path, entry, known)
    return list(found.values())


def _located(path: Path, entry: RobotEntry, packages: Mapping[str, PackageEntry]) -> ListedRobot:
    if entry.package is None:
        return ListedRobot(entry, path.parent, "", "")
    package = packages[entry.package]
    install = package.install or f"pip install --no-deps {entry.package}"
    try:
        installed = distribution(entry.package)
    except PackageNotFoundError:
        return ListedRobot(entry, None, install, "")
    folder = Path(str(installed.locate_file(package.folder)))
    return ListedRobot(entry, folder, install, f"{entry.package} {installed.version}")


def _mapping(path: Path, key: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise BadConfig(path, key, "does not hold `key: value` lines")
    return value
