"""All commands, and how an error reaches the user.

Importing this must stay instant: a command's module is imported when the command line begins with
its name, and a command imports what it needs when it runs. The list of all commands takes their
names and their help only.
"""

import io
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Annotated

import typer

from labcrane.cli import plugin_groups as extension
from labcrane.cli.help import Plain, Sections
from labcrane.errors import LabcraneError, PluginError, ProtocolError

MODULES = {
    "run": ("demo", "run", "resume"),
    "check": ("new_study", "check", "plan"),
    "doctor": ("doctor", "report_problem"),
    "plugins": ("schema", "new_plugin"),
    "language_server": ("language_server",),
    "record": ("streams", "record", "recover", "resync"),
    "score": ("score",),
    "results": ("export", "report", "replay", "view"),
    "simulate": ("simulate", "power", "tracks"),
    "engines": ("compare_engines",),
    "approval": ("approve", "amend", "methods", "bundle"),
    "participants": (
        "participants", "study", "consent", "exclude", "note", "waive", "deviations",
    ),
    "data": ("where", "erase", "relabel", "transfer"),
}  # fmt: skip
"""Where commands are: a module, and its functions."""

FEEDBACK, PLUGINS = "feedback", "plugins"
"""Groups, and the modules they are in."""

COMPLETING = "_LABCRANE_COMPLETE"
"""Set by a shell that wants to know what can follow."""

UTF8 = ("utf-8", "utf8")
"""Names of the encoding in which everything is written."""

PRIVATE = 0o077
"""What labcrane writes is about people: nobody but the user may read it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit status: 2 for what cannot be run as written."""
    before = os.umask(PRIVATE)
    speak_utf8()
    # Pydantic would look for plugins of its own in all that is installed.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    try:
        words = sys.argv[1:] if arguments is None else list(arguments)
        commands(words)(args=words, prog_name="labcrane")
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else 0
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("labcrane"):
            raise
        from labcrane.registry.offers import LAB

        complain(PluginError(f"this needs {error.name}, which is not installed: {LAB}"))
        return 1
    except LabcraneError as error:
        complain(error)
        return 2 if isinstance(error, ProtocolError) else 1
    finally:
        os.umask(before)
    return 0


def speak_utf8() -> None:
    """Let what is printed into a file or a pipe be UTF-8, here and in processes started here.

    On Windows it would be the code page of the country, which has no word for much of what people
    write. A terminal keeps its own encoding, and shows a mark for what that does not have.
    """
    os.environ["PYTHONIOENCODING"] = "utf-8"
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.encoding.lower() not in UTF8:
            if stream.isatty():
                stream.reconfigure(errors="replace")
            else:
                stream.reconfigure(encoding="utf-8", errors=stream.errors)


def complain(error: LabcraneError) -> None:
    """Say on the standard error what went wrong, and what to do."""
    from rich.console import Console

    complaint = Console(stderr=True, soft_wrap=True)
    for line in (f"labcrane: {error}", *getattr(error, "__notes__", ())):
        complaint.print(line, markup=False, highlight=False)


def commands(words: Sequence[str]) -> typer.Typer:
    """Return the command line as far as ``words`` ask for it."""
    first = words[0] if words else ""
    known = {name.replace("_", "-"): module for module, names in MODULES.items() for name in names}
    app = typer.Typer(
        no_args_is_help=True,
        add_completion=first not in known,  # its options come before a command
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # what draws boxes round the help takes longer than all the rest
        cls=Sections,
    )
    app.callback()(_labcrane)
    everything = COMPLETING in os.environ
    if first in known:
        app.command(first, cls=Plain)(_function(known[first], first))
        return app
    for name, module in known.items():
        run = _function(module, name)
        about = extension.first_line(run)
        app.command(name, short_help=about)(run if everything else _stub(run))
    if first == PLUGINS or everything:
        app.add_typer(import_module(f"labcrane.cli.commands.{PLUGINS}").app, name=PLUGINS)
    else:
        extension.add(app, PLUGINS, "What installed plugins offer.")
    extension.add(app, FEEDBACK, "Views and sounds.")
    if first == FEEDBACK or everything:
        extension.fill(app, FEEDBACK, {"preview": _function(FEEDBACK, "preview")})
    extension.extend(app, first, everything=everything)
    return app


def _function(module: str, name: str) -> Callable[..., None]:
    there = import_module(f"labcrane.cli.commands.{module}")
    found: Callable[..., None] = getattr(there, name.replace("-", "_"))
    return found


def _stub(run: Callable[..., None]) -> Callable[[], None]:
    """Return what has the help of a command and nothing else: options take long to work out."""

    def stub() -> None:
        raise AssertionError("a command that is asked for is not a stub")

    stub.__doc__ = run.__doc__
    return stub


def _version(asked: bool) -> None:  # noqa: FBT001 - as typer calls it
    if asked:
        from labcrane.doctor.versions import versions

        for line in versions():
            typer.echo(line)
        raise typer.Exit


def _labcrane(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="what a bug report needs"),
    ] = False,
) -> None:
    """Studies of people operating cranes and manipulators."""
    del version  # it has been printed
