"""A YAML file that remembers where everything stands, so that every mistake gets a line."""

import re
import warnings
from collections.abc import Mapping, Set
from dataclasses import dataclass, field
from datetime import date
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, ReusedAnchorWarning
from ruamel.yaml.reader import ReaderError

from labcrane.errors import ProtocolError
from labcrane.files.complaints import Place as Place  # noqa: PLC0414 - public here
from labcrane.files.complaints import named, shown, told
from labcrane.files.misread import GARBLED, misread, unreadable
from labcrane.limits import LIMITS, LimitError, check_size, foreign

DEEPEST = LIMITS["YAML file"].depth
MOST_MARKS = 20_000
"""Marks of YAML in a file: they, more than its length, are what reading it takes time for."""

MOST_VALUES = 50_000
"""Values in a file once every alias stands for what it names."""

MOST_BITS = 1000
"""Of a whole number: Python writes down no more than 4,300 digits."""

_MARKS = re.compile(r"[,:\[\]{}\n-]")
_BRACKETS = re.compile(r"[\[\]{}]")
_STAIRS = re.compile(r"(?:[-?:] *){50}| {200}")

ModelT = TypeVar("ModelT", bound=BaseModel)


@dataclass
class YamlFile:
    """One file's content, and what is wrong with it.

    Mistakes are collected, so that all of them are told at once by :meth:`raise_problems`.

    Attributes
    ----------
    path
        As the user wrote it.
    recorded
        Whether it was run, and is a record: rules that only judge do not hold for it.
    text
        The file, as it is.
    data
        Its content as plain dicts, lists, strings and numbers.
    """

    path: Path
    text: str
    data: Any
    _marked: Any = None
    _problems: list[tuple[int, int, str]] = field(default_factory=list)
    recorded: bool = False

    @classmethod
    def read(cls, path: Path, *, recorded: bool = False) -> "YamlFile":
        """Read ``path``; a file that is missing or no YAML raises :class:`ProtocolError`."""
        text = read_text(path)
        marked = _load(text, str(path), recorded=recorded)
        data = _plain(marked, str(path), recorded=recorded)
        return cls(path, text, data, marked, recorded=recorded)

    def line(self, place: Place) -> int:
        """Return the line, counted from 1, of the key or list item at ``place``.

        A place that does not exist (a missing key) gives the line of what should hold it.
        """
        node, line = self._marked, 1
        for step in place:
            if isinstance(node, CommentedMap) and step in node:
                line = node.lc.key(step)[0] + 1
            elif isinstance(node, CommentedSeq) and isinstance(step, int) and step < len(node):
                line = node.lc.item(step)[0] + 1
            else:
                break
            node = node[step]
        return line

    def problem(self, place: Place, message: str) -> None:
        """Note a mistake at ``place``; those of another file, one a line, are all noted there."""
        self._problems += [(self.line(place), 0, line) for line in message.splitlines()]

    def misnamed(self, place: Place, message: str, *, key: bool = False) -> None:
        """Note a mistake in the value at ``place``, or in its key, with line and column."""
        line, column = self._position(place, key=key)
        self._problems += [(line, column, each) for each in message.splitlines()]

    def _position(self, place: Place, *, key: bool) -> tuple[int, int]:
        """Return line and column, from 1, of the value at ``place``; column 0 where none is known.

        What a merge or a default brought stands somewhere else: its line is that of what holds it.
        """
        node = self._marked
        for step in place[:-1]:
            inside = isinstance(node, CommentedMap) and step in node
            if not inside and not (isinstance(node, CommentedSeq) and _is_index(step, node)):
                return self.line(place), 0
            node = node[step]
        last = place[-1] if place else None
        try:
            if isinstance(node, CommentedMap) and last in node:
                line, column = node.lc.key(last) if key else node.lc.value(last)
            elif isinstance(node, CommentedSeq) and _is_index(last, node):
                line, column = node.lc.item(last)
            else:
                return self.line(place), 0
        except KeyError:  # merged in from an anchor
            return self.line(place[:-1]), 0
        return line + 1, column + 1

    def check(self, model: type[ModelT], place: Place = (), value: Any = None) -> ModelT | None:
        """Return what stands at ``place`` as a ``model``, or note what is wrong and return None.

        ``value`` is checked instead where what the model sees is not what stands in the file.
        """
        if value is None:
            value = self.data
            for step in place:
                value = value[step]
        if not isinstance(value, Mapping):
            self.problem(
                place,
                f"{named(place)} is {shown(value)}; it must be a mapping of keys: {{key: value}}",
            )
            return None
        try:
            context = {"folder": self.path.parent, "recorded": self.recorded}
            return model.model_validate(value, context=context)
        except ValidationError as error:
            for at, message in told(error.errors(), place, model):
                self.problem((*place, *_inside(value, at)), message)
            return None

    def checked(self, model: type[ModelT]) -> ModelT:
        """Return the whole file as a ``model``, or raise all mistakes in it."""
        found = self.check(model)
        self.raise_problems()
        if found is None:
            raise AssertionError("what is wrong with a file is a problem, and problems were raised")
        return found

    def raise_problems(self) -> None:
        """Raise :class:`ProtocolError` with one line for every mistake, in the file's order."""
        if self._problems:
            lines = [
                f"{self.path}:{line}:{column}: {text}" if column else f"{self.path}:{line}: {text}"
                for line, column, text in sorted(self._problems)
            ]
            raise ProtocolError("\n".join(dict.fromkeys(lines)))


