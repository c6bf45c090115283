"""Reader of a participant file, for analysis."""

import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from labcrane.errors import OutdatedRecordingWarning, RecordingError
from labcrane.recording.annotations import COLUMNS, mapping_in, read_annotations
from labcrane.recording.journal import GROUPS
from labcrane.recording.participant_file.columns import CHUNK, holds_texts, text_of, texts_of
from labcrane.recording.participant_file.recover import backlog
from labcrane.recording.participant_file.session_group import SYNC_REPORT
from labcrane.recording.participant_file.stream_group import BASES
from labcrane.recording.participant_file.writer import group_name, held, reading
from labcrane.recording.paths import nearby_file
from labcrane.recording.xdf.header import StreamHeader
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import h5py
    import pandas as pd
    import pyarrow as pa

    from labcrane.recording.films.footage import Footage

_SESSION = re.compile(r"ses-([0-9]+)")


@dataclass(frozen=True)
class Stream:
    """Signals that share one time column; read from the file when first asked for.

    Attributes
    ----------
    name
        ``"state"``, or the name of an external stream: ``"EEG"``.
    attrs
        Its attributes in the file; for a corrected stream also the accuracy of its timestamps.
    """

    name: str
    attrs: Mapping[str, Any]
    _path: Path
    _group: str
    _time: str

    @cached_property
    def time(self) -> FloatArray:
        """Seconds on our clock, shape ``(n,)``; the source's own where none was corrected."""
        return self._column(self._time)

    @cached_property
    def time_raw(self) -> FloatArray:
        """Seconds on the clock of the stream's source, shape ``(n,)``."""
        raw = f"{self._time.rpartition('/')[0]}/time_raw"
        return self._column(raw) if "rate_hz" in self.attrs else self.time

    @cached_property
    def time_error(self) -> FloatArray:
        """How far each time may be off at 95 %, in seconds, shape ``(n,)``.

        Zero for the session's own signals, whose clock it is; NaN where it is not known, as in
        files of before it was worked out: ``labcrane resync`` does.
        """
        if "rate_hz" not in self.attrs:
            return np.zeros(len(self.time))
        error = self._beside("time_error")
        return np.full(len(self.time), np.nan) if error is None else error

    @cached_property
    def time_basis(self) -> npt.NDArray[np.str_]:
        """Basis of each time, shape ``(n,)``.

        ``own`` for the session's own clock, ``probes`` of another one, ``arrivals`` where it was
        never probed, ``nothing`` where neither is known, ``unknown`` in files of before.
        """
        if "rate_hz" not in self.attrs:
            return np.full(len(self.time), "own")
        basis = self._beside("time_basis")
        if basis is None:
            return np.full(len(self.time), "unknown" if self.attrs["corrected"] else "nothing")
        return np.asarray(np.array(BASES)[basis.astype(int)])

    @cached_property
    def time_uneven(self) -> FloatArray:
        """The times before dejittering, in seconds, shape ``(n,)``; the same without it."""
        uneven = self._beside("time_uneven") if "rate_hz" in self.attrs else None
        return self.time if uneven is None else uneven

    def column(self, name: str, start: int = 0, stop: int | None = None) -> npt.NDArray[Any]:
        """Return samples ``start`` to ``stop`` of one column; nothing else is read from the file.

        Negative numbers count from the end, as in any slice.

        Parameters
        ----------
        name
            ``"time"``, or a name of :attr:`units`: ``"tip.position.x"``.
        start, stop
            Numbers of samples; all by default.

        Returns
        -------
        numpy.ndarray
            Shape ``(n,)``: numbers, or texts.

        Raises
        ------
        RecordingError
            The stream has no such column.
        """
        return self.columns([name], start, stop)[name]

    def columns(
        self, names: Sequence[str], start: int = 0, stop: int | None = None
    ) -> dict[str, npt.NDArray[Any]]:
        """Return samples ``start`` to ``stop`` of some columns by name, as :meth:`column` does."""
        known = ("time", *self._paths) if set(names) - {"time"} else ("time",)
        if unknown := [name for name in names if name not in known]:
            raise RecordingError(
                f"stream {self.name!r} of {self._path} has no column {unknown[0]!r}; it has "
                + ", ".join(known)
            )
        cut, found = slice(start, stop), {}
        with reading(self._path) as file:
            for name in names:
                if name == "time":
                    found[name] = np.asarray(file[self._time][cut], np.float64)
                else:
                    found[name] = _cut(file[self._paths[name]], cut)
        return found

    def values(
        self, names: Sequence[str], start: int = 0, stop: int | None = None
    ) -> dict[str, npt.NDArray[Any]]:
        """Return samples ``start`` to ``stop`` of channels by name.

        Unlike in :meth:`columns`, ``"time"`` is the channel that a source calls so.
        """
        with reading(self._path) as file:
            return {name: _cut(file[self._paths[name]], slice(start, stop)) for name in names}

    @cached_property
    def numeric(self) -> list[str]:
        """Names of the channels that hold numbers, in their order."""
        with reading(self._path) as file:
            return [name for name, path in self._paths.items() if file[path].dtype.kind in "fiu"]

    def batches(
        self,
        columns: Sequence[str] | None = None,
        start: int = 0,
        stop: int | None = None,
        rows: int = CHUNK,
    ) -> "Iterator[pa.RecordBatch]":
        """Yield time and columns as Arrow's record batches, one in memory at a time.

        Parameters
        ----------
        columns
            Names of :attr:`units`; all by default.
        start, stop
            Numbers of samples, from 0; all by default.
        rows
            How many samples a batch holds at most.

        Raises
        ------
        RecordingError
            The stream has no such column.
        """
        import pyarrow as pa  # noqa: PLC0415 - loads for a quarter of a second

        wanted = list(self._paths) if columns is None else list(columns)
        if unknown := [name for name in wanted if name not in self._paths]:
            raise RecordingError(
                f"stream {self.name!r} of {self._path} has no column {unknown[0]!r}; it has "
                + ", ".join(self._paths)
            )
        first, last, _ = slice(start, stop).indices(len(self))
        # Reading whole chunks needs none twice, and a cache would grow with the length.
        with reading(self._path, cached=rows < CHUNK) as file:
            chosen = {"time": file[self._time]}
            chosen |= {name: file[self._paths[name]] for name in wanted}
            for at in range(first, max(last, first + 1), rows):
                cut = slice(at, min(at + rows, last))
                arrays = [pa.array(_cut(each, cut)) for each in chosen.values()]
                yield pa.record_batch(arrays, names=list(chosen))

    def table(
        self, columns: Sequence[str] | None = None, start: int = 0, stop: int | None = None
    ) -> "pa.Table":
        """Return :meth:`batches` as one Arrow table."""
        import pyarrow as pa  # noqa: PLC0415

        return pa.Table.from_batches(self.batches(columns, start, stop))

    def __len__(self) -> int:
        with reading(self._path) as file:
            return len(file[self._time])

    def __bool__(self) -> bool:
        return True

    @cached_property
    def data(self) -> "pd.DataFrame":
        """One column per number, named by its dotted path; one row per time."""
        import pandas as pd  # noqa: PLC0415 - loads for a second

        with reading(self._path) as file:
            return pd.DataFrame(
                {name: _values(dataset) for name, dataset in _columns(file[self._group])}
            )

    def rows(self, first: int, last: int) -> dict[str, FloatArray]:
        """Return rows ``first`` to ``last`` of every column of numbers, by column."""
        with reading(self._path) as file:
            return {
                name: np.asarray(dataset[first:last], np.float64)
                for name, dataset in _columns(file[self._group])
                if dataset.dtype.kind in "fiub"
            }

    @cached_property
    def units(self) -> dict[str, str]:
        """The unit of each column."""
        with reading(self._path) as file:
            columns = _columns(file[self._group])
            return {name: str(dataset.attrs.get("unit", "")) for name, dataset in columns}

    @cached_property
    def _paths(self) -> dict[str, str]:
        """Where each column is in the file."""
        with reading(self._path) as file:
            return {name: str(dataset.name) for name, dataset in _columns(file[self._group])}

    @cached_property
    def header(self) -> StreamHeader | None:
        """Header of the source, with its channels; None for the session's own signals."""
        if "rate_hz" not in self.attrs:
            return None
        with reading(self._path) as file:
            return StreamHeader.from_xml(text_of(file[self._group].parent["header"]))

    def _beside(self, name: str) -> FloatArray | None:
        """Return a column next to the corrected time; None where there is none."""
        path = f"{self._time.rpartition('/')[0]}/{name}"
        with reading(self._path) as file:
            return np.asarray(file[path][:], np.float64) if path in file else None

    def _column(self, path: str) -> FloatArray:
        with reading(self._path) as file:
            return np.asarray(file[path][:], np.float64)


