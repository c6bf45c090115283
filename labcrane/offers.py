"""How a plugin says what it has: a name, its settings, and how to build it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ConfigDict

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
