"""All commands, and how an error reaches the user.

Importing this must stay instant: a command imports what it needs when it runs.
"""

import os
import sys
from collections.abc import Sequence

import typer
from rich.console import Console

from labcrane.cli import (
    approval,
    doctor,
    extension,
    feedback,
    inspect,
    people,
    plugins,
    recording,
    results,
    running,
    scoring,
    simulating,
    upkeep,
)
from labcrane.errors import LabcraneError, ProtocolError

app = typer.Typer(
    help="Studies of people operating cranes and manipulators.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
app.command("demo")(running.demo)
app.command("run")(running.run)
app.command("resume")(running.resume)
app.command("check")(inspect.check)
app.command("plan")(inspect.plan)
app.command("doctor")(doctor.doctor)
app.add_typer(plugins.app, name="plugins")
app.command("schema")(plugins.schema)
app.command("new-plugin")(plugins.new_plugin)
app.command("streams")(recording.streams)
app.command("record")(recording.record)
app.command("recover")(recording.recover)
app.command("resync")(recording.resync)
app.command("score")(scoring.score)
app.command("export")(results.export)
app.command("report")(results.report)
app.command("simulate")(simulating.simulate)
app.command("power")(simulating.power)
app.command("replay")(results.replay)
app.command("approve")(approval.approve)
app.command("amend")(approval.amend)
app.command("methods")(approval.methods)
app.command("participants")(people.participants)
app.command("consent")(people.consent)
app.command("exclude")(people.exclude)
app.command("note")(people.note)
app.command("waive")(people.waive)
app.command("deviations")(people.deviations)
app.command("erase")(upkeep.erase)
app.command("relabel")(upkeep.relabel)
app.command("transfer")(upkeep.transfer)

feedback_app = typer.Typer(help="Views and sounds.", no_args_is_help=True)
feedback_app.command("preview")(feedback.preview)
app.add_typer(feedback_app, name="feedback")

PRIVATE = 0o077
"""What labcrane writes is about people: nobody but the user may read it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit status: 2 for what cannot be run as written."""
    before = os.umask(PRIVATE)
    try:
        words = sys.argv[1:] if arguments is None else list(arguments)
        extension.extend(app, words)
        app(args=words)
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else 0
    except LabcraneError as error:
        complaint = Console(stderr=True, soft_wrap=True)
        for line in (f"labcrane: {error}", *getattr(error, "__notes__", ())):
            complaint.print(line, markup=False, highlight=False)
        return 2 if isinstance(error, ProtocolError) else 1
    finally:
        os.umask(before)
    return 0