@dataclass(frozen=True)
class SessionRecord:
    """One session of a participant.

    Attributes
    ----------
    attrs
        When, how and with what it was recorded.
    """

    attrs: Mapping[str, Any]
    _path: Path
    _group: str

    @cached_property
    def streams(self) -> dict[str, Stream]:
        """Frames as loop, input, command, state and task; external streams by their names."""
        with reading(self._path) as file:
            group = file[self._group]
            own = {
                name: Stream(name, {}, self._path, f"{self._group}/{name}", f"{self._group}/time")
                for name in GROUPS
                if name in group
            }
            others = group.get("streams", {})
            return own | {name: self._foreign(name, others[name]) for name in others}

    def _foreign(self, name: str, group: "h5py.Group") -> Stream:
        time = "time" if "time" in group else "time_raw"
        path = f"{self._group}/streams/{name}"
        attrs = {**_attributes(group), **_attributes(group[time]), "corrected": time == "time"}
        return Stream(name, attrs, self._path, f"{path}/data", f"{path}/{time}")

    @cached_property
    def signal_faults(self) -> "pd.DataFrame":
        """One row per fault of a signal: stream, channel, kind, message, start and end in s."""
        return self._table("signal_faults")

    @cached_property
    def trial_signal_faults(self) -> "pd.DataFrame":
        """One row per trial and fault that touches it: trial, attempt, stream, channel, seconds."""
        return self._table("trial_signal_faults")

    def _table(self, name: str) -> "pd.DataFrame":
        """Return a group of columns of one length; empty where the session has none."""
        import pandas as pd  # noqa: PLC0415

        with reading(self._path) as file:
            group = file[self._group].get(name, {})
            return pd.DataFrame({column: _values(group[column]) for column in group})

    def _table_in_order(self, name: str) -> "pd.DataFrame":
        """Return a group of columns by their names, in the order of their recording."""
        import pandas as pd  # noqa: PLC0415

        with reading(self._path) as file:
            columns = _columns(file[f"{self._group}/{name}"])
            return pd.DataFrame({label: _values(dataset) for label, dataset in columns})

    @cached_property
    def events(self) -> "pd.DataFrame":
        """One row per event: time, tick, part, trial, name and data, a dict."""
        import pandas as pd  # noqa: PLC0415

        with reading(self._path) as file:
            group = file[f"{self._group}/events"]
            columns = ("time", "tick", "part", "trial", "name", "data")
            table = {name: _values(group[name]) for name in columns}
            table["data"] = [mapping_in(text) for text in table["data"]]
            return pd.DataFrame(table)

    @property
    def annotations(self) -> "pd.DataFrame":
        """One row per annotation that people added afterwards: time, until, text, written, coder.

        Times are in seconds on the session's clock. Each access reads them again, from the file
        next to the participant file (:mod:`labcrane.recording.annotations`): a participant file
        that was copied without it has none.
        """
        import pandas as pd  # noqa: PLC0415

        number = int(self._group.removeprefix("ses-"))
        marks = read_annotations(self._path.parent, number)
        return pd.DataFrame(
            {
                name: pd.Series(
                    [getattr(mark, name) for mark in marks],
                    dtype=float if name in {"time", "until"} else object,
                )
                for name in COLUMNS
            }
        )

    @cached_property
    def films(self) -> "dict[str, Footage]":
        """Cameras, microphones and screens by name, with files next to the participant file."""
        from labcrane.recording.films.footage import footage  # noqa: PLC0415 - it imports this

        return footage(self.streams, self._path.parent, int(self._group.removeprefix("ses-")))

    @cached_property
    def trials(self) -> "pd.DataFrame":
        """One row per counted trial: its condition and its results."""
        return self._table_in_order("trials")

    @cached_property
    def questionnaires(self) -> "pd.DataFrame":
        """One row per answer and per score: questionnaire, kind, item, text, value, time, ...

        ``kind`` is ``answer`` or ``score``. A declined answer has neither text nor value.
        """
        return self._table_in_order("questionnaires")

    @cached_property
    def protocol(self) -> str:
        """The text of the protocol that was run."""
        return self._text("protocol")

    @cached_property
    def context(self) -> dict[str, Any]:
        """Everything that was known when the session started."""
        return self._json("context")

    @cached_property
    def sync_report(self) -> dict[str, Any]:
        """Accuracy of the timestamps, with remedies where it fails; empty if unknown."""
        with reading(self._path) as file:
            if SYNC_REPORT not in file[self._group]:
                return {}
        return self._json(SYNC_REPORT)

    def _json(self, name: str) -> dict[str, Any]:
        with reading(self._path) as file:
            return mapping_in(text_of(file[f"{self._group}/{name}"]))

    def _text(self, name: str) -> str:
        with reading(self._path) as file:
            return text_of(file[f"{self._group}/{name}"])


