"""Reasons why a text is not valid YAML, in plain words, and the places of the mistakes.

A parser notices a mistake where it cannot continue, which is often a line later.
"""

import re
from collections.abc import Iterator
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import ScalarNode
from ruamel.yaml.tokens import ScalarToken

GARBLED = (
    YAMLError, ValueError, LookupError, TypeError, ArithmeticError, AttributeError, AssertionError
)  # fmt: skip
"""Exceptions of ruamel.yaml for invalid YAML and for values that do not fit their tag. Its
documentation does not list them; these were observed."""

_WIDE = re.compile(r"[ \t]*[\u00a0\u2000-\u200b\u202f\u3000]")
_NO_SPACE = re.compile(r"\s*(?:- +)?([A-Za-z_][\w-]*):([^\s/].*)?$")
_DUPLICATE = re.compile(r'found duplicate key "(?P<key>[^"]*)"')


Spot = tuple[int, int]
"""Line and column, from 1."""


def misread(error: MarkedYAMLError, text: str) -> tuple[Spot, str]:
    """Return line and column, from 1, and the mistake with its remedy."""
    mark = error.problem_mark or error.context_mark
    line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
    problem, context = str(error.problem or ""), str(error.context or "")
    lines = text.split("\n")
    if "'\\t'" in problem:
        return (line, column), (
            "there is a tab, which YAML does not accept as indentation; use spaces, and set the "
            "editor to do so"
        )
    for number, each in enumerate(lines[:line], start=1):
        if found := _WIDE.match(each):
            return (number, found.end()), (
                "there is a special space, as word processors insert it, which YAML does not "
                "accept as indentation; use plain spaces"
            )
    if found := _DUPLICATE.search(problem):
        first = error.context_mark.line + 1 if error.context_mark else line
        return (line, column), (
            f"the key {found['key']!r} is listed twice in the mapping that begins in line {first}; "
            "keep one"
        )
    if "flow" in context and error.context_mark and not problem.startswith("found undefined"):
        opened, sign = _opened(text, error.context_mark.index)
        if sign:
            return opened, (
                f"{sign!r} opens here and is not closed by {CLOSING[sign]!r}; add that, or a "
                f"comma, before the text in line {line}"
            )
    if (quote := _quoted_far(error, text, line)) is not None:
        return quote
    if (at := _without_space(lines, line)) is not None:
        spot, key = at
        return spot, f"there is no space after the colon of {key!r}; add one"
    return (line, column), _plain(problem)


def _quoted_far(error: MarkedYAMLError, text: str, line: int) -> tuple[Spot, str] | None:
    """Return where a quotation begins that ends in another line, where all went wrong, and why."""
    opened = error.context_mark
    if opened and "quoted" in str(error.context) and "end of stream" in str(error.problem):
        said = "the quotation mark that opens here is not closed; close it"
        return (opened.line + 1, opened.column + 1), said
    last: Any = None
    try:
        for token in YAML(typ="rt", pure=True).scan(text):
            ends = token.end_mark.line
            if isinstance(token, ScalarToken) and token.style and token.style in "'\"":
                last = token if token.start_mark.line < ends == line - 1 else last
    except GARBLED:  # as far as it can be read
        pass
    if last is None:
        return None
    return (last.start_mark.line + 1, last.start_mark.column + 1), (
        f"the quotation mark that opens here is closed in line {line} only; close it where the "
        "text ends"
    )


CLOSING = {"[": "]", "{": "}"}


def _opened(text: str, at: int) -> tuple[Spot, str]:
    """Return the place of the bracket that is open at a place, or begins there, and the bracket.

    Brackets in quotation marks count as well, as a quotation mark may be what is missing.
    """
    open_at: list[tuple[Spot, str]] = []
    for number, line in enumerate(text[: at + 1].split("\n"), start=1):
        for column, sign in enumerate(re.split(r"(?:^|\s)#", line)[0], start=1):
            if sign in CLOSING:
                open_at.append(((number, column), sign))
            elif open_at and sign == CLOSING[open_at[-1][1]]:
                open_at.pop()
    return open_at[-1] if open_at else ((1, 1), "")


