"""A YAML file that keeps the position of every value, so that every mistake gets a line."""

import re
import warnings
from collections.abc import Iterator, Mapping, Sequence, Set
from copy import deepcopy
from dataclasses import dataclass, field
from datetime import date
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, ReusedAnchorWarning
from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from labcrane.errors import ProtocolError, look, unlike
from labcrane.files.complaints import Place as Place  # noqa: PLC0414 - public here
from labcrane.files.complaints import is_member, named, shown, told
from labcrane.files.misread import GARBLED, misread, unreadable
from labcrane.files.model import number_at
from labcrane.limits import LIMITS, LimitError, check_size, foreign

DEEPEST = LIMITS["YAML file"].depth
MOST_MARKS = 20_000
"""Marks of YAML in a file: they, more than its length, determine how long reading takes."""

MOST_VALUES = 50_000
"""Values in a file once every alias is replaced by its anchor's value."""

MOST_BITS = 1000
"""Of a whole number: Python writes down no more than 4,300 digits."""

_MARKS = re.compile(r"[,:\[\]{}\n-]")
_BRACKETS = re.compile(r"[\[\]{}]")
_TWO_WHOLE = re.compile(r"[-+]?\d+,\d+(?![\d.eE])")
_CUT = re.compile(r"[ \t]+(#(?:[^\s#].*|.*\?))\s*$", re.MULTILINE)
_OLD = re.compile(r"(?:\ufeff?(?:[ \t]*(?:#.*)?|%(?!YAML).*)\n)*?(?=%YAML[ \t]+1\.[01](?!\d))")
_STAIRS = re.compile(r"(?:[-?:] *){50}| {200}")

ModelT = TypeVar("ModelT", bound=BaseModel)


@dataclass
class YamlFile:
    """The content of one file, and its mistakes.

    Mistakes are collected, so that :meth:`raise_problems` reports all of them at once.

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

    def position(self, place: Place, *, key: bool = False) -> tuple[int, int]:
        """Return line and column, from 1, of the value at ``place``.

        That is the value where it begins in the line of its key, and the key otherwise, or where
        ``key`` is asked for. What is not there, or came with a merge, gives the place of what holds
        it.
        """
        node, at = self._marked, (0, 0)
        for step in place:
            try:
                named, value, node = _held(node, step)
            except LookupError:
                break
            at = value if value[0] == named[0] and not key else named
        return at[0] + 1, at[1] + 1

    def where(self, place: Place) -> str:
        """Return file, line and column of the value at ``place``, as the beginning of an error."""
        line, column = self.position(place)
        return f"{self.path}:{line}:{column}"

    @property
    def wrong(self) -> int:
        """How many mistakes were noted."""
        return len(self._problems)

    def problem(self, place: Place, message: str, *, key: bool = False) -> None:
        """Note a mistake in the value at ``place``, or in its ``key``.

        Those of another file, one a line, are all noted there.
        """
        line, column = self.position(place, key=key)
        self._problems += [(line, column, each) for each in message.splitlines()]

    def uneven_commas(self) -> Iterator[tuple[Place, str]]:
        """Yield the places of lists whose commas have a space in some cases only.

        With each place comes the first pair of numbers without a space, as written: ``1,5``,
        which may be meant as one number with a decimal comma.
        """
        yield from _uneven_commas(self._marked, (), self.text.split("\n"))

    def cut_texts(self) -> Iterator[tuple[Place, str]]:
        """Yield the places of texts without quotation marks that end at a ``#``.

        With each place comes the rest of the line, if that may be meant as text: it has no space
        behind the ``#``, or ends in a question mark.
        """
        if not _CUT.search(self.text):
            return
        lines = self.text.split("\n")
        for place, node in _plain_texts(YAML(typ="rt", pure=True).compose(self.text), ()):
            end = node.end_mark
            if found := _CUT.match(lines[end.line], end.column):
                yield place, found[1]

    def check(self, model: type[ModelT], place: Place = (), value: Any = None) -> ModelT | None:
        """Return the value at ``place`` as a ``model``, or note its mistakes and return None.

        ``value`` is checked instead where the model gets another value than the one in the file.
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
            for each in told(error.errors(), place, model):
                at = (*place, *_inside(value, each.place))
                self.problem(at, each.message, key=each.key)
            return None

    def but_for_numbers(self, model: type[ModelT], value: Mapping[str, Any]) -> ModelT | None:
        """Return a mapping as a ``model``, with the defaults of what is wrong with its numbers.

        That is what its names can be looked up in: numbers name nothing. None where more is wrong,
        which :meth:`check` notes.
        """
        context = {"folder": self.path.parent, "recorded": self.recorded}
        for _ in range(2):  # what looks at several keys speaks when each is right
            try:
                return model.model_validate(value, context=context)
            except ValidationError as error:
                value = deepcopy(value)
                wrong = {
                    number_at(model, _inside(value, each.place))
                    for each in told(error.errors(), (), model)
                }
            if () in wrong:
                return None
            for *way, key in wrong:
                holder: Any = value
                for step in way:
                    holder = holder[step]
                del holder[key]
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
                f"{self.path}:{line}:{at}: {text}" for line, at, text in sorted(self._problems)
            ]
            raise ProtocolError("\n".join(dict.fromkeys(lines)))


