"""Settings of components: the model of what a protocol writes beside ``use``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

from pydantic import AfterValidator, BaseModel, ValidationInfo

from labcrane.core.references import Reference
from labcrane.files.complaints import WrongKey as WrongKey  # noqa: PLC0414 - public here
from labcrane.files.model import AtMost as AtMost  # noqa: PLC0414 - public here
from labcrane.files.model import StrictModel
from labcrane.files.model import Usual as Usual  # noqa: PLC0414
from labcrane.files.model import was_run as was_run  # noqa: PLC0414
from labcrane.files.names import outside as outside  # noqa: PLC0414 - public here
from labcrane.files.table import read_csv_text as read_csv_text  # noqa: PLC0414 - public here
from labcrane.files.units import Unit as Unit  # noqa: PLC0414 - public here
from labcrane.files.yaml import YamlFile
from labcrane.files.yaml import read_yaml as read_yaml  # noqa: PLC0414 - public here

if TYPE_CHECKING:
    from labcrane.machines.machine import Machine

Names = Mapping[str, Sequence[str]]
"""Names by kind: ``{"axis": ("left.x", "left.y")}``."""


ModelT = TypeVar("ModelT", bound=BaseModel)


def read_settings(path: Path, model: type[ModelT]) -> ModelT:
    """Return a YAML file as a model.

    Raises
    ------
    ProtocolError
        With one line for every mistake: file, line, column, what is written, what is possible.
    """
    return YamlFile.read(path).checked(model)


@dataclass(frozen=True, slots=True)
class Within:
    """A fact of the task's error that is told within a distance, and no more beyond it.

    Attributes
    ----------
    fact
        What is learnt: ``how far the tip is from the target``.
    far
        Up to which distance of tip and target, in metres.
    """

    fact: str
    far: float

    def __str__(self) -> str:
        return f"{self.fact}, up to {self.far:g} m"


class Settings(StrictModel):
    """Base of every plugin's settings: unknown keys are errors, values never change."""

    def reveals(self) -> tuple[str | Within, ...]:
        """Return what everyone who sees or hears the component learns of the task's error.

        A fact each, nothing by default; components that tell the same use the same words. What
        these settings make constant is not a fact, and one told up to a distance is
        :class:`Within` it. What reveals something is feedback, and belongs to the design:
        ``labcrane check`` asks about it where it is always there, in every group, and where groups,
        conditions or blocks of one task are told different facts.
        """
        return ()

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        """Return numbers that hardly anybody means, by key: ``{"limit_s": "is 0.1 s, and ..."}``.

        ``labcrane check`` asks whether each is meant, until the protocol says so. The key may lead
        inside: ``"jaws.grip_n"``, or to an item, counted from 1: ``"questions.2"``.
        """
        return {}

    def directions(self, machine: Machine) -> Sequence[str]:
        """Return what each axis does to the machine, a sentence each, in an operator's words.

        A scheme's: ``left stick to the right: the slew turns to the right``. ``labcrane doctor``
        says it before the controls are moved. Nothing by default.
        """
        return ()

    def provides(self, machine: Machine) -> Names:
        """Return the names that a component with these settings gives others to refer to, by kind.

        An input says its axes, a task its events, a view its cameras, whatever is seen its objects:
        :mod:`labcrane.core.references` has the kinds. Of a kind that a component says nothing of,
        the core looks at the built component's signals, or takes any name for good.
        """
        return {}

    def needs(self, machine: Machine) -> Names:
        """Return the names that a component refers to unwritten, by kind: defaults in use."""
        return {}


def _beside(path: Path, info: ValidationInfo) -> Path:
    return info.context["folder"] / path if info.context else path


StudyPath = Annotated[Path, AfterValidator(_beside), Reference("file")]
"""A file of the study in a component's settings: a relative path counts from the folder of the
protocol that names it."""

SceneFile = Annotated[StudyPath, Reference("scene")]
"""A scene's file, which the dynamics must have as well, if it says which it has."""
