"""Groups of commands from plugins, added to labcrane's own."""

import re
import sys
from collections.abc import Callable, Mapping
from importlib.machinery import ModuleSpec

import typer

from labcrane.cli.help import Plain
from labcrane.errors import PluginError
from labcrane.registry.entry_points import entry_points_of

GROUP = "labcrane.commands"
"""Entry points that name a group of commands, and the module with its hook: known without importing
any plugin (docs/decisions/0110-offers-by-entry-point.md)."""

DOCSTRING = re.compile(r"(?:\s|#.*\n)*(?P<quote>\"{3}|'{3}|\"|')(?P<line>.+?)(?:(?P=quote)|\n)")
"""The beginning of a module with a docstring."""


def extend(app: typer.Typer, first: str, *, everything: bool) -> None:
    """Add the groups of installed plugins, and fill the one that the command line begins with.

    With ``everything``, as for a shell that completes what is typed, all of them are filled.
    """
    own = {command.name for command in app.registered_commands}
    # Two plugins can share a group; the one found first provides the help.
    modules = {
        point.name: point.value.partition(":")[0]
        for point in reversed(list(entry_points_of(GROUP)))
    }
    for group, module in sorted(modules.items()):
        if group in own:
            raise PluginError(
                f"a plugin offers commands {group!r}, but {group!r} is a command of labcrane; "
                "uninstall it"
            )
        if group not in {there.name for there in app.registered_groups}:
            add(app, group, description(module))
        if group == first or everything:
            fill(app, group, _offered(group))


def add(app: typer.Typer, group: str, about: str) -> None:
    """Add a group without commands."""
    made = typer.Typer(no_args_is_help=True, help=about, rich_markup_mode=None)
    made.callback()(_nothing)  # a group stays a group, even with one command
    app.add_typer(made, name=group, short_help=about)  # or it would be cut off


def fill(app: typer.Typer, group: str, commands: Mapping[str, Callable[..., None]]) -> None:
    """Add commands to a group."""
    for there in app.registered_groups:
        if there.name == group and there.typer_instance is not None:
            for name, run in commands.items():
                there.typer_instance.command(name, cls=Plain, short_help=first_line(run))(run)


def first_line(run: Callable[..., None]) -> str:
    """Return a command's help for a list of commands, whole."""
    return (run.__doc__ or "").partition("\n")[0]


def description(module: str) -> str:
    """Return the first line of a module's docstring, without importing the module."""
    place: list[str] | None = None
    spec: ModuleSpec | None = None
    whole = ""
    for part in module.split("."):
        whole = f"{whole}.{part}".lstrip(".")
        found = (finder.find_spec(whole, place) for finder in sys.meta_path)
        spec = next((each for each in found if each), None)
        if spec is None:
            return "Not there any more: labcrane plugins says what is missing."
        place = spec.submodule_search_locations
    get_source = getattr(spec and spec.loader, "get_source", lambda name: None)
    said = DOCSTRING.match(get_source(whole) or "")
    return said["line"] if said else f"Commands of {module}."


def _offered(group: str) -> dict[str, Callable[..., None]]:
    from labcrane.registry.commands import plugin_commands

    points = [point for point in entry_points_of(GROUP) if point.name == group]
    return {
        name: offer.run
        for (its_group, name), offer in plugin_commands(points).items()
        if its_group == group
    }


def _nothing() -> None:
    """Commands of plugins."""
