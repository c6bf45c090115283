"""Offers of plugins: a name, its settings, and how to build it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from inspect import Parameter, signature
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


LAB = "pip install 'labcrane[lab]'"
"""How to get everything that a laboratory runs."""

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
        Model of the keys next to it.
    build
        Makes the component from settings and machine.
    examine
        Looks at the hardware it needs; None where it needs none.
    needs
        Modules of other projects without which it cannot be built, and how to get each.
    """

    name: str
    settings: type[Settings]
    build: Callable[[Any, Machine], RoleT_co]
    examine: Callable[[Any, Prompt | None], Sequence[Finding]] | None = None
    needs: Mapping[str, str] = field(default_factory=dict)

    @property
    def missing(self) -> str:
        """What it needs that is not installed, and how to get it; empty when all is there."""
        return not_installed(self.needs)


def not_installed(needs: Mapping[str, str]) -> str:
    """Return which of these modules are not installed, and how to get each; empty for none."""
    missing = {module: how for module, how in needs.items() if not _is_there(module)}
    return "; ".join(
        f"needs {module}, which is not installed: {how}" for module, how in missing.items()
    )


def _is_there(module: str) -> bool:
    if module in sys.modules:
        return sys.modules[module] is not None
    return find_spec(module) is not None


@dataclass(frozen=True, slots=True)
class Maker:
    """Calls a class, or what a place names, with the arguments that it has no default for.

    Attributes
    ----------
    made
        The class, or module and name of what is imported when it is called.
    """

    made: type[Any] | str

    def __call__(self, *given: object) -> Any:
        """Call it with settings, and what else it needs of the arguments."""
        made: Callable[..., Any]
        if isinstance(self.made, str):
            module, _, name = self.made.partition(":")
            made = getattr(import_module(module), name)
        else:
            made = self.made
        needed = [
            each for each in signature(made).parameters.values() if each.default is Parameter.empty
        ]
        return made(*given[: len(needed)])


def offer(
    name: str,
    settings: type[SettingsT],
    build: Callable[[SettingsT, Machine], RoleT] | type[RoleT] | str,
    examine: Callable[[SettingsT, Prompt | None], Sequence[Finding]] | str | None = None,
    *,
    needs: Mapping[str, str] | None = None,
) -> Offer[RoleT]:
    """Offer what ``build`` makes as ``name``, the word a protocol writes after ``use:``.

    Parameters
    ----------
    name
        One word, in lower case.
    settings
        Model of the keys that a protocol may write next to ``use``.
    build
        Called with validated settings and the machine, once per run: a function, or the class
        itself, which is given the machine if it asks for it. Every installed plugin is imported
        just to list offers, so one with heavy libraries names the place of its class, as
        ``"labcrane_view.view:View"``, which is imported when it is built.
    examine
        Called by ``labcrane doctor`` with validated settings, in a process of its own, and given
        30 seconds: returns the state of the hardware that the component needs. Its second argument
        shows the person at the machine what to do; None when there is no person. It may be a place
        as well: ``"labcrane_view.examination:examine"``.
    needs
        Modules that a smaller installation may lack, and how to get each:
        ``{"pyserial": "pip install 'my-lamp[serial]'"}``. Checking a protocol says so, and nothing
        is imported for it.

    Returns
    -------
    Offer
        To be returned from a hook.
    """
    looks = None if examine is None else _callable(examine)
    return Offer(name, settings, _callable(build), looks, needs or {})


def _callable(given: Callable[..., Any] | str) -> Callable[..., Any]:
    return Maker(given) if isinstance(given, str | type) else given


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
