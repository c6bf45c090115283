"""Settings of components: the model of the keys that a protocol gives with ``use``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    Field,
    FiniteFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    ValidationInfo,
    model_validator,
)

from labcrane.core.references import Reference
from labcrane.errors import look as look  # noqa: PLC0414 - public here
from labcrane.errors import unlike as unlike  # noqa: PLC0414
from labcrane.files.atomic import give_name as give_name  # noqa: PLC0414 - public here
from labcrane.files.complaints import WrongKey as WrongKey  # noqa: PLC0414 - public here
from labcrane.files.model import AtMost as AtMost  # noqa: PLC0414 - public here
from labcrane.files.model import StrictModel
from labcrane.files.model import Usual as Usual  # noqa: PLC0414
from labcrane.files.model import was_run as was_run  # noqa: PLC0414
from labcrane.files.names import file_name_of as file_name_of  # noqa: PLC0414 - public here
from labcrane.files.names import outside as outside  # noqa: PLC0414
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
        With one line for every mistake: file, line, column, the value, the possible values.
    """
    return YamlFile.read(path).checked(model)


@dataclass(frozen=True, slots=True)
class Within:
    """A fact of the task's error that is revealed only within a distance.

    Attributes
    ----------
    fact
        The revealed fact: ``how far the tip is from the target``.
    far
        Maximum distance of tip and target, in metres.
    """

    fact: str
    far: float

    def __str__(self) -> str:
        return f"{self.fact}, up to {self.far:g} m"


class Settings(StrictModel):
    """Base of every plugin's settings: unknown keys are errors, values never change."""

    person: ClassVar[bool] = True
    """For an input: whether a person moves it. One without a person is for pilots and simulations;
    ``labcrane approve`` refuses it, and so does a session of a participant."""

    def reveals(self) -> tuple[str | Within, ...]:
        """Return the facts of the task's error that the component reveals to operators.

        None by default; components that reveal the same fact use the same words. A value that
        these settings make constant is not a fact; a fact that is revealed up to a distance is
        :class:`Within` it. A component that reveals facts is feedback and belongs to the design:
        ``labcrane check`` warns if it is always on, in every group, and if groups, conditions or
        blocks of one task get different facts.
        """
        return ()

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        """Return numbers that are probably mistakes, by key: ``{"limit_s": "is 0.1 s, and ..."}``.

        ``labcrane check`` warns about each until the protocol acknowledges it. The key may lead to
        a nested setting: ``"jaws.grip_n"``, or to an item, counted from 1: ``"questions.2"``.
        """
        return {}

    def directions(self, machine: Machine) -> Sequence[str]:
        """Return a sentence on the effect of each axis, in an operator's words.

        For a scheme: ``left stick to the right: the slew turns to the right``. ``labcrane doctor``
        prints it before the controls are moved. None by default.
        """
        return ()

    def provides(self, machine: Machine) -> Names:
        """Return the names that other components can refer to, by kind.

        An input names its axes, a task its events, a view its cameras, a visible component its
        objects: :mod:`labcrane.core.references` has the kinds. For a kind that is missing here,
        the core checks the built component's signals, or accepts any name.
        """
        return {}

    def needs(self, machine: Machine) -> Names:
        """Return the names that a component refers to by default, by kind."""
        return {}


class CaptureSettings(Settings):
    """Base of the settings of recordings."""

    consent: str = Field(min_length=1)
    """The words of the consent text that name this recording: ``We film your face``. A study is not
    approved with a consent text that does not contain them."""

    sees: str | None = None
    """The view that a camera sees, or the sound or vibration that a microphone hears: the sync
    report states how late each change of it is in the recording."""

    sees_part: tuple[NonNegativeInt, NonNegativeInt, PositiveInt, PositiveInt] | None = None
    """Left, top, width and height, in pixels of the picture, of what changes there: the view's
    patch. The whole picture by default."""

    required: bool = True
    """Whether a session waits for it. If it fails later, the session pauses as for a required
    stream (`on_fault.stream_lost`)."""


class EstimateSettings(Settings):
    """Base of the settings of estimates."""

    values: ClassVar[tuple[str, ...]] = ()
    """Names of its values, in the order in which they are returned."""

    stream: str
    """The stream that it is computed from, by its name under ``streams``."""

    fallback: dict[str, FiniteFloat]
    """What is used for each of its values while there is none: before enough samples have come,
    while its stream is silent, and while the value is late or not a number."""

    at_most_age_s: PositiveFloat = 2.0
    """Age from which a value is late: how long the time that it stands for may be past, in
    seconds."""

    @model_validator(mode="after")
    def _falls_back(self) -> Self:
        if set(self.fallback) != set(self.values):
            given, needed = (", ".join(each) or "nothing" for each in (self.fallback, self.values))
            raise WrongKey(
                f"fallback has {given}, and the values are {needed}; give a number for each",
                at=("fallback",),
            )
        return self


def _beside(path: Path, info: ValidationInfo) -> Path:
    return info.context["folder"] / path if info.context else path


StudyPath = Annotated[Path, AfterValidator(_beside), Reference("file")]
"""A file of the study in a component's settings: a relative path counts from the folder of the
protocol that names it."""

SceneFile = Annotated[StudyPath, Reference("scene")]
"""A scene's file; the dynamics must have the same one, if they name theirs."""
