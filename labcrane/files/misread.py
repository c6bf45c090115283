"""Why a text is no YAML, in the words of those who write one, and the line in which it went wrong.

A parser notices a mistake where it can go on no more, which is often a line later.
"""

import re

from ruamel.yaml.error import MarkedYAMLError

_WIDE = re.compile(r"[ \t]*[\u00a0\u2000-\u200b\u202f\u3000]")
_NO_SPACE = re.compile(r"\s*(?:- +)?([A-Za-z_][\w-]*):([^\s/].*)?$")
_DUPLICATE = re.compile(r'found duplicate key "(?P<key>[^"]*)"')


def misread(error: MarkedYAMLError, text: str) -> tuple[int, str]:
    """Return the line, from 1, and what is wrong there and what to do."""
    mark = error.problem_mark or error.context_mark
    line = mark.line + 1 if mark else 1
    problem, context = str(error.problem or ""), str(error.context or "")
    lines = text.split("\n")
    if "'\\t'" in problem:
        return line, (
            "there is a tab, which YAML does not take for indentation; write spaces, and set the "
            "editor to do so"
        )
    for number, each in enumerate(lines[:line], start=1):
        if _WIDE.match(each):
            return number, (
                "there is a space of another kind, which YAML does not take for indentation, as "
                "word processors write it; write plain spaces"
            )
    if found := _DUPLICATE.search(problem):
        first = error.context_mark.line + 1 if error.context_mark else line
        return line, (
            f"the key {found['key']!r} is there twice in what begins in line {first}; keep one"
        )
    if "flow" in context and error.context_mark and not problem.startswith("found undefined"):
        opened = error.context_mark.line + 1
        sign = lines[opened - 1][error.context_mark.column : error.context_mark.column + 1]
        closing = {"[": "]", "{": "}"}.get(sign, "its end")
        return opened, (
            f"{sign!r} opens here and is not closed as it should be, by {closing!r}; add that, or "
            f"a comma, before what stands in line {line}"
        )
    if (at := _without_space(lines, line)) is not None:
        key = _NO_SPACE.match(lines[at - 1])
        return at, f"there is no space behind the colon of {key[1] if key else 'a key'!r}; add one"
    return line, _plain(problem)


def _without_space(lines: list[str], line: int) -> int | None:
    """Return the last line until this one, of those at hand, whose colon has no space behind it."""
    for at in range(min(line, len(lines)), max(0, line - 4), -1):
        found = _NO_SPACE.match(lines[at - 1])
        if found and found[2]:
            return at
    return None


SAID = {
    "mapping values are not allowed": "a second colon, or too much indentation; put text with a "
    "colon into quotation marks, and begin keys of one level in one column",
    "could not find expected ':'": "a line that is no key with its value; write key: value",
    "expected <block end>": "a line that begins in another column than those beside it; begin keys "
    "and dashes of one level in one column",
    "expected a single document": "a second document behind ---; write one file for each",
    "but found another document": "a second document behind ---; write one file for each",
    "found undefined alias": "{problem}, whose anchor, &, is nowhere before it; write what it "
    "stands for",
    "for merging": "<<: takes what an anchor names, as <<: *base, and nothing else; write keys out",
    "while scanning a quoted": "a quotation mark that is not closed; close it",
    "found unexpected end of stream": "a quotation mark that is not closed; close it",
    "cannot start any token": "a sign that cannot begin a value; put it into quotation marks",
    "expected the node content": "a value is missing, or one comma is too many; write the value",
    "expected <document start>": "a line that is neither a key nor a comment; write key: value",
    "expected '<document start>'": "a line that is neither a key nor a comment; write key: value",
}
"""What a parser says, and what it means to whoever wrote the line."""


def _plain(problem: str) -> str:
    for said, meant in SAID.items():
        if said in problem:
            return f"this is no YAML: {meant.replace('{problem}', problem)}"
    return f"this is no YAML: {problem}; look at indentation, colons and brackets here and above"
