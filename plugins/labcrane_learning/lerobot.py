"""LeRobot's data sets, version 3.0: episodes in Parquet, and their description in JSON.

The layout is that of https://huggingface.co/docs/lerobot/lerobot-dataset-v3.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane import RecordingError
from labcrane.analysis import Exporter, Participant
from labcrane_learning.episodes import Episode, EpisodeLayout, episodes_of, layout_of
from labcrane_learning.pictures import EpisodePictures, Histogram, unpacked
from labcrane_learning.settings import EpisodeSettings

if TYPE_CHECKING:
    import pyarrow as pa

FORMAT = "v3.0"
FILES_PER_CHUNK = 1000
DATA_FILE_MB = 100
VIDEO_FILE_MB = 200
PLACE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
OBSERVATION, ACTION, IMAGES = "observation.state", "action", "observation.images."
COUNTERS = ("timestamp", "frame_index", "episode_index", "index", "task_index")
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}


class LeRobot(Exporter):
    """One data file per participant, and the tables that LeRobot looks episodes up in.

    ``observation.state`` is the machine's state and the task's signals, ``action`` the axes of the
    operator's controls in the next tick; names stand in ``meta/info.json``, units beside them.
    ``observation.images.CAMERA`` are pictures of the cameras that are asked for, without loss.
    """

    def __init__(self, settings: EpisodeSettings) -> None:
        self._settings = settings

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        book = _Book(self._settings)
        for number, participant in enumerate(participants):
            book.begin(participant)
            _write_data(folder, number, book, participant)
        book.write(folder)


@dataclass
class _Book:
    """Everything that is known of the data set when its last episode is written."""

    settings: EpisodeSettings
    layout: EpisodeLayout | None = None
    rate_hz: float = 0.0
    cameras: tuple[str, ...] = ()
    machine: str = ""
    frames: int = 0
    tasks: dict[str, int] = field(default_factory=dict)
    episodes: list[dict[str, Any]] = field(default_factory=list)

    def begin(self, participant: Participant) -> None:
        for _, session in participant.sessions():
            rate_hz = float(session.attrs["rate_hz"]) / self.settings.every
            if self.layout is None:
                self.layout, self.rate_hz = layout_of(session), rate_hz
                self.machine = str(participant.context.get("machine_name", "")) or "crane"
            if rate_hz != self.rate_hz or rate_hz != int(rate_hz):
                raise RecordingError(
                    f"{participant.name} has {rate_hz:g} rows a second; a data set of LeRobot has "
                    f"one whole number of frames a second for all, here {self.rate_hz:g}; set "
                    "every= to the number of ticks from one frame to the next"
                )

    def add(
        self, episode: Episode, file: tuple[int, int], seen: "Mapping[str, Histogram]"
    ) -> "dict[str, np.ndarray[Any, Any]]":
        """Add an episode and the statistics of its pictures; return its columns of numbers."""
        count, number = len(episode.action), len(self.episodes)
        task = self.tasks.setdefault(episode.task, len(self.tasks))
        columns: dict[str, np.ndarray[Any, Any]] = {
            OBSERVATION: episode.observation,
            ACTION: episode.action,
            "next.success": np.r_[np.zeros(count - 1, bool), episode.success],
            "timestamp": (np.arange(count) / episode.rate_hz).astype(np.float32),
            "frame_index": np.arange(count),
            "episode_index": np.full(count, number),
            "index": self.frames + np.arange(count),
            "task_index": np.full(count, task),
        }
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": [episode.task],
            "length": count,
            "data/chunk_index": file[0],
            "data/file_index": file[1],
            "dataset_from_index": self.frames,
            "dataset_to_index": self.frames + count,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
            "participant": episode.participant,
            "session": episode.session,
            "trial": episode.trial,
            "attempt": episode.attempt,
            "success": episode.success,
            "presentation_failed": episode.presentation_failed,
            "operator_skill": episode.skill,
        }
        for name, values in columns.items():
            for what, value in _statistics(values).items():
                row[f"stats/{name}/{what}"] = value
        for name, histogram in seen.items():
            for what, value in histogram.statistics(QUANTILES).items():
                row[f"stats/{IMAGES}{name}/{what}"] = value
        self.cameras = tuple(seen)
        self.episodes.append(row)
        self.frames += count
        return columns

    def write(self, folder: Path) -> None:
        import pyarrow as pa
        from pyarrow import parquet

        if self.layout is None or not self.episodes:
            raise RecordingError("no recorded trial can be an episode")
        meta = folder / "meta"
        (meta / "episodes" / "chunk-000").mkdir(parents=True)
        parquet.write_table(
            pa.Table.from_pylist(self.episodes),
            meta / "episodes" / "chunk-000" / "file-000.parquet",
        )
        _write_tasks(self.tasks, meta / "tasks.parquet")
        _write_json(meta / "stats.json", _together(self.episodes))
        _write_json(meta / "info.json", self._info(self.layout))

    def _info(self, layout: EpisodeLayout) -> dict[str, Any]:
        features: dict[str, Any] = {
            key: {
                "dtype": "float32",
                "shape": [len(names)],
                "names": list(names),
                "units": [layout.units[name] for name in names],
            }
            for key, names in ((OBSERVATION, layout.observation), (ACTION, layout.action))
        }
        width, height = self.settings.size
        for name in self.cameras:
            features[f"{IMAGES}{name}"] = {
                "dtype": "image",
                "shape": [height, width, 3],
                "names": ["height", "width", "channels"],
            }
        features["next.success"] = {"dtype": "bool", "shape": [1], "names": None}
        for name in COUNTERS:
            dtype = "float32" if name == "timestamp" else "int64"
            features[name] = {"dtype": dtype, "shape": [1], "names": None}
        return {
            "codebase_version": FORMAT,
            "robot_type": self.machine,
            "total_episodes": len(self.episodes),
            "total_frames": self.frames,
            "total_tasks": len(self.tasks),
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": DATA_FILE_MB,
            "video_files_size_in_mb": VIDEO_FILE_MB,
            "fps": int(self.rate_hz),
            "splits": {"train": f"0:{len(self.episodes)}"},
            "data_path": f"data/{PLACE}.parquet",
            "video_path": None,
            "features": features,
        }


def _write_data(folder: Path, number: int, book: _Book, participant: Participant) -> None:
    """Write a participant's episodes, one in memory at a time."""
    from pyarrow import parquet

    chunk, file = divmod(number, FILES_PER_CHUNK)
    path = folder / "data" / f"{PLACE.format(chunk_index=chunk, file_index=file)}.parquet"
    path.parent.mkdir(parents=True, exist_ok=True)
    writer = None
    if book.layout is None:
        raise AssertionError("a participant that counts has a session")
    settings = book.settings
    with EpisodePictures(participant, settings) as pictures:
        for episode in episodes_of(participant, book.layout, settings.task, settings.every):
            packed, seen = _packed(pictures.of(episode))
            table = _table(book.add(episode, (chunk, file), seen), packed)
            if writer is None:
                writer = parquet.ParquetWriter(path, table.schema)
            writer.write_table(table)
    if writer is not None:
        writer.close()


