"""Loader of plugins: those that are installed, and the files in a study's own folder."""

import hashlib
import sys
from collections.abc import Callable, Collection, Iterable, Set
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, NamedTuple, TypeVar

import pluggy

from labcrane.errors import PluginError, suggestion
from labcrane.processes.traceback import told
from labcrane.registry.entry_points import EntryPoint, entry_points_of
from labcrane.registry.hookspecs import PROJECT, ROLES, labcrane_commands
from labcrane.registry.offers import API

OfferT = TypeVar("OfferT")

FOLDER = "plugins"
"""Folder of a study's own plugins, next to its protocol."""


OFFERS = f"{PROJECT}.offers"
"""Entry points that name what a plugin offers, and lead to its module: known without importing it
(docs/decisions/0110-offers-by-entry-point.md)."""


class PluginModules:
    """Imports plugins, each once, when something that it may offer is wanted.

    One that fails is noted, and the others are imported all the same.

    Parameters
    ----------
    installed
        Instead of what is in the ``labcrane`` entry-point group.
    study
        A protocol; the Python files in the folder ``plugins`` next to it are plugins too.

    Attributes
    ----------
    manager
        Knows the hooks of those that were imported.
    broken
        Mistakes of a plugin, by its name.
    local
        The files of the study's own plugins, by name: ``plugins/arrow.py``.
    names
        All there are, imported or not, the study's own last.
    """

    def __init__(
        self, installed: Iterable[EntryPoint] | None = None, study: Path | None = None
    ) -> None:
        self.manager = pluggy.PluginManager(PROJECT)
        self.manager.add_hookspecs(type("Hooks", (), _hooks()))
        self.broken: dict[str, str] = {}
        self.local = own_plugins(study) if study else {}
        offers: dict[str, set[str]] = {}
        if installed is None:
            installed = entry_points_of(PROJECT)
            for point in entry_points_of(OFFERS):
                offers.setdefault(point.value, set()).add(point.name)
        self._waiting = [
            _Waiting(point.name, point.load, offers.get(point.value)) for point in installed
        ]
        self._waiting += [_Waiting(name, _Source(path).load) for name, path in self.local.items()]
        self.names = tuple(each.plugin for each in self._waiting)

    def load(self, offers: Collection[str] | None = None) -> frozenset[str]:
        """Import what may offer something of one of these names, or else all.

        Returns
        -------
        frozenset
            Names of the plugins that were imported now.
        """
        wanted = [each for each in self._waiting if each.may_offer(offers)]
        self._waiting = [each for each in self._waiting if each not in wanted]
        for each in wanted:
            self._load(each)
        return frozenset(each.plugin for each in wanted)

    def _load(self, waiting: "_Waiting") -> None:
        name = waiting.plugin
        try:
            module = waiting.load()
            _check_interface(module)
            self.manager.register(module, name=name)
            _check_hooks(self.manager, module)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - someone else's import
            self.broken[name] = str(error) if isinstance(error, PluginError) else told(error)
            if self.manager.get_plugin(name):
                self.manager.unregister(name=name)


class _Waiting(NamedTuple):
    """A plugin that is not imported yet, with the offers that it declares, if any."""

    plugin: str
    load: Callable[[], ModuleType]
    names: Set[str] | None = None

    def may_offer(self, offers: Collection[str] | None) -> bool:
        return offers is None or self.names is None or not self.names.isdisjoint(offers)


def offered(implementation: pluggy.HookImpl, kind: type[OfferT], made_by: str) -> list[OfferT]:
    """Return the offers of one plugin's hook; ``made_by`` is how a plugin makes such an offer.

    Raises
    ------
    PluginError
        The hook raised something, or returned something else.
    """
    try:
        offers = implementation.function()
    except PluginError:
        raise
    except Exception as error:
        raise PluginError(told(error)) from error
    if isinstance(offers, list | tuple) and all(isinstance(each, kind) for each in offers):
        return list(offers)
    raise PluginError(
        f"{implementation.function.__name__} must return a list of {made_by}, not {offers!r}"
    )


def own_plugins(study: Path) -> dict[str, Path]:
    """Return the plugins in the folder next to a protocol, by name: ``plugins/arrow.py``."""
    return {f"{FOLDER}/{path.name}": path for path in sorted((study.parent / FOLDER).glob("*.py"))}


class _Source(SourceFileLoader):
    """A file that is compiled each time it is loaded: exactly the approved bytes run."""

    def __init__(self, path: Path) -> None:
        # Two studies may each have an arrow.py.
        where = hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:12]
        super().__init__(f"labcrane_study_{where}_{path.stem}", str(path))

    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        code: CodeType = self.source_to_code(self.get_data(path), path)
        return code

    def load(self) -> ModuleType:
        """Import the file as a module of its own."""
        spec = spec_from_file_location(self.name, self.path, loader=self)
        if spec is None:
            raise AssertionError("a loader is given")
        module = module_from_spec(spec)
        sys.modules[self.name] = module  # pydantic looks up annotations there
        self.exec_module(module)
        return module


def _hooks() -> dict[str, Any]:
    """Return every hook there is, by its name."""
    hooks = [*(entry.hook for entry in ROLES.values()), labcrane_commands]
    return {hook.__name__: hook for hook in hooks}


def _check_interface(module: ModuleType) -> None:
    built_for = getattr(module, "labcrane_api", API)
    if built_for != API:
        older = isinstance(built_for, int) and built_for < API
        raise PluginError(
            f"it is built for plugin interface {built_for!r}, and this labcrane has {API}; install "
            f"{'a newer version of the plugin' if older else 'a newer labcrane'}, or see "
            "docs/compatibility.md"
        )


def _check_hooks(manager: pluggy.PluginManager, module: ModuleType) -> None:
    for caller in manager.get_hookcallers(module) or ():
        if not caller.has_spec():
            raise PluginError(f"unknown hook {caller.name!r}; {suggestion(caller.name, _hooks())}")
