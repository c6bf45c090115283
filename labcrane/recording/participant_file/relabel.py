"""Relabelling of a recording: written once more, under another pseudonym.

So is the recording of those who are yoked to a participant who is relabelled or erased: with the
other's new name, or without the other's values. Everything else is as it was: the new file is read
again and compared before it is used.
"""

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.core.by_estimate import OF_ESTIMATE
from labcrane.errors import RecordingError
from labcrane.recording.journal import FRAMES, START
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
    import numpy.typing as npt

SAMPLES = 100_000
"""Numbers are written in chunks of so many samples."""

FORMERLY = "formerly"
"""Under which name the old pseudonym stays in the record."""

ERASED = "erased"
"""Source of a yoked session whose source was erased."""

Rename = Callable[[str], str]


def renaming(old: str, new: str) -> Rename:
    """Return a function that replaces ``old`` by ``new`` where it is a word of its own."""
    pattern = re.compile(rf"(?<![A-Za-z0-9]){re.escape(old)}(?![A-Za-z0-9])")
    return lambda text: pattern.sub(new, text)


class Rewriting:
    """What changes in a recording that is written once more.

    Parameters
    ----------
    old, new
        Names.
    own
        Whether the recording is that of ``old``, whose name then stays in it.
    session, values
        Of which session, as its group in the file, which values of estimates are taken out, as
        ``load.ratio``.
    """

    def __init__(
        self,
        old: str,
        new: str,
        *,
        own: bool = True,
        session: str = "",
        values: Sequence[str] = (),
    ) -> None:
        self.rename = renaming(old, new)
        self.formerly = old if own else ""
        self.empties = bool(values)
        times = {f"{value.partition('.')[0]}.time" for value in values}
        self._columns = {OF_ESTIMATE + each for each in (*values, *times)}
        self._results = {value.replace(".", "_") for value in values}
        self._nodes = {
            *(f"{session}/input/{column.replace('.', '/')}" for column in self._columns),
            *(f"{session}/trials/{result}" for result in self._results),
        }
        self._events = f"{session}/events/data"

    def event(self, text: str) -> str:
        """Return the text of an event as it is written now."""
        text = self.rename(text)
        if self.formerly:
            return _with_record(text, self.formerly)
        if not self.empties:
            return text
        content = json.loads(text)
        gone = dict.fromkeys(content.keys() & self._results)
        return json.dumps({**content, **gone}, ensure_ascii=False) if gone else text

    def numbers(self, header: StreamHeader, data: "npt.NDArray[Any]") -> "npt.NDArray[Any]":
        """Return the numbers of a journal's stream as they are written now."""
        if not self.empties or header.name != FRAMES:
            return data
        gone = [label in self._columns for label in header.labels]
        return np.where(gone, np.nan, data)

    def empties_node(self, name: str) -> bool:
        """Whether a column of the participant file is emptied."""
        return name.removeprefix("/") in self._nodes

    def holds_results(self, name: str) -> bool:
        """Whether a node of the participant file has events whose results are taken out."""
        return self.empties and name.removeprefix("/") == self._events


def relabel_journal(source: Path, target: Path, change: Rewriting) -> None:
    """Write a journal again as ``target``, which is replaced.

    Raises
    ------
    RecordingError
        The journal is damaged, or the new one does not read as the old one does. One from which
        values are taken out may be damaged: what can be read is kept.
    """
    file = read_xdf(source)
    if not change.empties and (file.damaged or file.unchecked or file.nameless):
        raise RecordingError(
            f"{source} is damaged and cannot be relabelled without losing what is left; keep it, "
            "and note the right number in the study's log"
        )
    target.unlink(missing_ok=True)
    with XdfWriter(target) as writer:
        for stream in _own(file):
            _write_stream(writer, stream, change)
    bring_to_disk(target)
    for before, after in zip(_own(file), _own(read_xdf(target)), strict=True):
        same = (
            before.stamps.tobytes() == after.stamps.tobytes()
            and change.numbers(before.header, before.data).tobytes() == after.data.tobytes()
            and before.offsets.tobytes() == after.offsets.tobytes()
            and _renamed_header(before.header, change.rename) == after.header
            and [tuple(map(change.event, row)) for row in before.texts]
            == [tuple(row) for row in after.texts]
        )  # fmt: skip
        if not same:
            raise RecordingError(f"{target} does not read as {source} does; check the disk")


