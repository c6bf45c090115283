"""All commands, and the output of errors.

Importing this must stay instant: a command's module is imported when the command line begins with
its name, and a command imports what it needs when it runs. The list of all commands reads only
their names and help lines.
"""

import io
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Annotated, Any

import typer

from labcrane.cli import plugin_groups as extension
from labcrane.cli.help import Plain, Sections
from labcrane.errors import (
    LabcraneError,
    OutdatedRecordingWarning,
    PluginError,
    ProtocolError,
    StorageError,
)

MODULES = {
    "run": ("demo", "run", "resume"),
    "check": ("start", "new_study", "check", "plan", "pages"),
    "doctor": ("doctor", "report_problem"),
    "plugins": ("schema", "new_plugin"),
    "record": ("streams", "record", "recover", "resync"),
    "score": ("score",),
    "results": ("export", "report", "replay", "view"),
    "simulate": ("simulate", "power"),
    "approval": ("approve", "amend", "methods"),
    "participants": (
        "participants", "study", "consent", "exclude", "note", "waive", "deviations",
    ),
    "data": ("where", "erase", "relabel", "transfer", "merge"),
}  # fmt: skip
"""The module of each command, and its functions."""

FEEDBACK, PLUGINS = "feedback", "plugins"
"""Groups, and the modules that contain them."""

COMPLETING = "_LABCRANE_COMPLETE"
"""Set by a shell that asks for completions."""

UTF8 = ("utf-8", "utf8")
"""Names of the encoding of all output."""

PRIVATE = 0o077
"""labcrane writes personal data: only the user may read its files."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit status: 2 for input that cannot be run as written."""
    before = os.umask(PRIVATE)
    speak_utf8()
    # Pydantic would search all installed packages for its own plugins.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    try:
        words = sys.argv[1:] if arguments is None else list(arguments)
        with warnings.catch_warnings():
            say_what_is_outdated()
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
    except OSError as error:
        if not error.errno:  # not of the system
            raise
        complain(StorageError.of(error))
        return 1
    finally:
        os.umask(before)
    return 0


def speak_utf8() -> None:
    """Print UTF-8 to files and pipes, here and in processes started here.

    On Windows the default is the country's code page, which lacks many characters. A terminal
    keeps its own encoding and shows a replacement for characters that it does not have.
    """
    os.environ["PYTHONIOENCODING"] = "utf-8"
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.encoding.lower() not in UTF8:
            if stream.isatty():
                stream.reconfigure(errors="replace")
            else:
                stream.reconfigure(encoding="utf-8", errors=stream.errors)


def say_what_is_outdated() -> None:
    """Write that an outdated recording is read to the standard error, once for each."""
    otherwise = warnings.showwarning
    said: set[str] = set()

    def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        if not issubclass(category, OutdatedRecordingWarning):
            otherwise(message, category, *place, **more)
        elif str(message) not in said:
            said.add(str(message))
            complain(message)

    warnings.simplefilter("always", OutdatedRecordingWarning)
    warnings.showwarning = show


def complain(error: Warning | LabcraneError | str) -> None:
    """Write an error or a warning, and its remedy, to the standard error."""
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
        rich_markup_mode=None,  # drawing boxes round the help takes longer than all the rest
        cls=Sections,
    )
    app.callback()(_labcrane)
    everything = COMPLETING in os.environ
    if first in known:
        app.command(first, cls=Plain)(function_of(known[first], first))
        return app
    for name, module in known.items():
        run = function_of(module, name)
        about = extension.first_line(run)
        app.command(name, short_help=about)(run if everything else _stub(run))
    if first == PLUGINS or everything:
        app.add_typer(import_module(f"labcrane.cli.commands.{PLUGINS}").app, name=PLUGINS)
    else:
        extension.add(app, PLUGINS, "List installed plugins.")
    extension.add(app, FEEDBACK, "Views and sounds: preview.")
    if first == FEEDBACK or everything:
        extension.fill(app, FEEDBACK, {"preview": function_of(FEEDBACK, "preview")})
    extension.extend(app, first, everything=everything)
    return app


def function_of(module: str, name: str) -> Callable[..., None]:
    """Return the function of a command."""
    there = import_module(f"labcrane.cli.commands.{module}")
    found: Callable[..., None] = getattr(there, name.replace("-", "_"))
    return found


def _stub(run: Callable[..., None]) -> Callable[[], None]:
    """Return a command with help only: computing its options takes long."""

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
        typer.Option(
            "--version",
            callback=_version,
            is_eager=True,
            help="print the versions for a bug report",
        ),
    ] = False,
) -> None:
    """Studies of people operating cranes and manipulators."""
    del version  # it has been printed
