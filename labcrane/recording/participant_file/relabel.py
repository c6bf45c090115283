"""Relabelling of a recording: written once more, under another pseudonym.

Everything else is as it was: the new file is read again and compared before it is used.
"""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from labcrane.errors import RecordingError
from labcrane.recording.journal import START
from labcrane.recording.participant_file.columns import (
    holds_texts,
    text_of,
    texts_of,
    write_text,
    write_texts,
)
from labcrane.recording.participant_file.verification import bring_to_disk, unlike
from labcrane.recording.participant_file.writer import put_seal
from labcrane.recording.xdf.checksums import CHECK_NAME
from labcrane.recording.xdf.header import StreamHeader
from labcrane.recording.xdf.reader import XdfFile, XdfStream, read_xdf
from labcrane.recording.xdf.writer import XdfWriter

if TYPE_CHECKING:
    import h5py

SAMPLES = 100_000
"""Numbers are written in chunks of so many samples."""

FORMERLY = "formerly"
"""Under which name the old pseudonym stays in the record."""

Rename = Callable[[str], str]


def renaming(old: str, new: str) -> Rename:
    """Return a function that replaces ``old`` by ``new`` where it is a word of its own."""
    pattern = re.compile(rf"(?<![A-Za-z0-9]){re.escape(old)}(?![A-Za-z0-9])")
    return lambda text: pattern.sub(new, text)


def relabel_journal(source: Path, target: Path, old: str, new: str) -> None:
    """Write a journal again as ``target``, which is replaced.

    Raises
    ------
    RecordingError
        The journal is damaged, or the new one does not read as the old one does.
    """
    rename = renaming(old, new)
    file = read_xdf(source)
    if file.damaged or file.unchecked or file.nameless:
        raise RecordingError(
            f"{source} is damaged and cannot be relabelled without losing what is left; keep it, "
            "and note the right number in the study's log"
        )
    target.unlink(missing_ok=True)
    with XdfWriter(target) as writer:
        for stream in _own(file):
            _write_stream(writer, stream, rename, old)
    bring_to_disk(target)
    for before, after in zip(_own(file), _own(read_xdf(target)), strict=True):
        same = (
            before.stamps.tobytes() == after.stamps.tobytes()
            and before.data.tobytes() == after.data.tobytes()
            and before.offsets.tobytes() == after.offsets.tobytes()
            and _renamed_header(before.header, rename) == after.header
            and [
                tuple(_with_record(rename(text), old) for text in row) for row in before.texts
            ] == [tuple(row) for row in after.texts]
        )  # fmt: skip
        if not same:
            raise RecordingError(f"{target} does not read as {source} does; check the disk")


def _own(file: XdfFile) -> list[XdfStream]:
    """Return the streams without the checks, which every writer computes itself."""
    return [stream for stream in file.streams if stream.header.name != CHECK_NAME]


def _write_stream(writer: XdfWriter, stream: XdfStream, rename: Rename, old: str) -> None:
    header = _renamed_header(stream.header, rename)
    number = writer.add_stream(header)
    for start in range(0, len(stream.stamps), SAMPLES):
        part = slice(start, start + SAMPLES)
        if header.format == "string":
            rows = [
                tuple(_with_record(rename(text), old) for text in row) for row in stream.texts[part]
            ]
            writer.write_texts(number, stream.stamps[part].tolist(), rows)
        else:
            writer.write_samples(number, stream.stamps[part], stream.data[part])
    for when, offset in stream.offsets.tolist():
        writer.write_offset(number, when, offset)


def _renamed_header(header: StreamHeader, rename: Rename) -> StreamHeader:
    if header.text is not None:
        return StreamHeader.from_xml(rename(header.text))
    return replace(header, source_id=rename(header.source_id))


def _with_record(text: str, old: str) -> str:
    """Add the old pseudonym to the session's context, if ``text`` is that."""
    if f'"{START}"' not in text:
        return text
    content = json.loads(text)
    if content.get("event") != START:
        return text
    return json.dumps(_recorded(content, old), ensure_ascii=False)


def _recorded(context: dict[str, Any], old: str) -> dict[str, Any]:
    before = [context[FORMERLY]] if context.get(FORMERLY) else []
    return {**context, FORMERLY: ", ".join([*before, old])}


def relabel_participant_file(
    source: Path, target: Path, old: str, new: str, sizes: dict[str, int]
) -> None:
    """Write a participant file again as ``target``, which is replaced.

    Parameters
    ----------
    sizes
        Bytes of the relabelled journals by name: the file says what it was made of.
    """
    import h5py  # noqa: PLC0415 - loads for a second

    target.unlink(missing_ok=True)
    try:
        with h5py.File(source, "r") as before, h5py.File(target, "w-") as after:
            _copy_group(before, after, renaming(old, new))
            after.attrs[FORMERLY] = _formerly(before, old)
            for session in (node for name, node in after.items() if name.startswith("ses-")):
                session.attrs[FORMERLY] = _formerly(session, old)
                context = _recorded(json.loads(text_of(session["context"])), old)
                del session["context"]
                write_text(session, "context", json.dumps(context, ensure_ascii=False))
                journals = session["journals"]
                for number, name in enumerate(texts_of(journals["name"])):
                    journals["size"][number] = sizes.get(name, journals["size"][number])
        put_seal(target)
        bring_to_disk(target)
        with h5py.File(source, "r") as before, h5py.File(target, "r") as after:
            lost = next(unlike(before, after, _made_anew, renaming(old, new)), None)
    except (OSError, KeyError, ValueError) as error:
        raise RecordingError(f"cannot relabel {source}: {error}; it is as it was") from error
    if lost is not None:
        raise RecordingError(
            f"{lost} of {target} is not what {source} holds, which is as it was; check the disk"
        )


_ANEW = re.compile(rf"ses-[^/]+/(context|journals/size)(@.*)?|(ses-[^/]+)?@{FORMERLY}")


def _made_anew(name: str) -> bool:
    """Whether a node, or an attribute, says something else after a relabelling."""
    return _ANEW.fullmatch(name) is not None


def _formerly(node: "h5py.HLObject", old: str) -> str:
    return ", ".join([*([node.attrs[FORMERLY]] if FORMERLY in node.attrs else []), old])


def _copy_group(before: "h5py.Group", after: "h5py.Group", rename: Rename) -> None:
    import h5py  # noqa: PLC0415

    _copy_attributes(before, after, rename)
    for name, node in before.items():
        if isinstance(node, h5py.Group):
            _copy_group(node, after.create_group(name), rename)
            continue
        if not holds_texts(node):
            before.copy(name, after)
        elif node.shape == ():
            write_text(after, name, rename(text_of(node)))
        else:
            write_texts(after, name, [rename(text) for text in texts_of(node)])
        _copy_attributes(node, after[name], rename)


def _copy_attributes(before: "h5py.HLObject", after: "h5py.HLObject", rename: Rename) -> None:
    for name, value in before.attrs.items():
        after.attrs[name] = rename(value) if isinstance(value, str) else value
