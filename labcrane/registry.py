"""Find installed plugins and look up what they offer."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import TypeVar, cast

import pluggy

from labcrane.errors import PluginError
from labcrane.offers import Offer
from labcrane.plugin_modules import load_plugins, offered
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
from labcrane.suggestion import suggestion

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
    place
        Where a protocol uses it; empty for what no protocol names.
    """

    hook: str
    word: str
    place: tuple[str, ...] = ()


ROLES: Mapping[type[Component], RoleEntry] = {
    InputDevice: RoleEntry("labcrane_inputs", "input", ("input",)),
    Controller: RoleEntry("labcrane_controllers", "scheme", ("scheme",)),
    Dynamics: RoleEntry("labcrane_dynamics", "dynamics", ("dynamics",)),
    Task: RoleEntry("labcrane_tasks", "task", ("tasks", "NAME")),
    Exporter: RoleEntry("labcrane_exporters", "exporter"),
    Questionnaire: RoleEntry(
        "labcrane_questionnaires", "questionnaire", ("questionnaires", "NAME")
    ),
    Cue: RoleEntry("labcrane_cues", "cue", ("feedback", "NAME")),
    Feedback: RoleEntry("labcrane_feedback", "feedback", ("feedback", "NAME")),
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
        What is wrong with a plugin that offers nothing, or not all it should, by plugin.
    local
        The files of the study's own plugins, by plugin.
    """

    offers: Mapping[type[Component], Mapping[str, Offer[Component]]]
    plugins: Mapping[type[Component], Mapping[str, str]]
    broken: Mapping[str, str]
    local: Mapping[str, Path] = field(default_factory=dict)

    def find(self, role: type[RoleT], name: str) -> Offer[RoleT]:
        """Return the offer called ``name``, or say what there is instead."""
        if name in (offers := self.offers[role]):
            return cast("Offer[RoleT]", offers[name])
        message = (
            f"{ROLES[role].word} {name!r} is not installed; {suggestion(name, sorted(offers))} "
            "(labcrane plugins lists all)"
        )
        for plugin, why in self.broken.items():
            message += f"; plugin {plugin!r} is broken: {why}"
        raise PluginError(message)


def discover(plugins: Iterable[EntryPoint] | None = None, *, study: Path | None = None) -> Registry:
    """Import every plugin in the ``labcrane`` entry-point group and collect what it offers.

    A plugin that cannot be imported is noted, not raised: a missing audio library must not
    stop a study that makes no sound.

    Parameters
    ----------
    study
        A protocol; the plugins in the folder beside it are collected as well.

    Raises
    ------
    PluginError
        Two plugins offer the same name, so that nobody could say which is meant.
    """
    modules = load_plugins(plugins, study)
    offers: dict[type[Component], dict[str, Offer[Component]]] = {}
    origins: dict[type[Component], dict[str, str]] = {}
    for role in ROLES:
        offers[role], origins[role] = _collect(modules.manager, role, modules.broken)
    return Registry(offers, origins, modules.broken, modules.local)


def _collect(
    manager: pluggy.PluginManager, role: type[Component], broken: dict[str, str]
) -> tuple[dict[str, Offer[Component]], dict[str, str]]:
    hook: pluggy.HookCaller = getattr(manager.hook, ROLES[role].hook)
    found: dict[str, Offer[Component]] = {}
    origins: dict[str, str] = {}
    for implementation in hook.get_hookimpls():
        plugin = implementation.plugin_name
        try:
            offers = offered(implementation, Offer, "labcrane.offer(...)")
        except PluginError as error:
            broken[plugin] = str(error)
            continue
        for offer in offers:
            if offer.name in found:
                raise PluginError(
                    f"plugins {origins[offer.name]!r} and {plugin!r} both offer the "
                    f"{ROLES[role].word} {offer.name!r}; uninstall or rename one of them"
                )
            found[offer.name] = offer
            origins[offer.name] = plugin
    return found, origins
