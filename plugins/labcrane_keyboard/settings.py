"""Settings of the keyboard."""

from typing import Annotated

from pydantic import Field, NonNegativeFloat, PositiveFloat, field_validator

from labcrane import Machine, Settings
from labcrane.core import Names, Reference, ViewName

SentKey = Annotated[str, Reference("key of that view", of="view")]
"""A key that the view sends."""


class KeyboardSettings(Settings):
    """Settings of :class:`labcrane_keyboard.keyboard.Keyboard`."""

    view: ViewName
    """Name of the view whose window has the keyboard's focus; its ``keys`` must include these."""

    axes: dict[str, tuple[SentKey, SentKey]] = Field(min_length=1)
    """Two keys for each axis: the first towards -1, the second towards 1. A scheme refers to an
    axis as ``keyboard.NAME``."""

    ramp_s: NonNegativeFloat = 0.3
    """Time in which an axis goes from rest to full while its key is held, in seconds; with 0 it
    jumps."""

    fall_s: NonNegativeFloat = 0.1
    """Time in which an axis returns from full to rest when its key is released, in seconds."""

    timeout_s: PositiveFloat = 0.5
    """Time without data from the view, in seconds, after which the keyboard is lost and all axes
    are at rest."""

    def provides(self, machine: Machine) -> Names:
        return {"axis": [*(f"keyboard.{name}" for name in self.axes), "view.connected"]}

    @field_validator("axes")
    @classmethod
    def _keys_differ(cls, axes: dict[str, tuple[str, str]]) -> dict[str, tuple[str, str]]:
        keys = [key for pair in axes.values() for key in pair]
        if twice := sorted({key for key in keys if keys.count(key) > 1}):
            raise ValueError(f"a key can move one axis only; {', '.join(twice)} moves more")
        for name in axes:
            if not name.isidentifier() or not name.islower():
                raise ValueError(f"{name!r} cannot name an axis; give a lower-case word")
        return axes
