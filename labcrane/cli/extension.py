"""Commands of plugins, put beside labcrane's own."""

from collections.abc import Sequence
from importlib.metadata import EntryPoints, entry_points

import typer

from labcrane.errors import PluginError

GROUP = "labcrane.commands"
"""Entry points that name a group of commands, and the module with its hook: known without importing
any plugin (docs/decisions/0091-groups-by-entry-point.md)."""


def extend(app: typer.Typer, words: Sequence[str]) -> None:
    """Add the groups of installed plugins; doing it again changes nothing.

    Plugins are imported only for the group that ``words``, the command line, begins with.
    """
    own = {command.name for command in app.registered_commands}
    there = {
        group.name: group.typer_instance
        for group in app.registered_groups
        if group.typer_instance is not None
    }
    points = entry_points(group=GROUP)
    for group in sorted(points.names):
        if group in own:
            raise PluginError(
                f"a plugin offers commands {group!r}, but {group!r} is a command of labcrane; "
                "uninstall it"
            )
        if group not in there:
            there[group] = typer.Typer(no_args_is_help=True, help=f"Commands about {group}.")
            there[group].callback()(_nothing)  # a group stays a group, even with one command
            app.add_typer(there[group], name=group)
        if words and words[0] == group:
            _fill(there[group], group, points.select(name=group))


def _fill(holder: typer.Typer, group: str, points: EntryPoints) -> None:
    from labcrane.plugin_commands import plugin_commands

    for (its_group, name), offer in plugin_commands(points).items():
        known = {command.name for command in holder.registered_commands}
        if its_group == group and name not in known:
            holder.command(name)(offer.run)


def _nothing() -> None:
    """Commands of plugins."""
