"""Commands that check the computer before a study day, and report a problem."""

import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labcrane.cli.commands.delay import WORDS, measure_delay
from labcrane.cli.options import (
    STUDY,
    DataBeside,
    Local,
    data_folder,
    protocol_in,
    stay_on_this_computer,
)
from labcrane.cli.output import out
from labcrane.cli.sync import STYLES
from labcrane.cli.typed import from_terminal
from labcrane.errors import ProtocolError, RecordingError, nearest

if TYPE_CHECKING:
    from labcrane.doctor.report import Check, Diagnosis
    from labcrane.protocol.study import Study

ARCHIVE = Path("labcrane-problem.zip")

MOST_LINES = 60
"""Lines of a file that are printed at once; ``--show`` prints all of them."""


def doctor(
    study: Annotated[
        Path | None,
        typer.Argument(
            metavar="STUDY",
            help=f"as --protocol: {STUDY}",
            callback=protocol_in,
            show_default=False,
        ),
    ] = None,
    protocol: Annotated[
        Path | None,
        typer.Option(help="check only what this study needs", callback=protocol_in),
    ] = None,
    data: DataBeside = None,
    peer: Annotated[
        list[str] | None, typer.Option(help="computer that sends a stream; may be repeated")
    ] = None,
    move: Annotated[
        bool, typer.Option("--move", help="you can move the controls when asked")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON, for scripts")] = False,
    display: Annotated[
        bool, typer.Option("--display", help="measure a view's delay with a photodiode instead")
    ] = False,
    audio: Annotated[
        bool, typer.Option("--audio", help="measure a sound's delay with a microphone instead")
    ] = False,
    touch: Annotated[
        bool,
        typer.Option("--touch", help="measure a vibration's delay with an accelerometer instead"),
    ] = False,
    stream: Annotated[
        str | None, typer.Option(help="LSL stream of the sensor; without it nothing is measured")
    ] = None,
    channel: Annotated[int, typer.Option(help="the stream's channel", min=1)] = 1,
    name: Annotated[
        str | None, typer.Option(help="which view, sound or vibration; the only one by default")
    ] = None,
    count: Annotated[int, typer.Option(help="how many changes are presented", min=2)] = 100,
    local: Local = False,
) -> None:
    """Check this computer before a study day, with a remedy for each problem."""
    if study is not None and protocol is not None:
        raise ProtocolError(
            f"the study was given twice, as {study} and as --protocol {protocol}; give it once"
        )
    protocol = study or protocol
    if local:
        stay_on_this_computer()
    asked = {"display": display, "audio": audio, "touch": touch}
    if any(asked.values()):
        if protocol is None:
            raise ProtocolError(
                "give the study whose views, sounds and vibrations to measure: --protocol "
                "protocol.yaml"
            )
        for kind in WORDS:
            if asked[kind]:
                measure_delay(kind, protocol, stream, name, count, channel)
    else:
        _examine(protocol, data, peer or (), move=move, as_json=as_json)


def _examine(
    protocol: Path | None, data: Path | None, peers: Sequence[str], *, move: bool, as_json: bool
) -> None:
    from labcrane.core.findings import Verdict
    from labcrane.doctor import disk
    from labcrane.doctor.checks import examine, keep_apart, left_out
    from labcrane.doctor.report import diagnosis
    from labcrane.protocol.study import load
    from labcrane.registry.registry import discover

    registry = discover(study=protocol)
    study = load(protocol, registry) if protocol else None
    folder = data_folder(data, protocol)
    needed = _session_bytes(study) if study else disk.NEEDED_BYTES
    checks: list[Check] = []
    looked = examine(folder, registry, study, needed_bytes=needed, peers=peers, move=move)
    for check in chain(looked, _rates(study, checks)):
        checks.append(check)
        if not as_json:
            _print(check)
    found = diagnosis(checks, left_out(registry, study))
    if as_json:
        print(json.dumps(found.as_data(), indent=1, ensure_ascii=False))
    else:
        for line in found.left_out:
            out.print(f"not looked at: {line}", markup=False, style="dim")
    kept = None
    if study:
        from rich.console import Console

        kept = keep_apart(found, folder)
        said = (
            kept.text if kept.verdict is Verdict.PASS else f"not kept: {kept.text}; {kept.advice}"
        )
        Console(stderr=True, soft_wrap=True).print(said, markup=False)
    if found.verdict is Verdict.FAIL or (kept and kept.verdict is Verdict.FAIL):
        raise typer.Exit(1)


def _rates(study: "Study | None", before: Sequence["Check"]) -> Iterator["Check"]:
    """Yield the picture rates of the operator's views that can be opened."""
    from labcrane.core.findings import Verdict
    from labcrane.doctor import check_process
    from labcrane.doctor.report import Check
    from labcrane.feedback.picture_rate import WAIT_S, rate_examinations

    if study is None:
        return
    for name, examination in rate_examinations(study).items():
        area = f"view {name}"
        if any(each.area == area and each.finding.verdict is Verdict.FAIL for each in before):
            continue  # it cannot be opened, which is said
        for finding in check_process.examine(examination, wait_s=WAIT_S):
            yield Check(area, finding)


def _print(check: "Check") -> None:
    from rich.text import Text

    found = check.finding
    line = Text(f"{found.verdict.value} ", style=STYLES[found.verdict.value])
    out.print(line.append(f"{check.area}: {found.text}", style="default"))
    if found.advice:
        out.print(Text(f"     {found.advice}"))


def _session_bytes(study: "Study") -> float:
    """Return the space of the longest session, with the margin that ``labcrane run`` requires."""
    from labcrane.design.plan import plan_session
    from labcrane.files.pseudonyms import pseudonyms
    from labcrane.protocol.rig import Rig
    from labcrane.recording.data_folder import needed_bytes
    from labcrane.recording.frame_log import frame_bytes
    from labcrane.session.session import RESERVE_S

    (name,) = pseudonyms(study.protocol.participants.pattern, 1)
    run = Rig.build(study, simulated=True).describe(study, 0)
    longest = max(
        plan_session(study, name, number).expected_s
        for number in range(1, len(study.protocol.sessions) + 1)
    )
    return needed_bytes(longest, frame_bytes(run) * run.rate_hz, RESERVE_S)


def report_problem(
    protocol: Annotated[
        Path | None, typer.Option(help="the study that it is about", callback=protocol_in)
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(help="data folder, or a part of it; data/ beside the protocol by default"),
    ] = None,
    session: Annotated[
        int | None, typer.Option(help="which session; the last one written by default", min=1)
    ] = None,
    to: Annotated[Path, typer.Option(help="file that is written; must be new")] = ARCHIVE,
    show: Annotated[
        str | None, typer.Option(help="print this file of the archive, and write nothing")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="do not ask; for scripts")] = False,
    local: Local = False,
) -> None:
    """Write an archive for a bug report, with nothing of people in it.

    It is shown before it is written. It has versions, the doctor's verdicts, and the events
    of the last session: no text that a person wrote, no names, and no messages of errors.
    """
    from labcrane.cli.problem_report import (
        check_new,
        compose,
        find_session,
        write,
    )
    from labcrane.files.names import absent

    if local:
        stay_on_this_computer()
    if show is None:
        check_new(to)  # before the doctor takes half a minute
    if protocol is not None and not protocol.is_file():
        raise ProtocolError(f"{protocol}: {absent(protocol)}")
    folder = data_folder(data, protocol)
    if data is not None and not folder.is_dir():
        raise RecordingError(f"there is no folder {folder}; give the study's data folder")
    found_session = find_session(folder, session)
    found, trouble = _examined(protocol, folder)
    files = compose(found, trouble, found_session)
    if show is not None:
        if show not in files:
            raise ProtocolError(f"--show {show}: {nearest(show, files, 'the archive has')}")
        print(files[show], end="")
        return
    _print_files(files)
    if found_session is None:
        out.print(f"no session: there is no journal below {folder}", markup=False)
    if not (yes or _agreed(to)):
        out.print("nothing was written")
        return
    write(files, to)
    out.print(f"written: {to}", markup=False)


