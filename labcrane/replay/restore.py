"""The parts of a recorded session: put together again, and compared with what is installed."""

import json
import platform
import re
from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from labcrane.errors import ProtocolError, RecordingError
from labcrane.files.yaml import parse_yaml, read_yaml
from labcrane.protocol.referenced_files import write_files
from labcrane.protocol.study import Study, load
from labcrane.recording.participant_file.reader import SessionRecord
from labcrane.registry.registry import discover

IRRELEVANT = ("pygame", "pylsl")
"""Of the recorded versions, those that bring input in or send frames out, and move nothing."""

MOVING = ("scheme", "dynamics", "tasks.")
"""The parts that a replay runs again."""

OWN = re.compile(r"plugins/[^./\\:\0][^/\\:\0]*\.py")
"""Name of a study's own plugin in a recording."""


def restored_study(
    record: SessionRecord,
    folder: Path,
    protocol: Path | None = None,
    machine: Path | None = None,
    *,
    run_code: bool = False,
) -> Study:
    """Return the study of a recorded session, put together in ``folder``.

    Parameters
    ----------
    protocol, machine
        Files to use instead of the recorded ones; plugins next to a given protocol are imported.
    run_code
        Whether plugins of the study in the recording are imported as well. They are programs of the
        file's author, so this needs the explicit request of a person.

    Raises
    ------
    ProtocolError
        The protocol cannot be run with what is installed.
    RecordingError
        Its record is not in the form that labcrane writes.
    """
    path = restore(record, folder, protocol, machine, run_code=run_code)
    code = own_code(record) if protocol is None else {}
    try:
        plugins = discover(study=path if run_code else protocol)
        return load(path, plugins, recorded=protocol is None)
    except ProtocolError as error:
        if not code or run_code:
            raise
        raise ProtocolError(
            f"{error}\nthe study had plugins of its own, {', '.join(code)}, whose code is in the "
            "recording and is not run, because its author is unknown: give the study's --protocol, "
            "whose folder contains them; or read them (context: own_plugins) and, if you trust the "
            "author of the file, use --run-recorded-code"
        ) from error


def restore(
    record: SessionRecord,
    folder: Path,
    protocol: Path | None,
    machine: Path | None,
    *,
    run_code: bool = False,
) -> Path:
    """Write the recorded protocol and what it refers to into ``folder``; return its path.

    A given ``protocol`` stays where it is, unless a ``machine`` is put into it. Nothing is written
    outside of ``folder``, and no code without ``run_code``, whatever the recording says.
    """
    if protocol is not None and machine is None:
        return protocol
    try:
        content = (
            read_yaml(protocol)
            if protocol
            else parse_yaml(record.protocol, "the protocol", recorded=True)
        )
        described = machine.read_text(encoding="utf-8") if machine else record.context["machine"]
        content["machine"] = "machine.yaml"
        if protocol is None:
            _put_in_questionnaires(content, record)
            _put_in_defaults(content, record)
            write_files(record.context.get("files", {}), folder)
        (folder / "machine.yaml").write_text(described, encoding="utf-8")
        _write_instructions(content, record, folder)
        for name, text in (own_code(record) if run_code and protocol is None else {}).items():
            path = folder / name
            path.parent.mkdir(exist_ok=True)
            path.write_text(text, encoding="utf-8")
    except (AttributeError, KeyError, OSError, TypeError, ValueError) as error:
        if protocol is not None:
            raise
        raise RecordingError(
            "what is recorded of the session's protocol is not as labcrane writes it "
            f"({type(error).__name__}: {error}); run it with --protocol FILE"
        ) from error
    path = folder / "protocol.yaml"
    path.write_text(json.dumps(content), encoding="utf-8")  # JSON is YAML
    return path


def own_code(record: SessionRecord) -> dict[str, str]:
    """Return the code of the study's own plugins that is in a recording, by its file's name.

    Raises
    ------
    RecordingError
        One of them has no name that a study's own plugin can have.
    """
    recorded = record.context.get("own_plugins", {})
    code = {} if not isinstance(recorded, Mapping) else dict(recorded)
    for name, text in code.items():
        if not (OWN.fullmatch(name) and isinstance(text, str)):
            raise RecordingError(
                f"a plugin in the recording is called {name!r}, which no plugin of a study is: "
                "they are files in its folder plugins/; the recording is not as labcrane writes it"
            )
    return code


