"""A YAML file that remembers where everything stands, so that every mistake gets a line."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError

from labcrane.errors import ProtocolError, suggestion

ModelT = TypeVar("ModelT", bound=BaseModel)
Place = tuple[str | int, ...]
"""The keys and indices that lead to a value: ``("sessions", 0, "steps", 2)``."""


@dataclass
class YamlFile:
    """One file's content, and what is wrong with it.

    Mistakes are collected, so that all of them are told at once by :meth:`raise_problems`.

    Attributes
    ----------
    path
        As the user wrote it.
    text
        The file, as it is.
    data
        Its content as plain dicts, lists, strings and numbers.
    """

    path: Path
    text: str
    data: Any
    _marked: Any = None
    _problems: list[tuple[int, str]] = field(default_factory=list)

    @classmethod
    def read(cls, path: Path) -> "YamlFile":
        """Read ``path``; a file that is missing or no YAML raises :class:`ProtocolError`."""
        try:
            text = path.read_text(encoding="utf-8")
            marked = YAML(typ="rt").load(text)
        except FileNotFoundError:
            raise ProtocolError(
                f"{path} does not exist; check its name, and the folder you are in"
            ) from None
        except (OSError, UnicodeDecodeError) as error:
            raise ProtocolError(f"{path} cannot be read: {error}") from error
        except MarkedYAMLError as error:
            line = error.problem_mark.line + 1 if error.problem_mark else 1
            raise ProtocolError(f"{path}:{line}: this is no YAML: {error.problem}") from error
        return cls(path, text, _plain(marked), marked)

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
        """Note a mistake at ``place``."""
        self._problems.append((self.line(place), message))

    def check(self, model: type[ModelT], place: Place = (), value: Any = None) -> ModelT | None:
        """Return what stands at ``place`` as a ``model``, or note what is wrong and return None.

        ``value`` is checked instead where what the model sees is not what stands in the file.
        """
        if value is None:
            value = self.data
            for step in place:
                value = value[step]
        if not isinstance(value, Mapping):
            self.problem(place, f"{_name(place)} must be a mapping of keys, but is {value!r}")
            return None
        try:
            return model.model_validate(value, context={"folder": self.path.parent})
        except ValidationError as error:
            for each in error.errors():
                self.problem((*place, *_inside(value, each)), explain(each, place, model))
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
            lines = [f"{self.path}:{line}: {message}" for line, message in sorted(self._problems)]
            raise ProtocolError("\n".join(dict.fromkeys(lines)))


def explain(error: ErrorDetails, place: Place, model: type[BaseModel]) -> str:
    """Return what was written and what is possible, for one of pydantic's complaints."""
    loc = error["loc"]
    key = loc[-1] if loc else _name(place)
    if error["type"] == "extra_forbidden":
        possible = _keys(model, loc[:-1])
        instead = suggestion(str(key), possible, "possible:")
        return f"{str(key)!r} is not a key of {_name((*place, *loc[:-1]))}; {instead}"
    if error["type"] == "missing":
        return f"{_name((*place, *loc[:-1]))} needs {str(key)!r}"
    what = error["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    if error["type"] == "value_error":
        return f"{_name((*place, *loc))}: {what}"
    return f"{_name((*place, *loc))} is {error['input']!r}; it must be {what}"


def _keys(model: type[BaseModel], place: Place) -> list[str]:
    fields: Any = model
    for step in place:
        if isinstance(step, int):
            continue
        annotation = fields.model_fields[step].annotation if step in fields.model_fields else None
        nested = [a for a in (annotation, *getattr(annotation, "__args__", ())) if _is_model(a)]
        if not nested:
            return []
        fields = nested[0]
    return list(fields.model_fields)


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _inside(value: Any, error: ErrorDetails) -> Place:
    """Return the part of pydantic's location that is really in the file."""
    place: list[str | int] = []
    for step in error["loc"]:
        is_key = isinstance(value, Mapping) and step in value
        is_item = isinstance(value, list) and isinstance(step, int) and step < len(value)
        if not (is_key or is_item):
            break
        value = value[step]
        place.append(step)
    return tuple(place)


def _name(place: Place) -> str:
    text = ""
    for step in place:
        text += f"[{step + 1}]" if isinstance(step, int) else f".{step}" if text else str(step)
    return text or "the file"


def _plain(node: Any) -> Any:
    if isinstance(node, CommentedMap):
        return {str(key): _plain(value) for key, value in node.items()}
    if isinstance(node, CommentedSeq):
        return [_plain(value) for value in node]
    if isinstance(node, bool) or node is None:
        return node
    for kind in (int, float, str):
        if isinstance(node, kind):
            return kind(node)
    return node
