"""Commands about streams and recordings: streams, record, recover, resync."""

import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from labcrane.cli.options import (
    STUDY,
    Local,
    data_here,
    data_in,
    protocol_in,
    stay_on_this_computer,
    study_of,
)
from labcrane.cli.output import out
from labcrane.errors import ProtocolError, RecordingError, nearest

if TYPE_CHECKING:
    from labcrane.monitoring.config import MonitorBuilder
    from labcrane.monitoring.watch import StreamWatch
    from labcrane.streams.recorder.handle import RecorderHandle
    from labcrane.streams.request import StreamRequest


def streams(
    wait: Annotated[float, typer.Option(help="seconds to search", min=0.1)] = 1.5,
    watch: Annotated[
        bool, typer.Option("--watch", help="keep running and report whether each signal is alive")
    ] = False,
    seconds: Annotated[
        float | None, typer.Option(help="seconds to monitor; until Ctrl-C by default", min=0.1)
    ] = None,
    protocol: Annotated[
        Path | None,
        typer.Option(help="protocol whose monitors and streams are used", callback=protocol_in),
    ] = None,
    local: Local = False,
) -> None:
    """List or monitor the LSL streams on the network."""
    if local:
        stay_on_this_computer()
    if watch:
        _watch(wait, seconds, protocol)
        return
    if seconds is not None or protocol is not None:
        raise ProtocolError("--seconds and --protocol belong to --watch; add it")
    from labcrane.streams.discovery import discover

    found = discover(wait)
    if not found:
        out.print(f"no stream answered within {wait:g} s")
    for one in found:
        # No table: names and source ids are longer than a terminal's columns.
        rate = f"{one.rate_hz:g} Hz" if one.rate_hz else "irregular"
        clock = "unknown" if one.offset_s is None else f"{one.offset_s:+.6f} s"
        units = ", ".join(dict.fromkeys(one.units)) or "no units"
        out.print(f"{one.name}: {one.type or 'no type'}, {rate}", markup=False)
        out.print(f"  channels: {one.channels} ({units})", markup=False)
        out.print(f"  host: {one.host}, clock offset {clock}", markup=False)
        out.print(f"  source id: {one.source_id or 'none'}", markup=False)
        for warning in one.warnings:
            out.print(f"{one.name}: {warning}", markup=False)


def _watch(wait: float, seconds: float | None, protocol: Path | None) -> None:
    from labcrane.monitoring.watch import StreamWatch
    from labcrane.streams.search import find

    builder = _monitors(protocol)
    infos = find("", wait, minimum=sys.maxsize)
    if not infos:
        out.print(f"no stream answered within {wait:g} s")
        return
    watch = StreamWatch(infos, builder)
    try:
        _show(watch, seconds)
    finally:
        watch.close()


def _monitors(protocol: Path | None) -> "MonitorBuilder":
    """Return signal monitors: those of a protocol, or all that are installed."""
    from labcrane.monitoring.config import MonitorBuilder, MonitorConfig

    if protocol is None:
        return MonitorBuilder(MonitorConfig())

    study = study_of(protocol)
    chosen, folder = study.monitors, protocol.parent
    use = None if chosen is None else [one.described(folder) for one in chosen.values()]
    return MonitorBuilder(MonitorConfig(str(protocol), study.protocol.machine, use))


def _show(watch: "StreamWatch", seconds: float | None) -> None:
    """Show the streams, repeatedly on a terminal, otherwise once at the end."""
    from rich.live import Live
    from rich.text import Text

    from labcrane.cli.streams import watched_lines

    def text() -> Text:
        width = min(out.console.width, 100)
        return Text(
            "\n".join(line for view in watch.views() for line in watched_lines(view, width))
        )

    ends = None if seconds is None else time.monotonic() + seconds
    live = Live(console=out.console, auto_refresh=False, transient=True)
    try:
        with live:
            while ends is None or time.monotonic() < ends:
                if out.console.is_terminal:
                    live.update(text(), refresh=True)
                time.sleep(0.25)
    except KeyboardInterrupt:
        pass
    out.console.print(text())


def record(
    folder: Annotated[Path, typer.Argument(help="folder for the recording; must be new")],
    stream: Annotated[
        list[str],
        typer.Option(
            help="what to record: type=EEG (all of that type), name=Gaze or source_id=...; "
            "may be repeated"
        ),
    ],
    seconds: Annotated[
        float | None,
        typer.Option(help="seconds, once all streams send; until Ctrl-C by default", min=0.1),
    ] = None,
    local: Local = False,
) -> None:
    """Record LSL streams without running an experiment."""
    if local:
        stay_on_this_computer()
    from labcrane.recording.paths import journal_path
    from labcrane.streams.recorder.handle import RecorderHandle

    requests = [_wanted(text) for text in stream]
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        raise RecordingError(f"{folder} exists; give a new folder for the recording") from None
    recorder = RecorderHandle(journal_path(folder, 1, "streams"), requests, {})
    out.print("recording; Ctrl-C ends it")
    try:
        _wait(recorder, seconds)
    finally:
        recorder.stop()
    _recover(folder)