def _inside(value: Any, loc: Place) -> Place:
    """Return the part of pydantic's location that is really in the file."""
    place: list[str | int] = []
    for step in loc:
        is_key = isinstance(value, Mapping) and step in value
        is_item = isinstance(value, list) and isinstance(step, int) and step < len(value)
        if not (is_key or is_item):
            break
        value = value[step]
        place.append(step)
    return tuple(place)


def _is_index(step: object, node: CommentedSeq) -> bool:
    return isinstance(step, int) and 0 <= step < len(node)


def read_text(path: Path) -> str:
    """Return the text of a file in UTF-8 that people write.

    Raises
    ------
    ProtocolError
        There is none, it is larger than such files are, or no text.
    """
    try:
        check_size(path.stat().st_size, "YAML file", "it")
        if not path.is_file():
            raise ProtocolError(f"{path} is no file; give a YAML file")
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ProtocolError(
            f"{path} does not exist; check its name, and the folder you are in"
        ) from None
    except LimitError as error:
        raise ProtocolError(f"{path} cannot be read: {error}; split it up") from None
    except UnicodeDecodeError as error:
        raw: bytes = error.object
        if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
            raise ProtocolError(
                f"{path}:1: byte 0x{raw[0]:02X} is no UTF-8; the file is in UTF-16: open it in an "
                "editor and save it as UTF-8"
            ) from None
        line = raw.count(b"\n", 0, error.start) + 1
        raise ProtocolError(
            f"{path}:{line}: byte 0x{raw[error.start]:02X} is no UTF-8; open the file in an "
            "editor and save it as UTF-8"
        ) from None
    except (OSError, ValueError) as error:  # a path with a NUL
        raise ProtocolError(f"{path} cannot be read: {error}") from error


def read_yaml(path: Path) -> Any:
    """Return the content of a YAML file as plain values, dates as dates.

    Raises
    ------
    ProtocolError
        As :func:`read_text`, or the text is no YAML.
    """
    return parse_yaml(read_text(path), str(path))


def parse_yaml(text: str, name: str, *, recorded: bool = False) -> Any:
    """Return the content of a text of YAML as plain values, dates as dates.

    Parameters
    ----------
    name
        What the text is, for the message when it is none.
    recorded
        Whether it is part of a record: characters that are no writing, and anchors given twice,
        were once let in.

    Raises
    ------
    ProtocolError
        It is no YAML, or longer, deeper or larger behind its aliases than may be.
    """
    return _plain(_load(text, name, recorded=recorded), name, recorded=recorded)


class _Misfit(Exception):  # noqa: N818 - it is told as an error of the protocol
    """A value that no file may hold, and the line of what holds it, where that is known."""

    line: int | None = None


def _scalar(node: Any, *, recorded: bool) -> Any:
    if node is None or isinstance(node, bool | date | bytes):
        return node
    if isinstance(node, int) and node.bit_length() > MOST_BITS:
        raise _Misfit(f"holds a whole number of {node.bit_length()} bits; write less")
    if isinstance(node, str) and not recorded and (sign := foreign(node)) is not None:
        raise _Misfit(
            f"holds the character U+{ord(sign):04X} in {str(node)[:40]!r}, which is no "
            "writing; leave it out"
        )
    for kind in (int, float, str):
        if isinstance(node, kind):
            return kind(node)
    written = getattr(node, "value", node)
    raise _Misfit(f"holds {str(written)[:40]!r} with a tag; write plain values")


