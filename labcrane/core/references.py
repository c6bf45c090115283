"""References: names in fields of a component's settings, and the names that components provide.

A plugin annotates the field, and the core looks the name up once every component of the protocol is
known; the message has the line, what there is, and the nearest name::

    trigger: ButtonName = "right.trigger"
    map: Annotated[dict[JointName, AxisName], Covers("joint"), Once()]

These are names only, so that a protocol is checked without loading the components.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.fields import FieldInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from labcrane.errors import nearest

Place = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class Reference:
    """A mark on a field's type: its text is a name.

    Attributes
    ----------
    kind
        Kind of the name; :meth:`Settings.provides` returns the names of every kind.
    signed
        Whether a leading minus is allowed, which inverts the axis.
    own
        Whether the component itself must provide it: the settings with the field, or else those
        around them.
    of
        The key next to it that names a view, which must provide it.
    """

    kind: str
    signed: bool = False
    own: bool = False
    of: str = ""

    def bare(self, name: str) -> str:
        """Return a written name without its sign."""
        return name.removeprefix("-") if self.signed else name


@dataclass(frozen=True, slots=True)
class Covers:
    """A mark on a mapping's type: its keys are all names of a kind.

    Attributes
    ----------
    kind
        What the keys name.
    own
        Whether they name what the component itself provides.
    otherwise
        What a study can do whose input has fewer axes than there are names, for the message.
    """

    kind: str
    own: bool = False
    otherwise: str = ""


@dataclass(frozen=True, slots=True)
class Once:
    """A mark on a mapping's or a list's type: no two of its values are the same name."""


Mark = Reference | Covers | Once

AxisName = Annotated[str, Field(pattern=r"^-?[a-z][a-z0-9_.]*$"), Reference("axis", signed=True)]
"""An axis of the input, ``right.y``; a leading minus inverts it."""

InputAxis = Annotated[
    str, Field(pattern=r"^-?[a-z][a-z0-9_.]*$"), Reference("axis of the input", signed=True)
]
"""An axis of the input, named by its substitute: an operator's own axes are different ones."""

ButtonName = Annotated[str, Reference("button")]
"""A button: an axis of the input that is pressed or not, and has no sign: ``right.trigger``. For an
input that does not state which of its axes are buttons, any axis: names do not tell."""

JointName = Annotated[str, Reference("joint")]
"""A joint of the machine."""

LinkName = Annotated[str, Reference("link")]
"""A link of the machine; each has the name of the joint before it."""

SignalName = Annotated[str, Reference("signal")]
"""A number of the machine's state, the scheme's command or the task: ``joint.angle.slew``."""

EventName = Annotated[str, Reference("event")]
"""An event of the session or of a task: ``trial.start``."""

EstimateValue = Annotated[str, Reference("estimate")]
"""A value of an estimate of the protocol: ``load.ratio``."""

SceneObject = Annotated[str, Reference("object")]
"""A visible object: the tip, a link, a target, the shape of a cue, an object of a scene."""

ViewName = Annotated[str, Reference("view")]
"""A view of the protocol."""

CameraName = Annotated[str, Reference("camera", own=True)]
"""A camera of the view itself."""


@dataclass(frozen=True, slots=True, eq=False)  # types are looked up by hash, and it holds a mapping
class Preset:
    """A mark on a settings type: a name selects settings that the plugin comes with.

    Attributes
    ----------
    kind
        The kind of thing, for the message: ``camera``.
    named
        The settings of each name.

    Examples
    --------
    >>> Camera = Annotated[CameraSettings, Preset("camera", {"cab": CameraSettings(...)})]
    """

    kind: str
    named: Mapping[str, BaseModel]

    def __get_pydantic_core_schema__(
        self, source: type, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Replace a name by its settings."""
        return core_schema.no_info_before_validator_function(self._found, handler(source))

    def __get_pydantic_json_schema__(
        self, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Add the names to the schema."""
        return {"anyOf": [{"enum": list(self.named), "type": "string"}, handler(core)]}

    def _found(self, value: Any) -> Any:
        if not isinstance(value, str):
            return value
        if value not in self.named:
            there = nearest(value, list(self.named), "there is")
            raise ValueError(f"there is no such {self.kind} as {value!r}; {there}")
        return self.named[value]


@dataclass(frozen=True, slots=True)
class Mentioned:
    """A mark, and the value at its place.

    Attributes
    ----------
    place
        The keys and indices below the component's settings; with ``key`` the key itself is meant.
    holders
        The settings that contain it, from the outermost to those with the field.
    """

    mark: Mark
    place: Place
    value: Any
    key: bool = False
    holders: tuple[BaseModel, ...] = field(default=(), compare=False)


def mentioned(settings: BaseModel) -> Iterator[Mentioned]:
    """Yield every mark on a written value of a protocol, with its place and its value.

    Defaults are left out: :meth:`Settings.needs` returns the names that they refer to.
    """
    for name, about in type(settings).model_fields.items():
        if name in settings.model_fields_set:
            value, key = getattr(settings, name), about.alias or name
            for each in _of_field(about, (key,), value):
                yield replace(each, holders=(settings, *each.holders))


def _of_field(about: FieldInfo, place: Place, value: Any) -> Iterator[Mentioned]:
    yield from _marked(about.metadata, place, value)
    yield from _within(about.annotation, place, value)


def _marked(metadata: list[Any], place: Place, value: Any, *, key: bool = False) -> Iterator[Any]:
    for mark in metadata:
        if isinstance(mark, Mark) and value is not None:
            yield Mentioned(mark, place, value, key)


def _within(annotation: Any, place: Place, value: Any, *, key: bool = False) -> Iterator[Any]:
    """Yield the marks inside a type: behind Annotated, in unions, mappings and lists."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if isinstance(value, BaseModel):
        for each in mentioned(value):
            yield replace(each, place=(*place, *each.place))
    elif origin is Annotated:
        yield from _marked(list(annotation.__metadata__), place, value, key=key)
        yield from _within(arguments[0], place, value, key=key)
    elif origin in {Union, UnionType}:
        for one in arguments:
            if _fits(one, value):
                yield from _within(one, place, value, key=key)
    elif arguments:
        yield from _items(arguments, place, value)


def _items(arguments: tuple[Any, ...], place: Place, value: Any) -> Iterator[Any]:
    """Yield the marks in a mapping's keys and values, and in a list's items."""
    if isinstance(value, Mapping):
        kind_of_key, kind = arguments
        for name, item in value.items():
            yield from _within(kind_of_key, (*place, name), name, key=True)
            yield from _within(kind, (*place, name), item)
    elif isinstance(value, list | tuple):
        for number, (each, item) in enumerate(zip(_types(arguments, value), value, strict=True)):
            yield from _within(each, (*place, number), item)


def _types(arguments: tuple[Any, ...], value: Sequence[Any]) -> Sequence[Any]:
    """Return the type of each item of a list, or of a tuple of any length or a fixed one."""
    fixed = len(arguments) == len(value) and Ellipsis not in arguments
    return arguments if fixed else (arguments[:1] or (Any,)) * len(value)


def _fits(annotation: Any, value: Any) -> bool:
    """Whether a value can be of this member of a union."""
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    kind = get_origin(annotation) or annotation
    return isinstance(kind, type) and isinstance(value, kind)