def _own(file: XdfFile) -> list[XdfStream]:
    """Return the streams without the checks, which every writer computes itself."""
    return [stream for stream in file.streams if stream.header.name != CHECK_NAME]


def _write_stream(writer: XdfWriter, stream: XdfStream, change: Rewriting) -> None:
    header = _renamed_header(stream.header, change.rename)
    number = writer.add_stream(header)
    for start in range(0, len(stream.stamps), SAMPLES):
        part = slice(start, start + SAMPLES)
        if header.format == "string":
            rows = [tuple(map(change.event, row)) for row in stream.texts[part]]
            writer.write_texts(number, stream.stamps[part].tolist(), rows)
        else:
            numbers = change.numbers(header, stream.data[part])
            writer.write_samples(number, stream.stamps[part], numbers)
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
    source: Path, target: Path, change: Rewriting, sizes: dict[str, int]
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
            _copy_group(before, after, change)
            if change.formerly:
                after.attrs[FORMERLY] = _formerly(before, change.formerly)
            for session in (node for name, node in after.items() if name.startswith("ses-")):
                if change.formerly:
                    _keep_name(session, change.formerly)
                journals = session["journals"]
                for number, name in enumerate(texts_of(journals["name"])):
                    journals["size"][number] = sizes.get(name, journals["size"][number])
        put_seal(target)
        bring_to_disk(target)
        with h5py.File(source, "r") as before, h5py.File(target, "r") as after:
            lost = next(unlike(before, after, _changing(change), change.rename), None)
    except (OSError, KeyError, ValueError) as error:
        raise RecordingError(f"cannot relabel {source}: {error}; it is as it was") from error
    if lost is not None:
        raise RecordingError(
            f"{lost} of {target} is not what {source} holds, which is as it was; check the disk"
        )


_ANEW = re.compile(rf"ses-[^/]+/(context|journals/size)(@.*)?|(ses-[^/]+)?@{FORMERLY}")


def _changing(change: Rewriting) -> Callable[[str], bool]:
    """Return whether a node, or an attribute, has another content after a relabelling."""

    def changes(name: str) -> bool:
        own = _ANEW.fullmatch(name) is not None
        return own or change.empties_node(name) or change.holds_results(name)

    return changes


def _keep_name(session: "h5py.Group", old: str) -> None:
    session.attrs[FORMERLY] = _formerly(session, old)
    context = _recorded(json.loads(text_of(session["context"])), old)
    del session["context"]
    write_text(session, "context", json.dumps(context, ensure_ascii=False))


def _formerly(node: "h5py.HLObject", old: str) -> str:
    return ", ".join([*([node.attrs[FORMERLY]] if FORMERLY in node.attrs else []), old])


def _copy_group(before: "h5py.Group", after: "h5py.Group", change: Rewriting) -> None:
    import h5py  # noqa: PLC0415

    rename = change.rename
    _copy_attributes(before, after, rename)
    for name, node in before.items():
        if isinstance(node, h5py.Group):
            _copy_group(node, after.create_group(name), change)
            continue
        if change.empties_node(node.name):
            # Never copied: what is written over in a file may stay in its free space.
            after.create_dataset_like(name, node, data=np.full(node.shape, np.nan))
        elif change.holds_results(node.name):
            write_texts(after, name, [change.event(text) for text in texts_of(node)])
        elif not holds_texts(node):
            before.copy(name, after)
        elif node.shape == ():
            write_text(after, name, rename(text_of(node)))
        else:
            write_texts(after, name, [rename(text) for text in texts_of(node)])
        _copy_attributes(node, after[name], rename)


def _copy_attributes(before: "h5py.HLObject", after: "h5py.HLObject", rename: Rename) -> None:
    for name, value in before.attrs.items():
        after.attrs[name] = rename(value) if isinstance(value, str) else value
