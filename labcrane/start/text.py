"""Text of a protocol, changed in one place: comments, order and style of the rest stay.

In comes a text of YAML and one edit; out goes the text in which only the characters of that edit
differ. Every edit is read back: if anything but the edited value has changed, it is refused.
"""

import json
import re
from collections.abc import Callable, Iterator
from copy import copy, deepcopy
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.nodes import CollectionNode, MappingNode, Node, ScalarNode, SequenceNode

from labcrane.errors import ProtocolError
from labcrane.files.complaints import Place, named
from labcrane.files.yaml import parse_yaml

_PLAIN = re.compile(r"[^\W\d][\w ./°%+-]*(?<! )")
"""A text that may stand without quotation marks everywhere, if it is read as a text."""

_COLON = re.compile(r"\s*:")
_BLOCKS = ("|", ">")


def edited(text: str, how: str, place: Place, value: Any = None) -> str:
    """Return a text after one edit.

    Parameters
    ----------
    how
        ``set`` gives a key or an item its value, and makes the key where it is missing; ``remove``
        takes a key or an item out; ``insert`` puts ``value`` before an item, or at the list's end;
        ``move`` brings an item to the position ``value`` of its list.

    Raises
    ------
    ProtocolError
        The text is not valid YAML, has no such place, or ties the value to another one.
    """
    before = parse_yaml(text, "the text")
    try:
        wanted = _HOW[how][0](deepcopy(before), place, value)
        made = _HOW[how][1](text, place, value)
    except (LookupError, TypeError, AttributeError) as error:
        raise ProtocolError(
            f"the text has no place for {how!r} at {named(place)}; change it in the text"
        ) from error
    try:
        there = parse_yaml(made, "the text")
    except ProtocolError as error:
        raise _tied(place) from error
    if _same(there) != _same(wanted):
        raise _tied(place)
    return made


def positions(text: str) -> list[tuple[list[str | int], int, int]]:
    """Return each place of a text with its line and column, from 1, in the text's order."""
    return list(_positions(_composed(text), ()))


def ties(text: str) -> list[list[str | int]]:
    """Return the places whose values an anchor ties to other ones: the text alone changes them."""
    shared: dict[int, list[list[str | int]]] = {}

    def look(node: Node | None, place: Place) -> None:
        for key, child in _children(node):
            inner: Place = (*place, key if isinstance(key, int) else str(key.value))
            if id(child) not in shared:
                look(child, inner)
            shared.setdefault(id(child), []).append(list(inner))

    look(_composed(text), ())
    return [place for places in shared.values() if len(places) > 1 for place in places]


def _positions(node: Node | None, place: Place) -> Iterator[tuple[list[str | int], int, int]]:
    begin = node.start_mark.index if node is not None else 0
    for key, child in _children(node):
        if child.start_mark.index < begin:
            continue  # an alias: its anchor has its place
        at = child.start_mark if isinstance(key, int) else key.start_mark
        inner: Place = (*place, key if isinstance(key, int) else str(key.value))
        yield list(inner), at.line + 1, at.column + 1
        yield from _positions(child, inner)


def _children(node: Node | None) -> Iterator[tuple[Any, Node]]:
    if isinstance(node, MappingNode):
        yield from node.value
    elif isinstance(node, SequenceNode):
        yield from enumerate(node.value)


def _tied(place: Place) -> ProtocolError:
    return ProtocolError(
        f"{named(place)} cannot be changed alone: the text ties it to another place, by an anchor "
        "for example; change it in the text"
    )


def _same(data: Any) -> str:
    return json.dumps(data, sort_keys=True, default=repr)


def _composed(text: str) -> Node | None:
    root: Node | None = YAML(typ="rt", pure=True).compose(text)
    _place_empty(text, root)
    return root


def _place_empty(text: str, node: Node | None) -> None:
    """Place each value that is empty behind its colon; ruamel.yaml places it at the next key."""
    for key, child in _children(node):
        if isinstance(key, Node) and child.start_mark.index == child.end_mark.index:
            mark = copy(child.start_mark)
            if found := _COLON.match(text, key.end_mark.index):
                mark.index = found.end()
                child.start_mark = child.end_mark = mark
        _place_empty(text, child)


# What the values are after an edit, made without the text.


def _held(data: Any, place: Place) -> Any:
    for step in place:
        data = data[step]
    return data


def _set_value(data: Any, place: Place, value: Any) -> Any:
    if not place:
        return value
    *above, last = place
    try:
        holder = _held(data, tuple(above))
    except KeyError:
        holder = None
    if holder is None:
        return _set_value(data, tuple(above), {last: value})
    holder[last] = value
    return data