def _examined(
    protocol: Path | None, folder: Path
) -> tuple["Diagnosis | None", Sequence[Exception]]:
    """Return what the doctor finds, and what kept it or the study from being read."""
    from labcrane.doctor.checks import examine, left_out
    from labcrane.doctor.report import diagnosis
    from labcrane.protocol.study import load
    from labcrane.registry.registry import discover

    study, trouble = None, list[Exception]()
    try:
        registry = discover()
        if protocol is not None:
            try:
                with_own = discover(study=protocol)
                study, registry = load(protocol, with_own), with_own
            except Exception as error:  # noqa: BLE001 - any fault may be what the report is about
                trouble.append(error)
        return diagnosis(examine(folder, registry, study), left_out(registry, study)), trouble
    except Exception as error:  # noqa: BLE001 - as above
        return None, [*trouble, error]


def _print_files(files: Mapping[str, str]) -> None:
    """Print every file with its size, and as much of it as can be read at once."""
    for name, text in files.items():
        lines = text.splitlines()
        out.print(f"== {name}, {len(text.encode())} bytes", markup=False, style="bold")
        print("\n".join(lines[:MOST_LINES]))
        if (more := len(lines) - MOST_LINES) > 0:
            out.print(
                f"... and {more} lines more; the same command with --show {name} prints all of it",
                markup=False,
            )


def _agreed(to: Path) -> bool:
    """Ask whether all of that may be written.

    Raises
    ------
    ProtocolError
        There is no terminal.
    """
    if not from_terminal():
        raise ProtocolError(
            "nothing was written: it is shown first, and there is no terminal at which to ask; "
            "--yes writes it without asking, --show NAME prints one of its files"
        )
    return typer.confirm(f"Write these files into {to}?")