def _write_instructions(content: Mapping[str, Any], record: SessionRecord, folder: Path) -> None:
    """Write the texts that were shown; those that were not change no state, and are left empty.

    They are called by their numbers: what a protocol calls them may lead anywhere.
    """
    events = record.events
    shown = [
        data.get("text", "") for data in events.loc[events["name"] == "instructions.shown", "data"]
    ]
    number, count = int(record.attrs["session"]), 0
    for at, session in enumerate(content["sessions"], start=1):
        for step in session["steps"]:
            if isinstance(step, dict) and "instructions" in step:
                text = shown.pop(0) if at == number and shown else ""
                count += 1
                step["instructions"] = f"instructions-{count}.txt"
                (folder / step["instructions"]).write_text(text, encoding="utf-8")


def _put_in_defaults(content: Mapping[str, Any], record: SessionRecord) -> None:
    """Use recorded settings for those that were not written: defaults may have changed.

    What a recording does not have either did not exist: plugins know what held in its place.
    """
    components = record.context["components"]
    written = {part: content.get(part) for part in MOVING}
    written |= {f"tasks.{name}": task for name, task in content.get("tasks", {}).items()}
    for part, settings in written.items():
        if isinstance(settings, dict) and (recorded := components.get(part)):
            _complete(settings, recorded["settings"])


def _complete(written: dict[str, Any], recorded: Mapping[str, Any]) -> None:
    for key, value in recorded.items():
        now = written.setdefault(key, value)
        if isinstance(now, dict) and isinstance(value, Mapping) and now is not value:
            _complete(now, value)


def _put_in_questionnaires(content: Mapping[str, Any], record: SessionRecord) -> None:
    """Use recorded settings for those that named a file that no longer exists."""
    components = record.context["components"]
    for name, written in content.get("questionnaires", {}).items():
        if recorded := components.get(f"questionnaires.{name}"):
            written.update(recorded["settings"])


def differing_parts(record: SessionRecord, study: Study) -> tuple[str, ...]:
    """Return every part that matters and is not what it was, in words."""
    context = record.context
    found = list(_versions(context.get("versions", {})))
    then = parse_yaml(context["machine"], "the machine as it was", recorded=True)
    now = parse_yaml(study.machine_text, f"the machine of {study.path}", recorded=True)
    found += _compared("machine", then, now)
    for part, choice in study.choices.items():
        if part.startswith(MOVING):
            recorded, now = context["components"].get(part), choice.described(study.path.parent)
            found += _compared(part, recorded, now)
    was = parse_yaml(record.protocol, "the protocol", recorded=True)
    found += _compared("assist", was.get("assist"), study.written.get("assist"))
    found += _compared("rate_hz", float(context["rate_hz"]), study.protocol.rate_hz)
    return tuple(found)


def _versions(recorded: Mapping[str, str]) -> Iterator[str]:
    for name, then in recorded.items():
        if name not in IRRELEVANT and (now := _installed(name)) != then:
            yield f"{name}: recorded with {then}, now {now}"


def _installed(name: str) -> str:
    if name == "python":
        return platform.python_version()
    if name == "system":
        return platform.platform()
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _compared(name: str, then: object, now: object) -> Iterator[str]:
    """Yield the differences of nested settings, by dotted path."""
    if isinstance(then, Mapping) and isinstance(now, Mapping):
        for key in dict.fromkeys([*then, *now]):
            yield from _compared(f"{name}.{key}", then.get(key), now.get(key))
    elif isinstance(then, list) and isinstance(now, list) and len(then) == len(now):
        for at, (one, other) in enumerate(zip(then, now, strict=True)):
            key = one.get("name", at) if isinstance(one, Mapping) else at
            yield from _compared(f"{name}.{key}", one, other)
    elif then != now:
        yield f"{name}: recorded {then!r}, now {now!r}"
