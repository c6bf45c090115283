"""Differences between two versions of a study, in words."""

from collections.abc import Iterator, Mapping
from difflib import SequenceMatcher
from typing import Any

Tree = Mapping[str, Any]

SETTINGS = "settings: "


def differences(before: Tree, now: Tree) -> list[str]:
    """Return one line for every difference; none if there is none.

    Both arguments are what :func:`labcrane.approval.materials.materials` returns.
    """
    lines = [*_values("protocol", before.get("protocol"), now.get("protocol"))]
    for section, word in (("files", "file"), ("consent", "consent text")):
        lines += _files(word, before.get(section, {}), now.get(section, {}))
    lines += _contents("the machine", before["machine"], now["machine"])
    # Defaults of a component change with its plugin; written settings are reported above.
    lines += _values("settings", before.get("settings"), now.get("settings"))
    lines += _sources("labcrane", before["labcrane"], now["labcrane"])
    for name in sorted({*before["plugins"], *now["plugins"]}):
        old, new = before["plugins"].get(name), now["plugins"].get(name)
        if old is None or new is None:
            lines.append(f"plugin {name} is {'used now' if new else 'no longer used'}")
        else:
            lines += _sources(f"plugin {name}", old, new)
    return _said_once(lines)


def _said_once(lines: list[str]) -> list[str]:
    """Leave out settings that differ because the protocol or a file does: the same change twice."""
    written = {line.partition(": ")[2] for line in lines if not line.startswith(SETTINGS)}
    return [line for line in lines if not (line.startswith(SETTINGS) and _tails(line) & written)]


def _tails(line: str) -> set[str]:
    """Return a change of a setting with every place from which a file may have named it."""
    place, space, change = line.removeprefix(SETTINGS).partition(" ")
    parts = place.split(".")
    return {".".join(parts[at:]) + space + change for at in range(len(parts))}


def _values(where: str, before: Any, now: Any) -> Iterator[str]:
    for place, old, new in _leaves("", before, now):
        yield f"{where}: {place} {_change(old, new)}"


_NOTHING = object()


def _change(old: object, new: object) -> str:
    if old is _NOTHING:
        return f"is new: {new!r}"
    if new is _NOTHING:
        return f"is gone; it was {old!r}"
    return f"was {old!r}, is {new!r}"


def _leaves(place: str, old: Any, new: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield every innermost place where two trees differ."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in dict.fromkeys([*old, *new]):
            inner = f"{place}.{key}" if place else str(key)
            yield from _leaves(inner, old.get(key, _NOTHING), new.get(key, _NOTHING))
    elif isinstance(old, list) and isinstance(new, list):
        for number in range(max(len(old), len(new))):
            first = old[number] if number < len(old) else _NOTHING
            second = new[number] if number < len(new) else _NOTHING
            yield from _leaves(f"{place}[{number + 1}]", first, second)
    elif isinstance(old, bool) != isinstance(new, bool) or old != new:
        yield place or "the whole", old, new


def _files(word: str, before: Tree, now: Tree) -> Iterator[str]:
    for name in sorted({*before, *now}):
        if name not in now:
            yield f"{word} {name} is missing, or no longer referred to"
        elif name not in before:
            yield f"{word} {name} is new"
        else:
            yield from _contents(f"{word} {name}", before[name], now[name])


def _contents(what: str, before: Tree, now: Tree) -> Iterator[str]:
    if "data" in before and "data" in now:
        yield from _values(what, before["data"], now["data"])
    elif "lines" in before and "lines" in now:
        yield from _lines(what, before["lines"], now["lines"])
    elif before != now:
        yield f"{what} has different content"


def _lines(what: str, before: list[str], now: list[str]) -> Iterator[str]:
    matcher = SequenceMatcher(None, before, now, autojunk=False)
    for kind, old, old_end, new, new_end in matcher.get_opcodes():
        if kind != "equal":
            was = "\n".join(before[old:old_end]) if old < old_end else _NOTHING
            is_now = "\n".join(now[new:new_end]) if new < new_end else _NOTHING
            yield f"{what}: line {old + 1} {_change(was, is_now)}"


def _sources(what: str, before: Tree, now: Tree) -> Iterator[str]:
    if before["version"] != now["version"]:
        yield f"{what}: version was {before['version']}, is {now['version']}"
    for name in sorted({*before["files"], *now["files"]}):
        if name not in now["files"]:
            yield f"{what}: {name} is missing"
        elif name not in before["files"]:
            yield f"{what}: {name} is new"
        elif before["files"][name] != now["files"][name]:
            yield f"{what}: the source of {name} has changed"
