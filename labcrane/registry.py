"""Find installed plugins and look up what they offer."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from importlib.metadata import EntryPoint, entry_points
from typing import TypeVar, cast

import pluggy

from labcrane import hookspecs
from labcrane.errors import PluginError
from labcrane.hookspecs import PROJECT
from labcrane.offers import Offer
from labcrane.roles import (
    Component,
    Controller,
    Cue,
    Dynamics,
    Exporter,
    Feedback,
    InputDevice,
    Questionnaire,
    Task,
)

RoleT = TypeVar("RoleT", bound=Component)


@dataclass(frozen=True, slots=True)
class RoleEntry:
    """How a role is found and spoken of.

    Attributes
    ----------
    hook
        The hook that collects its offers.
    word
        What a researcher calls it.
    """

    hook: str
    word: str


ROLES: Mapping[type[Component], RoleEntry] = {
    InputDevice: RoleEntry("labcrane_inputs", "input"),
    Controller: RoleEntry("labcrane_controllers", "scheme"),
    Dynamics: RoleEntry("labcrane_dynamics", "dynamics"),
    Task: RoleEntry("labcrane_tasks", "task"),
    Exporter: RoleEntry("labcrane_exporters", "exporter"),
    Questionnaire: RoleEntry("labcrane_questionnaires", "questionnaire"),
    Cue: RoleEntry("labcrane_cues", "cue"),
    Feedback: RoleEntry("labcrane_feedback", "feedback"),
}


@dataclass(frozen=True, slots=True)
class Registry:
    """What is on offer, and why what should be is not.

    Attributes
    ----------
    offers
        By role and name.
    plugins
        Which plugin made each offer, by role and name.
    broken
        Why a plugin could not be imported, by plugin.
    """

    offers: Mapping[type[Component], Mapping[str, Offer[Component]]]
    plugins: Mapping[type[Component], Mapping[str, str]]
    broken: Mapping[str, str]

    def find(self, role: type[RoleT], name: str) -> Offer[RoleT]:
        """Return the offer called ``name``, or say what there is instead."""
        if name in (offers := self.offers[role]):
            return cast("Offer[RoleT]", offers[name])
        message = f"{ROLES[role].word} {name!r} is not installed"
        if close := get_close_matches(name, offers, n=1):
            message += f"; did you mean {close[0]!r}?"
        else:
            message += f"; there is {', '.join(sorted(offers)) or 'none'}"
        message += " (labcrane plugins lists all)"
        for plugin, why in self.broken.items():
            message += f"; plugin {plugin!r} is broken: {why}"
        raise PluginError(message)


def discover(plugins: Iterable[EntryPoint] | None = None) -> Registry:
    """Import every plugin in the ``labcrane`` entry-point group and collect its offers.

    A plugin that cannot be imported is noted, not raised: a missing audio library must not
    stop a study that makes no sound.
    """
    manager = pluggy.PluginManager(PROJECT)
    manager.add_hookspecs(hookspecs)
    broken: dict[str, str] = {}
    for point in entry_points(group=PROJECT) if plugins is None else plugins:
        try:
            manager.register(point.load(), name=point.name)
        except Exception as error:  # noqa: BLE001 - someone else's import can raise anything
            broken[point.name] = f"{type(error).__name__}: {error}"
    try:
        manager.check_pending()
    except pluggy.PluginValidationError as error:
        raise PluginError(f"misspelt hook: {error}") from error
    offers: dict[type[Component], dict[str, Offer[Component]]] = {}
    origins: dict[type[Component], dict[str, str]] = {}
    for role in ROLES:
        offers[role], origins[role] = _collect(manager, role)
    return Registry(offers, origins, broken)


def _collect(
    manager: pluggy.PluginManager, role: type[Component]
) -> tuple[dict[str, Offer[Component]], dict[str, str]]:
    hook: pluggy.HookCaller = getattr(manager.hook, ROLES[role].hook)
    found: dict[str, Offer[Component]] = {}
    origins: dict[str, str] = {}
    for implementation in hook.get_hookimpls():
        plugin = implementation.plugin_name
        offers = cast("Sequence[Offer[Component]]", implementation.function())
        for offer in offers:
            if offer.name in found:
                raise PluginError(
                    f"plugins {origins[offer.name]!r} and {plugin!r} both offer the "
                    f"{ROLES[role].word} {offer.name!r}; uninstall or rename one of them"
                )
            found[offer.name] = offer
            origins[offer.name] = plugin
    return found, origins
