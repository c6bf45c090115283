"""Registry of installed plugins and of what they offer.

A plugin that fails in any way is kept with its reason, which is reported where the plugin was
needed; the others go on. Two that offer one name are an error for both.
"""

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import TypeVar, cast

import pluggy

from labcrane.core.roles import Component
from labcrane.errors import PluginError, suggestion
from labcrane.registry.entry_points import EntryPoint
from labcrane.registry.hookspecs import ROLES
from labcrane.registry.loader import PluginModules, offered
from labcrane.registry.offers import Offer

RoleT = TypeVar("RoleT", bound=Component)


class Registry:
    """The offers of all plugins, and the reasons of missing ones.

    A plugin that says in its entry points what it offers is imported when that is looked for; all
    are when everything is listed, or when there is not what is looked for.

    Raises
    ------
    PluginError
        Two plugins that were imported offer the same name, which is then ambiguous.
    """

    def __init__(self, modules: PluginModules) -> None:
        self._modules = modules
        self._offers: dict[type[Component], dict[str, Offer[Component]]]
        self._offers = {role: {} for role in ROLES}
        self._plugins: dict[type[Component], dict[str, str]] = {role: {} for role in ROLES}
        self._import(())  # those that do not say what they offer

    @property
    def offers(self) -> Mapping[type[Component], Mapping[str, Offer[Component]]]:
        """All that is installed, by role and name."""
        self._import()
        return self._offers

    @property
    def plugins(self) -> Mapping[type[Component], Mapping[str, str]]:
        """Which plugin made each offer, by role and name."""
        self._import()
        return self._plugins

    @property
    def broken(self) -> Mapping[str, str]:
        """Mistakes of plugins that offer nothing, or not all they should, by plugin."""
        self._import()
        return self._modules.broken

    @property
    def local(self) -> Mapping[str, Path]:
        """The files of the study's own plugins, by plugin."""
        return self._modules.local

    def roles(self, name: str) -> frozenset[type[Component]]:
        """Return the roles that what is called ``name`` can fill."""
        self._import({name})
        return frozenset(role for role, offers in self._offers.items() if name in offers)

    def find(self, role: type[RoleT], name: str) -> Offer[RoleT]:
        """Return the offer called ``name``, or say what there is instead."""
        self._import({name})
        offers = self._offers[role] if name in self._offers[role] else self.offers[role]
        if name in offers:
            return cast("Offer[RoleT]", offers[name])
        message = (
            f"{ROLES[role].word} {name!r} is not installed; {suggestion(name, sorted(offers))} "
            "(labcrane plugins lists all)"
        )
        for plugin, why in self.broken.items():
            message += f"; plugin {plugin!r} is broken: {why}"
        raise PluginError(message)

    def plugin(self, role: type[Component], name: str) -> str:
        """Return which plugin offers ``name``, which must be on offer."""
        return self._plugins[role][self.find(role, name).name]

    def _import(self, names: Collection[str] | None = None) -> None:
        if imported := self._modules.load(names):
            for role in ROLES:
                self._collect(role, imported)
            # Other plugins with the same names are found now, and not when a name is looked up.
            self._import({name for offers in self._offers.values() for name in offers})

    def _collect(self, role: type[Component], imported: Collection[str]) -> None:
        hook: pluggy.HookCaller = getattr(self._modules.manager.hook, ROLES[role].hook.__name__)
        found, origins = self._offers[role], self._plugins[role]
        for implementation in hook.get_hookimpls():
            plugin = implementation.plugin_name
            if plugin not in imported:
                continue
            try:
                offers = offered(implementation, Offer, "labcrane.offer(...)")
            except PluginError as error:
                self._modules.broken[plugin] = str(error)
                continue
            for offer in offers:
                if offer.name in found:
                    both = (origins[offer.name], plugin)
                    first, second = sorted(both, key=self._modules.names.index)
                    raise PluginError(
                        f"plugins {first!r} and {second!r} both offer the {ROLES[role].word} "
                        f"{offer.name!r}; uninstall or rename one of them"
                    )
                found[offer.name] = offer
                origins[offer.name] = plugin


def discover(plugins: Iterable[EntryPoint] | None = None, *, study: Path | None = None) -> Registry:
    """Return the offers of the plugins in the ``labcrane`` entry-point group.

    A plugin that cannot be imported is noted, not raised: a missing audio library must not
    stop a study that makes no sound.

    Parameters
    ----------
    plugins
        Instead of those that are installed.
    study
        A protocol; the plugins in the folder next to it are collected as well.

    Raises
    ------
    PluginError
        Two plugins offer the same name, which is then ambiguous.
    """
    return Registry(PluginModules(plugins, study))