@lru_cache(maxsize=64)
def _load(text: str, name: str, *, recorded: bool = False) -> Any:
    """Return what ruamel.yaml makes of a text, which nobody changes: a scene is read many times."""
    try:
        check_size(len(text), "YAML file", "it")
    except LimitError as error:
        raise ProtocolError(f"{name} cannot be read: {error}; split it up") from None
    if len(_MARKS.findall(text)) > MOST_MARKS:
        raise ProtocolError(
            f"{name} has more than {MOST_MARKS} commas, colons, brackets, dashes and line ends; "
            "split it up"
        )
    if (line := _too_deep(text)) is not None:
        raise ProtocolError(f"{name}:{line}: nested deeper than {DEEPEST} levels; write it flat")
    try:
        # Also where no line is asked for: the plain loader copies each merge into the next.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore" if recorded else "error", ReusedAnchorWarning)
            return YAML(typ="rt", pure=True).load(text)
    except ReusedAnchorWarning as error:
        line = max(map(int, re.findall(r"line (\d+)", str(error))), default=1)
        raise ProtocolError(
            f"{name}:{line}: this is no YAML that can be trusted: an anchor is given twice; give "
            "each its own name"
        ) from error
    except MarkedYAMLError as error:
        line, why = misread(error, text)
        raise ProtocolError(f"{name}:{line}: {why}") from error
    except ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        if text[:4].count("\0") > 1:
            raise ProtocolError(
                f"{name}:1: every other byte is 0, as in UTF-16; open the file in an editor and "
                "save it as UTF-8"
            ) from error
        raise ProtocolError(
            f"{name}:{line}: this is no YAML: it holds the character U+{_code(error):04X}, which "
            "no text may; remove it"
        ) from error
    except RecursionError:
        raise ProtocolError(
            f"{name} is nested deeper than {DEEPEST} levels; write it flat"
        ) from None
    # Impossible dates, numbers of too many digits, tags on what they do not fit, and whatever else
    # ruamel.yaml stumbles over: it does not say what it raises.
    except GARBLED as error:
        raise ProtocolError(f"{name}{unreadable(text, error)}") from error


def _code(error: ReaderError) -> int:
    return error.character if isinstance(error.character, int) else ord(error.character)


def _too_deep(text: str) -> int | None:
    """Return the line in which brackets, dashes or indentation nest too deep; None if none does.

    What looks nested inside quotes counts as well: nobody writes so.
    """
    depth = 0
    for number, line in enumerate(text.split("\n"), start=1):
        if _STAIRS.match(line):
            return number
        for sign in _BRACKETS.findall(line):
            depth = depth + 1 if sign in "[{" else max(0, depth - 1)
            if depth > DEEPEST:
                return number
    return None


def _plain(node: Any, name: str, *, recorded: bool = False) -> Any:
    """Return a node as plain values; what aliases repeat is counted as often as it is there."""
    left = [MOST_VALUES]

    def plain(node: Any, depth: int) -> Any:
        left[0] -= 1
        if left[0] < 0 or depth > 2 * DEEPEST:
            raise ProtocolError(
                f"{name} holds more than {MOST_VALUES} values, or itself, behind its aliases; "
                "write fewer of them"
            )
        at: Any = None
        try:
            if isinstance(node, Mapping):
                held: Any = {}
                for at, value in node.items():
                    held[str(at)] = plain(value, depth + 1)
            elif isinstance(node, list | tuple | Set):
                held = []
                for value in node:
                    at = len(held)
                    held.append(plain(value, depth + 1))
            else:
                held = _scalar(node, recorded=recorded)
        except _Misfit as error:
            error.line = error.line or _line_in(node, at)
            raise
        return held

    try:
        return plain(node, 0)
    except _Misfit as error:
        where = f"{name}:{error.line}: it" if error.line else name
        raise ProtocolError(f"{where} {error}") from None


def _line_in(node: Any, at: Any) -> int | None:
    """Return the line, from 1, of what a mapping or a list holds; None where it is not known."""
    try:
        if isinstance(node, CommentedMap):
            return int(node.lc.value(at)[0]) + 1
        if isinstance(node, CommentedSeq):
            return int(node.lc.item(at)[0]) + 1
    except KeyError:  # merged in from an anchor
        pass
    return None
