"""Strict YAML: a text means exactly what it says.

YAML 1.2 through ruamel.yaml (`1e-3` is a number, `no` is a string), without anchors, aliases, tags and duplicate keys,
at most 256 KiB.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import AliasEvent, NodeEvent

from .dotted_keys import at, having
from .errors import BadConfig

MAX_BYTES = 256 * 1024
COMMAND_LINE = "command line"
WORDS = {"1": True, "yes": True, "on": True, "true": True, "0": False, "no": False, "off": False, "false": False}
"""Words for on and off on the command line."""


def load_mapping(path: str | Path) -> dict[str, Any]:
    """Load the mapping in a YAML file.

    Raises:
        BadConfig: names the file and the line or key.
    """
    path = Path(path)
    if not path.is_file():
        raise BadConfig(path, "", "no such file")
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise BadConfig(path, "", f"has {size} bytes; at most {MAX_BYTES} are read")
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise BadConfig(path, "", "is not a text file in UTF-8") from None
    value = parse(text, path)
    if not isinstance(value, dict):
        raise BadConfig(path, "", "does not hold `key: value` lines")
    return value


def with_overrides(values: dict[str, Any], overrides: list[str]) -> dict[str, Any]:
    """Return the mapping with `key=value` changes.

    Args:
        values: nested mapping.
        overrides: changes, each `key=value`; dotted keys reach into nested mappings, values are YAML.

    Raises:
        BadConfig: a change has another form, or reaches into a value that is not a mapping.
    """
    result = _copied(values)
    for text in overrides:
        key, separator, value = text.partition("=")
        if not separator or not key:
            raise BadConfig(COMMAND_LINE, text, "is not of the form key=value")
        *outer, last = key.split(".")
        target = result
        for part in outer:
            target = target.setdefault(part, {})
            if not isinstance(target, dict):
                raise BadConfig(COMMAND_LINE, key, f"{part!r} holds a value, not a mapping")
        target[last] = parse(value, COMMAND_LINE)
    return result


def with_switches(values: dict[str, Any], changed: Iterable[str], switches: Iterable[str]) -> dict[str, Any]:
    """Return the mapping with what the command line says of switches as truth values.

    There, 0 and 1, and yes, no, on, off, true and false in any case, are on or off; a file says true or false.

    Args:
        values: nested mapping.
        changed: keys changed on the command line.
        switches: dotted keys whose values are true or false.
    """
    for key in set(changed) & set(switches):
        value = at(values, key)
        word = str(value).lower() if isinstance(value, str | int) else ""
        if word in WORDS:
            values = having(values, key, WORDS[word])
    return values


def parse(text: str, source: str | Path) -> Any:
    """Return the value of a YAML text.

    Args:
        text: YAML text.
        source: name of the text's origin, for messages.

    Raises:
        BadConfig: the text is not YAML, or uses anchors, aliases or tags.
    """
    try:
        for event in YAML(typ="safe", pure=True).parse(text):
            _refuse_indirection(event, source)
        return YAML(typ="safe", pure=True).load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}" if mark else ""
        problem = (error.problem or "is not YAML").splitlines()[0]
        raise BadConfig(source, where, problem) from None
    except (YAMLError, ValueError, RecursionError) as error:
        raise BadConfig(source, "", f"is not YAML: {str(error).splitlines()[0]}") from None


def _refuse_indirection(event: Any, source: str | Path) -> None:
    if not isinstance(event, NodeEvent):
        return
    where = f"line {event.start_mark.line + 1}"
    if isinstance(event, AliasEvent) or event.anchor is not None:
        raise BadConfig(source, where, "anchors and aliases are not allowed: write the value out")
    tag = getattr(event, "tag", None)
    if tag is not None:
        raise BadConfig(source, where, f"tags are not allowed: {tag}")


def _copied(value: Any) -> Any:
    return {key: _copied(item) for key, item in value.items()} if isinstance(value, dict) else value
