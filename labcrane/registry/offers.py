"""Offers of plugins: a name, its settings, and how to build it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from labcrane.core.roles import Component
from labcrane.core.settings import Settings

if TYPE_CHECKING:
    from labcrane.core.findings import Finding
    from labcrane.machines.machine import Machine

RoleT = TypeVar("RoleT", bound=Component)
RoleT_co = TypeVar("RoleT_co", bound=Component, covariant=True)
SettingsT = TypeVar("SettingsT", bound=Settings)


API = 1
"""Version of the interface that plugins are written against: hooks, roles and public names. A
plugin says ``labcrane_api = 1`` in its module; ``docs/compatibility.md`` says when it rises."""


Prompt = Callable[[str], None]
"""Tells the person at the machine what to do next."""


@dataclass(frozen=True, slots=True)
class Offer(Generic[RoleT_co]):
    """One component on offer. Make it with :func:`offer`.

    Attributes
    ----------
    name
        The word a protocol writes after ``use:``.
    settings
        Model of the keys beside it.
    build
        Makes the component from settings and machine.
    examine
        Looks at the hardware it needs; None where it needs none.
    """

    name: str
    settings: type[Settings]
    build: Callable[[Any, Machine], RoleT_co]
    examine: Callable[[Any, Prompt | None], Sequence[Finding]] | None = None


def offer(
    name: str,
    settings: type[SettingsT],
    build: Callable[[SettingsT, Machine], RoleT],
    examine: Callable[[SettingsT, Prompt | None], Sequence[Finding]] | None = None,
) -> Offer[RoleT]:
    """Offer what ``build`` makes as ``name``, the word a protocol writes after ``use:``.

    Parameters
    ----------
    name
        One word, in lower case.
    settings
        Model of the keys that a protocol may write beside ``use``.
    build
        Called with validated settings and the machine, once per run. Import heavy libraries
        inside it: every installed plugin is imported just to list offers.
    examine
        Called by ``labcrane doctor`` with validated settings, in a process of its own, and given
        30 seconds: says how the hardware is that the component needs. With its second argument it
        tells the person at the machine what to do; None when nobody is there.

    Returns
    -------
    Offer
        To be returned from a hook.
    """
    return Offer(name, settings, build, examine)


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