def _packed(
    pictures: "Iterator[dict[str, bytes]]",
) -> "tuple[dict[str, list[bytes]], dict[str, Histogram]]":
    """Return an episode's pictures by camera, and their statistics."""
    packed: dict[str, list[bytes]] = {}
    seen: dict[str, Histogram] = {}
    for each in pictures:
        for name, picture in each.items():
            packed.setdefault(name, []).append(picture)
            seen.setdefault(name, Histogram()).add(unpacked(picture))
    return packed, seen


def _table(
    columns: "dict[str, np.ndarray[Any, Any]]", pictures: "Mapping[str, list[bytes]]"
) -> "pa.Table":
    import pyarrow as pa

    arrays = {
        name: pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), values.shape[1])
        if values.ndim > 1
        else pa.array(values)
        for name, values in columns.items()
    }
    form = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
    for name, files in pictures.items():
        rows = [{"bytes": each, "path": None} for each in files]
        arrays[f"{IMAGES}{name}"] = pa.array(rows, form)
    return pa.table(arrays)


def _statistics(values: "np.ndarray[Any, Any]") -> dict[str, list[float] | list[int]]:
    """Return LeRobot's statistics of a column: one number for each of its elements."""
    flat = values.reshape(len(values), -1).astype(np.float64)
    found: dict[str, list[float] | list[int]] = {
        "min": flat.min(axis=0).tolist(),
        "max": flat.max(axis=0).tolist(),
        "mean": flat.mean(axis=0).tolist(),
        "std": flat.std(axis=0).tolist(),
        "count": [len(flat)],
    }
    for name, at in QUANTILES.items():
        found[name] = np.quantile(flat, at, axis=0).tolist()
    return found


def _together(episodes: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the statistics of all episodes of those of each, as LeRobot puts them together.

    Means and deviations are exact; quantiles are means of the episodes' own, weighted by length.
    """
    names = {key.split("/")[1] for key in episodes[0] if key.startswith("stats/")}
    found: dict[str, dict[str, Any]] = {}
    for name in sorted(names):

        def of(what: str, name: str = name) -> "np.ndarray[Any, Any]":
            return np.array([row[f"stats/{name}/{what}"] for row in episodes], np.float64)

        count, mean = of("count"), of("mean")
        weight = (count / count.sum()).reshape(-1, *[1] * (mean.ndim - 1))
        whole = (weight * mean).sum(axis=0)
        variance = (weight * (of("std") ** 2 + (mean - whole) ** 2)).sum(axis=0)
        found[name] = {
            "min": of("min").min(axis=0).tolist(),
            "max": of("max").max(axis=0).tolist(),
            "mean": whole.tolist(),
            "std": np.sqrt(variance).tolist(),
            "count": [int(count.sum())],
            **{what: (weight * of(what)).sum(axis=0).tolist() for what in QUANTILES},
        }
    return found


def _write_tasks(tasks: dict[str, int], path: Path) -> None:
    """Write the numbers of tasks; LeRobot looks them up by the words, which are the index."""
    import pandas as pd

    pd.DataFrame({"task_index": list(tasks.values())}, index=list(tasks)).to_parquet(path)


def _write_json(path: Path, content: object) -> None:
    path.write_text(json.dumps(content, indent=4, ensure_ascii=False) + "\n", encoding="utf-8")
