"""Calibration of the two sticks, and the file that keeps it."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from pydantic import Field, ValidationError, model_validator
from ruamel.yaml import YAML

from labcrane import DeviceError, ProtocolError, Settings
from labcrane.core import give_name, read_yaml

RUN_AGAIN = "run 'python -m labcrane_joystick' to identify and calibrate the sticks"
REMOVE = f"remove it and {RUN_AGAIN}"


class AxisRange(Settings):
    """Where an axis rests and where it ends, as raw SDL numbers."""

    minimum: int = Field(default=-32768, ge=-32768, le=32767)
    """Raw number at the lower end."""
    centre: int = Field(default=0, ge=-32768, le=32767)
    """Raw number at rest."""
    maximum: int = Field(default=32767, ge=-32768, le=32767)
    """Raw number at the upper end."""

    @model_validator(mode="after")
    def _ascends(self) -> Self:
        if not self.minimum < self.centre < self.maximum:
            raise ValueError(
                f"minimum, centre and maximum must ascend, but are {self.minimum}, "
                f"{self.centre} and {self.maximum}"
            )
        return self

    def scaled(self, raw: int) -> float:
        """Return the axis in [-1, 1]: 0 at the centre, and each side linear to its own end.

        Beyond a calibrated end the end's value holds.
        """
        centre = self.centre
        if raw > centre:
            end = self.maximum
            return (raw - centre) / (end - centre) if raw < end else 1.0
        end = self.minimum
        return (raw - centre) / (centre - end) if raw > end else -1.0


class Calibration(Settings):
    """One hand's stick."""

    port: str
    """The socket it is plugged into."""
    x: AxisRange = AxisRange()
    """To the right."""
    y: AxisRange = AxisRange()
    """Towards the operator."""
    twist: AxisRange = AxisRange()
    """Clockwise."""
    slider: AxisRange = AxisRange()
    """It rests anywhere; its centre is the middle."""

    @property
    def axes(self) -> tuple[AxisRange, ...]:
        """The ranges in the order of the stick's axes."""
        return (self.x, self.y, self.twist, self.slider)


class Calibrations(Settings):
    """Both hands' sticks."""

    date: str
    """Day of the calibration, ISO 8601."""
    left: Calibration
    """The stick whose trigger was pulled for the left."""
    right: Calibration
    """The other."""


def default_path() -> Path:
    """Return the user's file: in ``$LABCRANE_CONFIG``, or else in ``~/.config/labcrane``."""
    folder = os.environ.get("LABCRANE_CONFIG")
    return (Path(folder) if folder else Path.home() / ".config" / "labcrane") / "joysticks.yaml"


def load(path: Path, model: str) -> Calibrations | None:
    """Return the calibrations in ``path`` for sticks of ``model``; None if there are none yet."""
    content = _read(path)
    if model not in content:
        return None
    try:
        return Calibrations.model_validate(content[model])
    except ValidationError as error:
        raise DeviceError(f"{path}: the entry {model} {_why(error)}; {RUN_AGAIN}") from error


def save(path: Path, model: str, found: Calibrations) -> None:
    """Write ``found`` to ``path``, and keep the calibrations of other models.

    Raises
    ------
    DeviceError
        The file cannot be written, or its content cannot be read.
    """
    content = {**_read(path), model: found.model_dump()}
    # Written to a temporary file and renamed, so that a crash leaves the old file or the new one.
    beside = path.with_name(path.name + ".new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with beside.open("w", encoding="utf-8") as file:
            file.write("# Written by python -m labcrane_joystick; raw SDL numbers.\n")
            YAML().dump(content, file)
            file.flush()
            os.fsync(file.fileno())
        give_name(beside, path)
    except OSError as error:
        raise DeviceError(
            f"{path} cannot be written: {error.strerror}; set LABCRANE_CONFIG to a folder that can"
        ) from error


def _read(path: Path) -> Mapping[str, Any]:
    if not path.exists():
        return {}
    try:
        content = read_yaml(path)
    except ProtocolError as error:
        raise DeviceError(f"{path} cannot be read: {error}; {REMOVE}") from error
    if not isinstance(content, dict):
        raise DeviceError(f"{path} must hold a mapping of joystick models; {REMOVE}")
    return content


def _why(error: ValidationError) -> str:
    def one(place: Sequence[str | int], message: str) -> str:
        return f"is wrong at {'.'.join(map(str, place)) or 'the top'}: {message}"

    return ", ".join(
        one(each["loc"], each["msg"].removeprefix("Value error, ")) for each in error.errors()
    )