def _uneven_commas(node: Any, place: Place, lines: Sequence[str]) -> Iterator[tuple[Place, str]]:
    if isinstance(node, CommentedMap):
        for key, value in node.items():
            yield from _uneven_commas(value, (*place, str(key)), lines)
    elif isinstance(node, CommentedSeq):
        if len(node) > 2 and all(_is_number(each) for each in node):  # noqa: PLR2004 - of two commas
            if found := _without_a_space(node, lines):
                yield place, found
            return
        for at, value in enumerate(node):
            yield from _uneven_commas(value, (*place, at), lines)


def _plain_texts(node: Any, place: Place) -> Iterator[tuple[Place, ScalarNode]]:
    """Yield the values that are texts without quotation marks, with their places."""
    if isinstance(node, MappingNode):
        for key, value in node.value:
            yield from _plain_texts(value, (*place, str(key.value)))
    elif isinstance(node, SequenceNode):
        for at, value in enumerate(node.value):
            yield from _plain_texts(value, (*place, at))
    elif isinstance(node, ScalarNode) and not node.style and str(node.tag).endswith(":str"):
        yield place, node


def _is_number(node: Any) -> bool:
    return isinstance(node, int | float) and not isinstance(node, bool)


def _without_a_space(node: CommentedSeq, lines: Sequence[str]) -> str:
    """Return the first two whole numbers without the space between them that others have."""
    first, spaced = "", False
    spots = [node.lc.item(at) for at in range(len(node))]
    for (line, column), (below, after) in pairwise(spots):
        apart = below > line or lines[line][after - 1].isspace()
        spaced = spaced or apart
        if not apart and (found := _TWO_WHOLE.match(lines[line], column)):
            first = first or found[0]
    return first if spaced else ""


def _held(node: Any, step: str | int) -> tuple[tuple[int, int], tuple[int, int], Any]:
    """Return where a key and its value begin, from 0, and the value; of an item both are one.

    Raises
    ------
    LookupError
        It is not there, or was merged in from an anchor.
    """
    if isinstance(node, CommentedMap):
        there = node.lc.data or {}
        # A key that is a number in the file is a text everywhere else.
        written = [step] if step in there else [key for key in there if str(key) == step]
        if not written:
            raise LookupError(step)
        return node.lc.key(written[0]), node.lc.value(written[0]), node[written[0]]
    if isinstance(node, CommentedSeq) and isinstance(step, int) and 0 <= step < len(node):
        return node.lc.item(step), node.lc.item(step), node[step]
    raise LookupError(step)


def _inside(value: Any, loc: Place) -> Place:
    """Return the part of pydantic's location that is really in the file."""
    place: list[str | int] = []
    for step in loc:
        is_key = isinstance(value, Mapping) and step in value
        is_item = isinstance(value, list) and isinstance(step, int) and step < len(value)
        if not (is_key or is_item):
            if is_member(step):
                continue  # what pydantic calls one of a union's types
            break
        value = value[step]
        place.append(step)
    return tuple(place)


DOCUMENTS = {
    b"PK\x03\x04": "a Word or LibreOffice document, or another packed file",
    b"\xd0\xcf\x11\xe0": "a Word document",
    b"%PDF": "a PDF",
}
"""Document formats that are not plain text, by their first bytes."""

AS_TEXT = "save it as plain text in UTF-8"


