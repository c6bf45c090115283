"""Commands of plugins, put beside labcrane's own."""

import typer

from labcrane.errors import PluginError
from labcrane.plugin_commands import plugin_commands


def extend(app: typer.Typer) -> None:
    """Add what installed plugins offer; doing it again changes nothing."""
    own = {command.name for command in app.registered_commands}
    groups = {group.name: group.typer_instance for group in app.registered_groups}
    for (group, name), offer in plugin_commands().items():
        if group in own:
            raise PluginError(
                f"a plugin offers {group} {name!r}, but {group!r} is a command of labcrane; "
                "uninstall it"
            )
        if group not in groups:
            made = typer.Typer(no_args_is_help=True, help=f"Commands about {group}.")
            made.callback()(_nothing)  # a group stays a group, even with one command
            app.add_typer(made, name=group)
            groups[group] = made
        holder = groups[group]
        if holder and name not in {command.name for command in holder.registered_commands}:
            holder.command(name)(offer.run)


def _nothing() -> None:
    """Commands of plugins."""