def _without_space(lines: list[str], line: int) -> tuple[Spot, str] | None:
    """Return the last colon until this line, of those at hand, without a space, and its key."""
    for at in range(min(line, len(lines)), max(0, line - 4), -1):
        found = _NO_SPACE.match(lines[at - 1])
        if found and found[2]:
            return (at, found.start(2)), found[1]
    return None


SAID = {
    "mapping values are not allowed": "a second colon, or too much indentation; put text with a "
    "colon into quotation marks, and begin keys of one level in one column",
    "could not find expected ':'": "a line that is not a key with a value; write key: value",
    "expected <block end>": "a line that begins in another column than its neighbours; begin keys "
    "and dashes of one level in one column",
    "expected a single document": "a second document behind ---; write one file for each",
    "but found another document": "a second document behind ---; write one file for each",
    "found undefined alias": "{problem}, which has no anchor (&) before it; write the value itself",
    "expected a mapping node": "a tag that requires keys with values, before none; remove it",
    "expected a sequence": "a tag that requires a list, before none; remove it",
    "unknown escape character": "a backslash in double quotation marks starts an escape sequence; "
    "use single quotation marks: 'P\\d{3}'",
    "for merging": "<<: accepts only an alias, as in <<: *base; write the keys out instead",
    "while scanning a quoted": "a quotation mark that is not closed; close it",
    "found unexpected end of stream": "a quotation mark that is not closed; close it",
    "cannot start any token": "a character that cannot begin a value; put it in quotation marks",
    "expected the node content": "a value is missing, or there is an extra comma; write the value",
    "expected <document start>": "a line that is neither a key nor a comment; write key: value",
    "expected '<document start>'": "a line that is neither a key nor a comment; write key: value",
}
"""Messages of the parser, and what they mean for the author of the line."""


def _plain(problem: str) -> str:
    for said, meant in SAID.items():
        if said in problem:
            return f"this is not valid YAML: {meant.replace('{problem}', problem)}"
    return (
        f"this is not valid YAML: {problem}; check indentation, colons and brackets here and above"
    )


TAGS = {"int": "a whole number", "float": "a number", "bool": "true or false", "null": "nothing"}
"""The values that tags of YAML require."""

_TAG = "tag:yaml.org,2002:"


def unreadable(text: str, error: Exception) -> str:
    """Return the place of the first value that does not fit its form or tag, and the remedy.

    A parser that stumbles over such a value says none. Where no value is found, what the parser
    said is returned without one.
    """
    if (found := _first_unlike(text)) is not None:
        (line, column), why = found
        return f":{line}:{column}: {why}"
    return f": this is not valid YAML: {str(error) or repr(error)}"


def _first_unlike(text: str) -> tuple[Spot, str] | None:
    yaml = YAML(typ="rt", pure=True)
    try:
        for node in _values(yaml.compose(text)):
            try:
                yaml.constructor.construct_object(node, deep=True)
            except GARBLED:
                mark = node.start_mark
                return (mark.line + 1, mark.column + 1), _unlike(node)
    except GARBLED:  # told without its line
        return None
    return None


def _unlike(node: ScalarNode) -> str:
    kind = str(node.tag).removeprefix(_TAG)
    if kind == "timestamp":
        return (
            f"this is not valid YAML: {node.value!r} looks like a date or a time but is not one; "
            "correct it, or put it in quotation marks"
        )
    asked = TAGS.get(kind, "something else")
    return (
        f"this is not valid YAML: the tag !!{kind} requires {asked}, which {node.value!r} is not; "
        "remove the tag"
    )


def _values(node: Any, seen: set[int] | None = None) -> Iterator[ScalarNode]:
    """Yield every plain value behind a node once, in the file's order, however many aliases."""
    seen = set() if seen is None else seen
    if isinstance(node, ScalarNode):
        yield node
    elif node is not None and id(node) not in seen:
        seen.add(id(node))
        for each in node.value:
            for inside in each if isinstance(each, tuple) else (each,):
                yield from _values(inside, seen)
