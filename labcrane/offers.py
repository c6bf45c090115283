"""How a plugin says what it has: a name, its settings, and how to build it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationInfo

from labcrane.machine import Machine
from labcrane.roles import Component

RoleT = TypeVar("RoleT", bound=Component)
RoleT_co = TypeVar("RoleT_co", bound=Component, covariant=True)
SettingsT = TypeVar("SettingsT", bound="Settings")


class Settings(BaseModel):
    """Base of every plugin's settings: unknown keys are errors, values never change."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, use_attribute_docstrings=True, allow_inf_nan=False
    )


def _beside(path: Path, info: ValidationInfo) -> Path:
    return info.context["folder"] / path if info.context else path


StudyPath = Annotated[Path, AfterValidator(_beside)]
"""A file of the study in a component's settings: a relative path counts from the folder of the
protocol that names it."""


@dataclass(frozen=True, slots=True)
class Offer(Generic[RoleT_co]):
    """One component on offer. Make it with :func:`offer`."""

    name: str
    settings: type[Settings]
    build: Callable[[Any, Machine], RoleT_co]


def offer(
    name: str, settings: type[SettingsT], build: Callable[[SettingsT, Machine], RoleT]
) -> Offer[RoleT]:
    """Offer what ``build`` makes as ``name``, the word a protocol writes after ``use:``.

    ``build`` is called with validated settings and the machine, once per run. Import heavy
    libraries inside it: every installed plugin is imported just to list offers.
    """
    return Offer(name, settings, build)


@dataclass(frozen=True, slots=True)
class CommandOffer:
    """One command of the command line on offer.

    Attributes
    ----------
    words
        What the user types after ``labcrane``, a group and a name: ``("dmd", "fit")``.
    run
        A function as typer wants it: its docstring is the help, its parameters are arguments and
        options. It imports what it needs when it runs, so that ``labcrane --help`` stays instant.
    """

    words: tuple[str, str]
    run: Callable[..., None]
