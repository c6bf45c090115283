"""Commands about streams and recordings: streams, record, recover, resync."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labcrane.cli.options import Local, stay_on_this_computer
from labcrane.cli.output import out
from labcrane.errors import ProtocolError, RecordingError

if TYPE_CHECKING:
    from labcrane.streams.recorder.handle import RecorderHandle
    from labcrane.streams.request import StreamRequest


def streams(
    wait: Annotated[float, typer.Option(help="seconds to look for", min=0.1)] = 1.5,
    local: Local = False,
) -> None:
    """List the streams on the network."""
    from rich.table import Table

    if local:
        stay_on_this_computer()
    from labcrane.streams.discovery import discover

    found = discover(wait)
    table = Table("name", "type", "rate Hz", "channels", "units", "host", "offset s", "source id")
    for one in found:
        table.add_row(
            one.name,
            one.type,
            f"{one.rate_hz:g}" if one.rate_hz else "irregular",
            str(one.channels),
            ", ".join(one.units) or "-",
            one.host,
            "-" if one.offset_s is None else f"{one.offset_s:+.6f}",
            one.source_id or "-",
        )
    out.print(table if found else f"no stream answered within {wait:g} s")
    for one in found:
        for warning in one.warnings:
            out.print(f"{one.name}: {warning}", markup=False)


def record(
    folder: Annotated[Path, typer.Argument(help="where the recording goes; must be new")],
    stream: Annotated[
        list[str],
        typer.Option(help="what to record: type=EEG, name=Gaze or source_id=...; may be repeated"),
    ],
    seconds: Annotated[
        float | None, typer.Option(help="how long; until Ctrl-C by default", min=0.1)
    ] = None,
    local: Local = False,
) -> None:
    """Record streams without an experiment."""
    if local:
        stay_on_this_computer()
    from labcrane.recording.paths import journal_path
    from labcrane.streams.recorder.handle import RecorderHandle

    requests = [_wanted(text) for text in stream]
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        raise RecordingError(f"{folder} exists; give a new folder for the recording") from None
    keeper = RecorderHandle(journal_path(folder, 1, "streams"), requests)
    out.print("recording; Ctrl-C ends it")
    try:
        _wait(keeper, seconds)
    finally:
        keeper.stop()
    _recover(folder)


def _wanted(text: str) -> "StreamRequest":
    from labcrane.streams.request import StreamRequest

    key, _, value = text.partition("=")
    if key not in {"type", "name", "source_id"} or not value:
        raise ProtocolError(f"stream {text!r} must be type=..., name=... or source_id=...")
    return StreamRequest.of({"label": text, key: value})


def _wait(keeper: "RecorderHandle", seconds: float | None) -> None:
    ends = None if seconds is None else time.monotonic() + seconds
    told: list[str] = []
    try:
        while ends is None or time.monotonic() < ends:
            if keeper.watch():
                out.print("the recorder died and was started again")
            if keeper.status and keeper.complaints() != told:
                told = keeper.complaints()
                for line in told:
                    out.print(line, markup=False)
            time.sleep(0.1)
    except KeyboardInterrupt:
        return


def recover(
    folder: Annotated[Path, typer.Argument(help="the study's data folder, or a part of it")],
) -> None:
    """Make participant files of whatever journals a crash left."""
    _recover(folder)


def _recover(folder: Path) -> None:
    from labcrane.recording.participant_file import recover as recovery
    from labcrane.session.postprocess import conclude

    found = recovery.recover(folder, conclude)
    for each in found:
        where = f"{each.path}, session {each.session}"
        if each.problem:
            out.print(f"{where}: {each.problem}", markup=False, style="red")
        elif each.done is None:
            out.print(f"{where}: was complete", markup=False)
        else:
            kept = f"{each.done.frames} frames, {each.done.events} events"
            samples = "".join(f", {n} of {name}" for name, n in each.done.streams.items())
            out.print(f"{where}: {kept}{samples}", markup=False)
            for note in each.done.notes:
                out.print(f"  {note}", markup=False)
        if each.where:
            out.print(f"  its process was last in {each.where}", markup=False)
    if not found:
        out.print(f"no journals below {folder}", markup=False)
    if problems := sum(bool(each.problem) for each in found):
        raise RecordingError(
            f"{problems} of {len(found)} sessions could not be recovered; it is said of each why: "
            f"remove the cause, and run labcrane recover {folder} again"
        )


def resync(
    file: Annotated[Path, typer.Argument(help="a participant file")],
) -> None:
    """Correct the clocks of a participant file's streams again, from what it holds."""
    from labcrane.recording.participant_file.recorrect import recorrect
    from labcrane.session.postprocess import conclude

    for session, names in recorrect(file, conclude).items():
        out.print(f"session {session}: {', '.join(names) or 'no streams'}", markup=False)