def _remove_value(data: Any, place: Place, _: Any) -> Any:
    del _held(data, place[:-1])[place[-1]]
    return data


def _insert_value(data: Any, place: Place, value: Any) -> Any:
    *above, at = place
    try:
        holder = _held(data, tuple(above))
    except KeyError:
        holder = None
    if holder is None:
        return _set_value(data, tuple(above), [value])
    holder.insert(at, value)
    return data


def _move_value(data: Any, place: Place, to: Any) -> Any:
    holder = _held(data, place[:-1])
    _ = holder[to]
    holder.insert(to, holder.pop(place[-1]))
    return data


# The same edits in the text.


def _walk(text: str, place: Place) -> list[Node | None]:
    """Return the nodes on the way to a place; None where the text has none."""
    nodes = [_composed(text)]
    for step in place:
        found = [
            child
            for key, child in _children(nodes[-1])
            if (key if isinstance(key, int) else str(key.value)) == step
        ]
        nodes.append(found[-1] if found else None)
    return nodes


def _set_text(text: str, place: Place, value: Any) -> str:
    nodes = _walk(text, place)
    if (node := nodes[-1]) is not None:
        return _replaced(text, nodes, node, value)
    *above, last = place
    parent = nodes[-2] if above or len(nodes) > 1 else None
    if isinstance(parent, MappingNode):
        return _added(text, parent, str(last), value, flow=_in_flow(nodes))
    if parent is None and not above:
        return f"{text.rstrip()}\n{_key(str(last))}: {_flow(value)}\n".lstrip("\n")
    return _set_text(text, tuple(above), {last: value})


def _replaced(text: str, nodes: list[Node | None], node: Node, value: Any) -> str:
    start, end = node.start_mark.index, _end(text, node)
    if isinstance(node, ScalarNode):
        if "\n" in str(value) and isinstance(value, str) and not _in_flow(nodes):
            written = _literal(text, node, value)
        else:
            written = _scalar(value, node.style)
        gap = " " if start == end and text[start - 1 : start] != " " else ""
        return text[:start] + gap + written + text[end:]
    if text[:start].rpartition("\n")[2].strip():  # it begins in the line of its key
        return text[:start] + _flow(value) + text[end:]
    colon = len(text[:start].rstrip())
    return f"{text[:colon]} {_flow(value)}{text[end:]}"


def _added(text: str, parent: MappingNode, key: str, value: Any, *, flow: bool) -> str:
    pair = f"{_key(key)}: {_flow(value)}"
    if not parent.value:
        at = parent.start_mark.index + 1
        return text[:at] + pair + text[at:]
    first, (_, last) = parent.value[0][0], parent.value[-1]
    end = _end(text, last)
    if flow or parent.flow_style:
        return f"{text[:end]}, {pair}{text[end:]}"
    at = _line_end(text, end)
    return f"{text[:at]}\n{' ' * first.start_mark.column}{pair}{text[at:]}"


def _remove_text(text: str, place: Place, _: Any) -> str:
    nodes = _walk(text, place)
    parent, node = nodes[-2], nodes[-1]
    if not isinstance(parent, CollectionNode) or node is None:
        raise LookupError(place)
    if len(parent.value) == 1:
        return _replaced(text, nodes[:-1], parent, {} if isinstance(parent, MappingNode) else [])
    if isinstance(parent, SequenceNode) and not parent.flow_style:
        start, end = _chunks(text, parent)[int(place[-1])]
        return _without_lines(text, start, end)
    starts = [key.start_mark.index for key, _ in parent.value] if isinstance(
        parent, MappingNode
    ) else [each.start_mark.index for each in parent.value]  # fmt: skip
    ends = [_end(text, child) for _, child in _children(parent)]
    at = [child for _, child in _children(parent)].index(node)
    if parent.flow_style or text[: starts[at]].rpartition("\n")[2].strip():
        if at + 1 < len(starts):
            return text[: starts[at]] + text[starts[at + 1] :]
        return text[: ends[at - 1]] + text[ends[at] :]
    return _without_lines(text, _line_start(text, starts[at]), _line_end(text, ends[at]))


