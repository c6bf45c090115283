"""Settings of cues and sounds, changed while they run."""

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from labcrane.core.by_estimate import ByEstimate
from labcrane.core.records import Value
from labcrane.core.settings import Settings
from labcrane.errors import ProtocolError
from labcrane.files.yaml import parse_yaml
from labcrane.protocol.components import ComponentSpec
from labcrane.session.commands import SettingChange


class FeedbackSettings:
    """Settings that the experimenter may change, and their present values.

    A change is written as in a protocol: ``tone.far=3``, ``ball.at=tip``.
    """

    def __init__(self, choices: Mapping[str, ComponentSpec]) -> None:
        self._now: dict[str, Settings] = {name: each.settings for name, each in choices.items()}

    def refusal(self, change: SettingChange) -> str | None:
        """Return why a change cannot be made, or None when it can."""
        try:
            self._changed(change)
        except ValueError as error:
            return str(error)
        return None

    def change(self, change: SettingChange) -> dict[str, Value]:
        """Make a change that is not refused; return it as the data of an event."""
        value, settings = self._changed(change)
        self._now[change.feedback] = settings
        return {"feedback": change.feedback, "key": change.key, "value": value}

    def _changed(self, change: SettingChange) -> tuple[Value, Settings]:
        name, key, written = change.feedback, change.key, change.written
        if name not in self._now:
            known = ", ".join(self._now) or "none"
            raise ValueError(f"there is no feedback {name!r}; there is {known}")
        before = self._now[name]
        fields = type(before).model_fields
        if key not in fields:
            raise ValueError(f"{name} has no setting {key!r}; it has {', '.join(fields)}")
        if isinstance(getattr(before, key), ByEstimate):
            message = f"{name}.{key} follows an estimate, and cannot be set by hand"
            raise ValueError(message)  # noqa: TRY004 - what people wrote, like the rest
        try:
            value = parse_yaml(written, "a setting")
        except ProtocolError:
            raise ValueError(
                f"{written!r} is not a value; write a number, a word, true or false"
            ) from None
        if not isinstance(value, float | int | str | bool | None):
            message = f"{name}.{key} can be changed to a single value, not {written!r}"
            raise ValueError(message)  # noqa: TRY004 - what people wrote, like the rest
        asked: dict[str, Any] = {**before.model_dump(), key: value}
        try:
            return value, type(before).model_validate(asked)
        except ValidationError as error:
            what = error.errors()[0]["msg"]
            raise ValueError(f"{name}.{key} cannot be {value!r}: {what}") from None