def _wanted(text: str) -> "StreamRequest":
    from labcrane.streams.request import StreamRequest

    key, _, value = text.partition("=")
    if key not in {"type", "name", "source_id"} or not value:
        raise ProtocolError(f"stream {text!r} must be type=..., name=... or source_id=...")
    return StreamRequest.of({"label": text, key: value, "several": key == "type"})


def _wait(recorder: "RecorderHandle", seconds: float | None) -> None:
    from labcrane.launcher.signal_reporter import SignalReporter

    ends: float | None = None
    told: list[str] = []
    reporter = SignalReporter(lambda line: out.print(line, markup=False))
    try:
        while ends is None or time.monotonic() < ends:
            if ends is None and seconds is not None and _flows(recorder.status):
                ends = time.monotonic() + seconds
            if recorder.watch():
                out.print("the recorder died and was started again")
            if recorder.complaints() != told:
                told = recorder.complaints()
                for line in told:
                    out.print(line, markup=False)
            reporter.news(recorder)
            time.sleep(0.1)
    except KeyboardInterrupt:
        return


def _flows(status: Mapping[str, Any]) -> bool:
    """Whether every requested stream is recorded; a marker may not have come yet."""
    streams = status.get("streams", ())
    return bool(streams) and all(
        one["condition"] == "flows" or (one["condition"] == "empty" and not one["nominal_hz"])
        for one in streams
    )


def recover(
    study: Annotated[
        Path,
        typer.Argument(
            metavar="STUDY",
            help=f"{STUDY}, or a folder in that",
            callback=data_in,
            default_factory=data_here,
            show_default="here",
        ),
    ],
) -> None:
    """Rebuild participant files from the journals a crash left."""
    _recover(study)


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
            f"{problems} of {len(found)} sessions could not be recovered (reasons "
            f"above); fix them and run labcrane recover {folder} again"
        )


def resync(
    file: Annotated[Path, typer.Argument(help="a participant file, or any XDF file")],
    space: Annotated[
        list[str] | None,
        typer.Option(
            metavar="STREAM=screen|scene", help="declare whose pixels a gaze stream is in"
        ),
    ] = None,
) -> None:
    """Recompute the clock corrections of a participant file, or of any XDF file."""
    if file.suffix.lower() == ".xdfz":
        raise RecordingError(
            f"{file} is packed: unpack it into an .xdf file first (gunzip -S .xdfz)"
        )
    if file.suffix.lower() == ".xdf":
        if space:
            raise RecordingError("--space is for participant files; gaze of an XDF is not measured")
        _resync_xdf(file)
        return
    from functools import partial

    from labcrane.recording.participant_file.recorrect import recorrect
    from labcrane.session.postprocess import conclude

    declared = _spaces(file, space or ())
    for session, names in recorrect(file, partial(conclude, spaces=declared)).items():
        out.print(f"session {session}: {', '.join(names) or 'no streams'}", markup=False)


def _spaces(file: Path, declared: Sequence[str]) -> dict[str, str]:
    """Return the spaces that ``STREAM=SPACE`` declares for streams in the file."""
    from labcrane.analysis.gaze_streams import KIND, SCENE, SCREEN
    from labcrane.recording.participant_file.reader import open_recording

    spaces = dict(each.rpartition("=")[::2] for each in declared)
    record = open_recording(file)
    streams = [each for n in record.sessions for each in record.session(n).streams.values()]
    there = list(dict.fromkeys(each.name for each in streams if each.attrs.get("type") == KIND))
    for name, said in spaces.items():
        if said not in {SCREEN, SCENE}:
            raise RecordingError(
                f"--space {name}={said}: gaze is in pixels of the participant's window "
                f"({SCREEN}) or of a scene camera ({SCENE})"
            )
        if name not in there:
            told = nearest(name, there, "there is")
            raise RecordingError(f"--space: {file} has no gaze stream {name!r}; {told}")
    return spaces


def _resync_xdf(file: Path) -> None:
    from labcrane.cli.sync import print_report
    from labcrane.clocks.xdf import resync_xdf

    done = resync_xdf(file)
    for line in done.damage:
        out.print(line, style="yellow", markup=False)
    print_report(done.report)
    if done.unread_by_pyxdf:
        out.print(f"pyxdf could not read it: {done.unread_by_pyxdf}", markup=False)
    for name, (usual, most) in done.against_pyxdf.items():
        out.print(
            f"{name}: pyxdf's times are {1e3 * usual:.3f} ms away, {1e3 * most:.3f} ms at most",
            markup=False,
        )
    out.print(f"corrected times and their errors are in {done.path}", markup=False)