def read_text(path: Path) -> str:
    """Return the text of a file in UTF-8 that people write.

    Raises
    ------
    ProtocolError
        There is none, it is too large, or it is not text.
    """
    try:
        check_size(path.stat().st_size, "YAML file", "it")
        if not path.is_file():
            raise ProtocolError(f"{path} is not a file; give the path of a YAML file")
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ProtocolError(
            f"{path} does not exist; check its name, and the folder you are in"
        ) from None
    except LimitError as error:
        raise ProtocolError(f"{path} cannot be read: {error}; split it up") from None
    except UnicodeDecodeError as error:
        raw: bytes = error.object
        for begins, what in DOCUMENTS.items():
            if raw.startswith(begins):
                raise ProtocolError(f"{path} is {what}; {AS_TEXT}") from None
        if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
            raise ProtocolError(
                f"{path}:1:1: byte 0x{raw[0]:02X} is not UTF-8; the file is in UTF-16: open it in "
                "an editor and save it as UTF-8"
            ) from None
        at = _place_in(raw[: error.start].decode())
        raise ProtocolError(
            f"{path}:{at}: byte 0x{raw[error.start]:02X} is not UTF-8; open the file in an "
            "editor and save it as UTF-8"
        ) from None
    except (OSError, ValueError) as error:  # a path with a NUL
        raise ProtocolError(f"{path} cannot be read: {error}") from error
    if text.startswith("{\\rtf"):
        raise ProtocolError(f"{path} is an RTF document; {AS_TEXT}")
    return text


def read_yaml(path: Path) -> Any:
    """Return the content of a YAML file as plain values, dates as dates.

    Raises
    ------
    ProtocolError
        As :func:`read_text`, or the text is not valid YAML.
    """
    return parse_yaml(read_text(path), str(path))


def parse_yaml(text: str, name: str, *, recorded: bool = False) -> Any:
    """Return the content of a text of YAML as plain values, dates as dates.

    Parameters
    ----------
    name
        Name of the text, for messages.
    recorded
        Whether it is part of a record: earlier versions allowed characters that are refused now,
        and anchors that are defined twice.

    Raises
    ------
    ProtocolError
        It is not valid YAML, or exceeds the limits of length, depth or number of values.
    """
    return _plain(_load(text, name, recorded=recorded), name, recorded=recorded)


class _Misfit(Exception):  # noqa: N818 - it is reported as an error of the protocol
    """A value that no file may contain, and the line and column of its container, where known."""

    at: str | None = None


def _check_key(node: Any, key: Any, others: Mapping[str, Any], looks: dict[str, str]) -> None:
    """Refuse a key that is not a name, or that equals another one as a text or by its looks."""
    if key is None or isinstance(key, Mapping | list | tuple):
        what = "nothing" if key is None else "a mapping or a list"
        why = f"has {what} for a key; write a name, in quotation marks if it is one"
    elif len(str(key).splitlines()) > 1:
        why = f"has a line end in the key {str(key)[:40]!r}; write it in one line"
    elif (sign := foreign(str(key))) is not None:
        why = f"has the character U+{ord(sign):04X} in the key {str(key)[:40]!r}; leave it out"
    elif str(key) in others:
        why = f"has the key {str(key)!r} twice, with and without quotation marks; keep one"
    elif (other := looks.setdefault(look(str(key)), str(key))) != str(key):
        why = f"has the keys {other!r} and {str(key)!r}. {unlike(str(key), other)}; rename one"
    else:
        return
    misfit = _Misfit(why)
    misfit.at = _place_of(node, key, key=True)
    raise misfit


def _scalar(node: Any, *, recorded: bool) -> Any:
    if isinstance(node, bytes) and not recorded:
        raise _Misfit("holds bytes, by the tag !!binary; write text")
    if node is None or isinstance(node, bool | date | bytes):
        return node
    if isinstance(node, int) and node.bit_length() > MOST_BITS:
        raise _Misfit(f"holds a whole number of {node.bit_length()} bits; write less")
    if isinstance(node, str) and not recorded and (sign := foreign(node)) is not None:
        raise _Misfit(
            f"contains the character U+{ord(sign):04X} in {str(node)[:40]!r}, which is not "
            "allowed; remove it"
        )
    for kind in (int, float, str):
        if isinstance(node, kind):
            return kind(node)
    written = getattr(node, "value", node)
    raise _Misfit(f"holds {str(written)[:40]!r} with a tag; write plain values")


