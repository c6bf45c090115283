"""Configuration of a feedback process, as a line of text."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import GetPydanticSchema, PlainSerializer, TypeAdapter
from pydantic_core import core_schema

from labcrane.core.records import Run
from labcrane.feedback.delays import MeasuredDelay
from labcrane.recording.run_codec import read_run, write_run

_AS_TEXT = core_schema.no_info_plain_validator_function(
    read_run, serialization=core_schema.plain_serializer_function_ser_schema(write_run)
)


@dataclass(frozen=True, slots=True)
class ComponentConfig:
    """A component by its offer's name and its settings."""

    use: str
    settings: Mapping[str, Any]


@dataclass(frozen=True)
class FeedbackConfig:
    """Configuration of a feedback process.

    Attributes
    ----------
    name
        The protocol's name for it.
    part, cues
        The component, and the cues that it draws, by the protocol's names.
    run
        The run that it presents.
    source
        Whose streams it follows (:attr:`labcrane.session.session.Visit.source`).
    study
        The protocol, whose folder may contain plugins.
    always
        Whether it presents every frame, or only those of trials in which it is switched on.
    measured
        Its measured delay, if there is one.
    recorded
        Whether there is a recorder, without which it presents nothing; a preview has none.
    title
        Title of its window: its name, and the study's.
    before
        The displays that come before it in the protocol: windows lie beside theirs.
    streams
        Descriptions of the session's streams by name, when there are any yet.
    """

    name: str
    part: ComponentConfig
    run: Annotated[Run, GetPydanticSchema(lambda _, __: _AS_TEXT)]
    source: str
    study: Annotated[Path, PlainSerializer(lambda path: str(path.resolve()))]
    always: bool
    cues: Mapping[str, ComponentConfig] = field(default_factory=dict)
    measured: MeasuredDelay | None = None
    recorded: bool = True
    title: str = ""
    before: tuple[ComponentConfig, ...] = ()
    streams: Mapping[str, str] = field(default_factory=dict)

    def as_json(self) -> str:
        """Return the configuration as one line."""
        return _codec().dump_json(self).decode()

    @classmethod
    def from_json(cls, text: str) -> "FeedbackConfig":
        """Return the configuration that :meth:`as_json` wrote."""
        return _codec().validate_json(text)


@cache
def _codec() -> TypeAdapter[FeedbackConfig]:
    return TypeAdapter(FeedbackConfig)