class Recording:
    """A participant file; it is open only while something is read from it.

    Attributes
    ----------
    path
        Where it is.
    participant
        Pseudonym.
    attrs
        Attributes of the file.
    sessions
        Numbers of the sessions in it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with reading(path) as file:
            self.attrs: Mapping[str, Any] = _attributes(file)
            found = (_SESSION.fullmatch(name) for name in file)
            self.sessions: list[int] = sorted(int(match[1]) for match in found if match)
            if not isinstance(named := self.attrs["participant"], str):
                raise RecordingError(
                    f"{path} is not as labcrane writes it: its participant is {named!r}, no text"
                )
            self.participant: str = named

    def session(self, number: int) -> SessionRecord:
        """Return a session by its number."""
        if number not in self.sessions:
            known = ", ".join(map(str, self.sessions)) or "none"
            raise RecordingError(f"{self.path} has no session {number}; it has {known}")
        name = group_name(number)
        with reading(self.path) as file:
            return SessionRecord(_attributes(file[name]), self.path, name)

    def __iter__(self) -> Iterator[SessionRecord]:
        return map(self.session, self.sessions)


def open_recording(path: Path | str) -> Recording:
    """Open a participant file.

    Warns with :class:`~labcrane.errors.OutdatedRecordingWarning` where the journals beside it
    hold more.

    Raises
    ------
    RecordingError
        There is none at ``path``, or it cannot be read.
    """
    recording = existing_recording(Path(path))
    for said in backlog(recording.path).values():
        warnings.warn(said, OutdatedRecordingWarning, stacklevel=2)
    return recording


def existing_recording(path: Path) -> Recording:
    """Open a participant file, whatever the journals beside it hold.

    Raises
    ------
    RecordingError
        There is none at ``path``, or it cannot be read.
    """
    if not path.is_file():
        if found := nearby_file(path):
            raise RecordingError(f"there is no participant file {path}; did you mean {found}?")
        raise RecordingError(
            f"there is no participant file {path}; if there are journals, run labcrane recover "
            f"{path.parent} to build it"
        )
    return Recording(path)


@contextmanager
def session_in(group: "h5py.Group") -> Iterator[SessionRecord]:
    """Give the session of a group of a participant file that is open, perhaps for writing."""
    path = Path(group.file.filename)
    with held(path, group.file):
        yield SessionRecord(_attributes(group), path, group.name.removeprefix("/"))


def _attributes(node: "h5py.HLObject") -> dict[str, Any]:
    """Return attributes as numbers and texts; what others added is returned as h5py reads it."""
    return {
        name: float(value) if isinstance(value, np.number | np.bool_) else value
        for name, value in node.attrs.items()
    }


def _columns(group: "h5py.Group") -> list[tuple[str, "h5py.Dataset"]]:
    """Return a group's columns by their names, in the order in which they were recorded."""
    import h5py  # noqa: PLC0415

    found: list[h5py.Dataset] = []
    group.visititems(lambda _, node: found.append(node) if isinstance(node, h5py.Dataset) else None)
    columns: dict[str, h5py.Dataset] = {}
    for dataset in sorted(found, key=lambda dataset: dataset.attrs["position"]):
        path = dataset.name.removeprefix(f"{group.name}/").replace("/", ".")
        name = str(dataset.attrs.get("name", path))
        columns[path if name in columns else name] = dataset  # labels of others may not differ
    return list(columns.items())


def _cut(dataset: "h5py.Dataset", cut: slice) -> npt.NDArray[Any]:
    return np.asarray(dataset.asstr("utf-8")[cut] if holds_texts(dataset) else dataset[cut])


def _values(dataset: "h5py.Dataset") -> Any:
    return texts_of(dataset) if holds_texts(dataset) else dataset[:]