@lru_cache(maxsize=64)
def _load(text: str, name: str, *, recorded: bool = False) -> Any:
    """Return the data that ruamel.yaml reads; read-only and cached, as scenes are read often."""
    try:
        check_size(len(text), "YAML file", "it")
    except LimitError as error:
        raise ProtocolError(f"{name} cannot be read: {error}; split it up") from None
    if len(_MARKS.findall(text)) > MOST_MARKS:
        raise ProtocolError(
            f"{name} has more than {MOST_MARKS} commas, colons, brackets, dashes and line ends; "
            "split it up"
        )
    if (at := _too_deep(text)) is not None:
        where = _place_in(text[:at])
        raise ProtocolError(f"{name}:{where}: nested deeper than {DEEPEST} levels; write it flat")
    _check_version(text, name, recorded=recorded)
    try:
        # Also where no line is asked for: the plain loader copies each merge into the next.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore" if recorded else "error", ReusedAnchorWarning)
            return YAML(typ="rt", pure=True).load(text)
    except ReusedAnchorWarning as error:
        # The second of the two places in the message.
        where = ":".join(re.findall(r"line (\d+), column (\d+)", str(error))[-1])
        raise ProtocolError(
            f"{name}:{where}: this is not valid YAML: an anchor is defined twice; give each anchor "
            "its own name"
        ) from error
    except MarkedYAMLError as error:
        (line, column), why = misread(error, text)
        raise ProtocolError(f"{name}:{line}:{column}: {why}") from error
    except ReaderError as error:
        if text[:4].count("\0") > 1:
            raise ProtocolError(
                f"{name}:1:1: every other byte is 0, as in UTF-16; open the file in an editor and "
                "save it as UTF-8"
            ) from error
        raise ProtocolError(
            f"{name}:{_place_in(text[: error.position])}: this is not valid YAML: it contains the "
            f"character U+{_code(error):04X}, which is not allowed; remove it"
        ) from error
    except RecursionError:
        raise ProtocolError(
            f"{name} is nested deeper than {DEEPEST} levels; write it flat"
        ) from None
    # Impossible dates, numbers of too many digits, tags on what they do not fit, and whatever else
    # ruamel.yaml stumbles over: it does not say what it raises.
    except GARBLED as error:
        raise ProtocolError(f"{name}{unreadable(text, error)}") from error


def _check_version(text: str, name: str, *, recorded: bool) -> None:
    """Refuse a file of an older YAML version, which reads words and times differently."""
    if not recorded and (found := _OLD.match(text)):
        raise ProtocolError(
            f"{name}:{_place_in(found[0])}: the file asks for YAML 1.1, in which no is false and "
            "1:30 is 90; remove this line"
        )


def _code(error: ReaderError) -> int:
    return error.character if isinstance(error.character, int) else ord(error.character)


def _place_in(before: str) -> str:
    """Return line and column, from 1, of what a text stands before."""
    return f"{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"


def _too_deep(text: str) -> int | None:
    """Return where brackets, dashes or indentation nest too deep; None where nothing does.

    Brackets inside quotes count as well; real files have no such depth.
    """
    depth, begin = 0, 0
    for line in text.split("\n"):
        if stairs := _STAIRS.match(line):
            return begin + stairs.end() - 1
        for found in _BRACKETS.finditer(line):
            depth = depth + 1 if found[0] in "[{" else max(0, depth - 1)
            if depth > DEEPEST:
                return begin + found.start()
        begin += len(line) + 1
    return None


def _plain(node: Any, name: str, *, recorded: bool = False) -> Any:
    """Return a node as plain values; values that aliases repeat are counted each time."""
    left = [MOST_VALUES]

    def plain(node: Any, depth: int) -> Any:
        left[0] -= 1
        if left[0] < 0 or depth > 2 * DEEPEST:
            raise ProtocolError(
                f"{name} contains more than {MOST_VALUES} values, or itself, through its aliases; "
                "use fewer of them"
            )
        at: Any = None
        try:
            if isinstance(node, Mapping):
                held: Any = {}
                looks: dict[str, str] = {}
                for at, value in node.items():
                    if not recorded:
                        _check_key(node, at, held, looks)
                    held[str(at)] = plain(value, depth + 1)
            elif isinstance(node, list | tuple | Set):
                held = []
                for value in node:
                    at = len(held)
                    held.append(plain(value, depth + 1))
            else:
                held = _scalar(node, recorded=recorded)
        except _Misfit as error:
            error.at = error.at or _place_of(node, at)
            raise
        return held

    try:
        return plain(node, 0)
    except _Misfit as error:
        where = f"{name}:{error.at}: it" if error.at else name
        raise ProtocolError(f"{where} {error}") from None


def _place_of(node: Any, at: Any, *, key: bool = False) -> str | None:
    """Return line and column of what a mapping or a list holds; None where they are not known."""
    try:
        line, column = _held(node, at)[0 if key else 1]
    except LookupError:
        return None
    return f"{line + 1}:{column + 1}"
