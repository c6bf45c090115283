"""Groups of commands: those of plugins, put beside labcrane's own."""

import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import typer

from labcrane.errors import PluginError

GROUP = "labcrane.commands"
"""Entry points that name a group of commands, and the module with its hook: known without importing
any plugin (docs/decisions/0091-groups-by-entry-point.md)."""


def extend(app: typer.Typer, first: str, *, everything: bool) -> None:
    """Add the groups of installed plugins, and fill the one that the command line begins with.

    With ``everything``, as for a shell that completes what is typed, all of them are filled.
    """
    own = {command.name for command in app.registered_commands}
    for group in sorted(set(declared(GROUP))):
        if group in own:
            raise PluginError(
                f"a plugin offers commands {group!r}, but {group!r} is a command of labcrane; "
                "uninstall it"
            )
        if group not in {there.name for there in app.registered_groups}:
            add(app, group, f"Commands about {group}.")
        if group == first or everything:
            fill(app, group, _offered(group))


def add(app: typer.Typer, group: str, about: str) -> None:
    """Add a group without commands."""
    made = typer.Typer(no_args_is_help=True, help=about, rich_markup_mode=None)
    made.callback()(_nothing)  # a group stays a group, even with one command
    app.add_typer(made, name=group)


def fill(app: typer.Typer, group: str, commands: Mapping[str, Callable[..., None]]) -> None:
    """Add commands to a group."""
    for there in app.registered_groups:
        if there.name == group and there.typer_instance is not None:
            for name, run in commands.items():
                there.typer_instance.command(name, short_help=first_line(run))(run)


def first_line(run: Callable[..., None]) -> str:
    """Return a command's help for a list of commands, whole."""
    return (run.__doc__ or "").partition("\n")[0]


def declared(group: str) -> Iterator[str]:
    """Yield the names of the entry points in a group, of all that is installed in folders.

    Their files are read here, because ``importlib.metadata`` loads what reads mail, which would
    take longer than all the rest of the help. What imports them goes through it all the same.
    """
    for folder in dict.fromkeys(sys.path):
        for path in Path(folder).glob("*.*-info/entry_points.txt"):
            text = path.read_text(encoding="utf-8")
            if group not in text:
                continue
            section = ""
            for line in map(str.strip, text.splitlines()):
                if line.startswith("["):
                    section = line.strip("[] ")
                elif section == group and line and not line.startswith(("#", ";")):
                    yield line.partition("=")[0].strip()


def _offered(group: str) -> dict[str, Callable[..., None]]:
    from importlib.metadata import entry_points

    from labcrane.plugin_commands import plugin_commands

    points = entry_points(group=GROUP, name=group)
    return {
        name: offer.run
        for (its_group, name), offer in plugin_commands(points).items()
        if its_group == group
    }


def _nothing() -> None:
    """Commands of plugins."""