def _insert_text(text: str, place: Place, value: Any) -> str:
    *above, at = place
    node = _walk(text, tuple(above))[-1]
    if not isinstance(node, SequenceNode):
        return _set_text(text, tuple(above), [value])
    at = int(at)
    written = _flow(value)
    if not node.value:
        start = node.start_mark.index + 1
        return text[:start] + written + text[start:]
    last = at >= len(node.value)
    if node.flow_style:
        if last:
            end = _end(text, node.value[-1])
            return f"{text[:end]}, {written}{text[end:]}"
        start = node.value[at].start_mark.index
        return f"{text[:start]}{written}, {text[start:]}"
    if isinstance(value, dict) and len(value) == 1:
        written = written[1:-1]  # a step is written as "- break: {seconds: 30}"
    start, end = _chunks(text, node)[-1 if last else at]
    indent = " " * node.start_mark.column
    if last:
        return f"{text[:end]}\n{indent}- {written}{text[end:]}"
    return f"{text[:start]}{indent}- {written}\n{text[start:]}"


def _move_text(text: str, place: Place, to: Any) -> str:
    node = _walk(text, place[:-1])[-1]
    assert isinstance(node, SequenceNode), "its values were moved before"  # noqa: S101
    if node.flow_style:
        spans = [(each.start_mark.index, _end(text, each)) for each in node.value]
    else:
        spans = _chunks(text, node)
    parts = [text[start:end] for start, end in spans]
    parts.insert(to, parts.pop(int(place[-1])))
    made, at = "", 0
    for (start, end), part in zip(spans, parts, strict=True):
        made += text[at:start] + part
        at = end
    return made + text[at:]


def _chunks(text: str, node: SequenceNode) -> list[tuple[int, int]]:
    """Return the lines of each item of a block list, with the comment directly above it."""
    found = []
    for item in node.value:
        dash = text.rindex("-", 0, item.start_mark.index)
        start, indent = _line_start(text, dash), " " * (dash - _line_start(text, dash))
        while start and text[_line_start(text, start - 1) : start].startswith(f"{indent}#"):
            start = _line_start(text, start - 1)
        found.append((start, _line_end(text, _end(text, item))))
    return found


def _end(text: str, node: Node) -> int:
    """Return where a value's own characters end; YAML's mark is after the comments."""
    if isinstance(node, ScalarNode):
        return _block_end(text, node) if node.style in _BLOCKS else int(node.end_mark.index)
    if not isinstance(node, CollectionNode) or node.flow_style or not node.value:
        return int(node.end_mark.index)
    last = node.value[-1]
    return _end(text, last[1] if isinstance(node, MappingNode) else last)


def _block_end(text: str, node: ScalarNode) -> int:
    """Return the end of a text of several lines: its last line that is indented below its key."""
    line = _line_start(text, node.start_mark.index)
    before = text[line : node.start_mark.index]
    outer = before.rfind("-") if not before.strip(" -") else len(before) - len(before.lstrip(" -"))
    end = at = _line_end(text, node.start_mark.index)
    while at < len(text):
        begin, at = at + 1, _line_end(text, at + 1)
        if (content := text[begin:at]).strip():
            if len(content) - len(content.lstrip(" ")) <= outer:
                break
            end = at
    return end


def _line_start(text: str, at: int) -> int:
    return text.rfind("\n", 0, at) + 1


def _line_end(text: str, at: int) -> int:
    end = text.find("\n", at)
    return len(text) if end < 0 else end


def _without_lines(text: str, start: int, end: int) -> str:
    return text[:start] + text[end + 1 :]


def _in_flow(nodes: list[Node | None]) -> bool:
    return any(getattr(node, "flow_style", False) for node in nodes[:-1])


def _scalar(value: Any, style: str | None = None) -> str:
    """Return a value as it is written in any place of a text, in the style that was there."""
    if not isinstance(value, str):
        return _flow(value)
    if style == "'" and value.isprintable():
        return "'" + value.replace("'", "''") + "'"
    if style != '"' and _PLAIN.fullmatch(value) and parse_yaml(value, "the value") == value:
        return value
    return json.dumps(value, ensure_ascii=False)


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(k)}: {_flow(each)}" for k, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_flow, value)) + "]"
    return _scalar(value) if isinstance(value, str) else json.dumps(value)


def _key(key: str) -> str:
    return _scalar(key)


def _literal(text: str, node: ScalarNode, value: str) -> str:
    line = text[_line_start(text, node.start_mark.index) :]
    indent = " " * (len(line) - len(line.lstrip(" -")) + 2)
    keep = "" if value.endswith("\n") else "-"
    lines = value.removesuffix("\n").split("\n")
    return f"|{keep}\n" + "\n".join(f"{indent}{each}" if each else "" for each in lines)


_Values = Callable[[Any, Place, Any], Any]
_Texts = Callable[[str, Place, Any], str]
_HOW: dict[str, tuple[_Values, _Texts]] = {
    "set": (_set_value, _set_text),
    "remove": (_remove_value, _remove_text),
    "insert": (_insert_value, _insert_text),
    "move": (_move_value, _move_text),
}
