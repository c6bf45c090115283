"""The parts of a recorded session: put together again, and compared with what is installed."""

import json
import platform
from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from labcrane.files.yaml import parse_yaml, read_yaml
from labcrane.protocol.referenced_files import write_files
from labcrane.protocol.study import Study
from labcrane.recording.participant_file.reader import SessionRecord

IRRELEVANT = ("pygame", "pylsl")
"""Of the recorded versions, those that bring input in or send frames out, and move nothing."""

MOVING = ("scheme", "dynamics", "tasks.")
"""The parts that a replay runs again."""


def restore(
    record: SessionRecord, folder: Path, protocol: Path | None, machine: Path | None
) -> Path:
    """Write the recorded protocol and what it refers to into ``folder``; return its path.

    A given ``protocol`` stays where it is, unless a ``machine`` is put into it.
    """
    if protocol is not None and machine is None:
        return protocol
    content = (
        read_yaml(protocol)
        if protocol
        else parse_yaml(record.protocol, "the protocol", recorded=True)
    )
    described = machine.read_text(encoding="utf-8") if machine else record.context["machine"]
    (folder / "machine.yaml").write_text(described, encoding="utf-8")
    content["machine"] = "machine.yaml"
    _write_instructions(content, record, folder)
    if protocol is None:
        _put_in_questionnaires(content, record)
        write_files(record.context.get("files", {}), folder)
    path = folder / "protocol.yaml"
    path.write_text(json.dumps(content), encoding="utf-8")  # JSON is YAML
    return path


def _write_instructions(content: Mapping[str, Any], record: SessionRecord, folder: Path) -> None:
    """Write the texts that were shown; those that were not change no state, and are left empty."""
    events = record.events
    shown = [
        data.get("text", "") for data in events.loc[events["name"] == "instructions.shown", "data"]
    ]
    number = int(record.attrs["session"])
    for at, session in enumerate(content["sessions"], start=1):
        for step in session["steps"]:
            if isinstance(step, dict) and "instructions" in step:
                text = shown.pop(0) if at == number and shown else ""
                path = folder / str(step["instructions"])
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text, encoding="utf-8")


def _put_in_questionnaires(content: Mapping[str, Any], record: SessionRecord) -> None:
    """Let recorded settings stand for those that named a file, which is not there any more."""
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
    """Yield what differs in nested settings, by dotted path."""
    if isinstance(then, Mapping) and isinstance(now, Mapping):
        for key in dict.fromkeys([*then, *now]):
            yield from _compared(f"{name}.{key}", then.get(key), now.get(key))
    elif isinstance(then, list) and isinstance(now, list) and len(then) == len(now):
        for at, (one, other) in enumerate(zip(then, now, strict=True)):
            key = one.get("name", at) if isinstance(one, Mapping) else at
            yield from _compared(f"{name}.{key}", one, other)
    elif then != now:
        yield f"{name}: recorded {then!r}, now {now!r}"
