"""Robomimic's data sets: one HDF5 file, one group per demonstration.

The layout is that of https://robomimic.github.io/docs/datasets/overview.html.
"""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from labcrane import RecordingError
from labcrane.analysis import Exporter, Participant
from labcrane_learning.episodes import Episode, EpisodeLayout, episodes_of, layout_of
from labcrane_learning.pictures import EpisodePictures, unpacked
from labcrane_learning.settings import EpisodeSettings

if TYPE_CHECKING:
    import h5py

NAME = "demonstrations.hdf5"
SAID = (
    "participant", "session", "trial", "attempt", "task", "success", "presentation_failed", "skill",
)  # fmt: skip
"""What of an episode each demonstration says as attributes."""

GYM = 2
"""Robomimic's number for environments of gymnasium."""


class Robomimic(Exporter):
    """``demonstrations.hdf5``: observations, actions, rewards and ends of each episode.

    Pictures of the cameras that are asked for are ``obs/CAMERA_image``, of the modality ``rgb``.

    Beside what robomimic reads, each demonstration states whose it is, its task in words, whether
    it succeeded, and the operator's skill. ``presentation_failed`` states whether the operator was
    shown too little, which is not a success. ``mask/success`` lists those that succeeded; names and
    units of columns are attributes.
    """

    def __init__(self, settings: EpisodeSettings) -> None:
        self._settings = settings

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        import h5py

        with h5py.File(folder / NAME, "w") as file:
            data = file.create_group("data")
            layout, count, total, succeeded = None, 0, 0, []
            for participant in participants:
                if layout is None:
                    _, session = next(participant.sessions())
                    layout = layout_of(session)
                    rate_hz = float(session.attrs["rate_hz"]) / self._settings.every
                    _describe(data, layout, participant, rate_hz)
                with EpisodePictures(participant, self._settings) as pictures:
                    task, every = self._settings.task, self._settings.every
                    for episode in episodes_of(participant, layout, task, every):
                        name = f"demo_{count}"
                        demo = data.create_group(name)
                        _write(demo, episode, layout)
                        _write_pictures(demo, pictures.of(episode), len(episode.action))
                        count += 1
                        total += len(episode.action)
                        if episode.success:
                            succeeded.append(name)
            if not count:
                raise RecordingError("no recorded trial can be an episode")
            data.attrs["total"] = total
            file.create_dataset("mask/success", data=np.array(succeeded, "S"))


def _describe(
    data: "h5py.Group", layout: EpisodeLayout, participant: Participant, rate_hz: float
) -> None:
    context = participant.context
    about = {
        "env_name": "labcrane/Study-v0",
        "type": GYM,
        "env_kwargs": {"study": context.get("study", ""), "rate_hz": rate_hz},
        "protocol_sha256": context.get("protocol_sha256", ""),
    }
    data.attrs["env_args"] = json.dumps(about)
    for key, names in (("actions", layout.action), ("obs", layout.observation)):
        data.attrs[f"{key}_names"] = json.dumps(names)
        data.attrs[f"{key}_units"] = json.dumps([layout.units[name] for name in names])


def _write(demo: "h5py.Group", episode: Episode, layout: EpisodeLayout) -> None:
    count = len(episode.action)
    demo.attrs["num_samples"] = count
    for name in SAID:
        demo.attrs[name] = getattr(episode, name)
    last = np.zeros(count, np.int64)
    last[-1] = 1
    demo["actions"] = episode.action
    demo["states"] = episode.observation
    demo["rewards"] = last.astype(np.float64) * episode.success
    demo["dones"] = last
    for group in dict.fromkeys(name.partition(".")[0] for name in layout.observation):
        places = [at for at, name in enumerate(layout.observation) if name.startswith(f"{group}.")]
        seen = episode.observation[:, places]
        demo[f"obs/{group}"] = seen
        demo[f"next_obs/{group}"] = np.concatenate([seen[1:], seen[-1:]])


def _write_pictures(demo: "h5py.Group", pictures: Iterator[dict[str, bytes]], count: int) -> None:
    """Write pictures as they are taken: ``obs/CAMERA_image``, and those of each next row."""
    for row, each in enumerate(pictures):
        for name, png in each.items():
            picture = unpacked(png)
            for group in ("obs", "next_obs"):
                path = f"{group}/{name}_image"
                if path not in demo:
                    one = (1, *picture.shape)
                    demo.create_dataset(
                        path, (count, *picture.shape), np.uint8, chunks=one, compression="gzip",
                        compression_opts=1,
                    )  # fmt: skip
            demo[f"obs/{name}_image"][row] = picture
            for at in {max(row - 1, 0), row} if row == count - 1 else {row - 1} - {-1}:
                demo[f"next_obs/{name}_image"][at] = picture
