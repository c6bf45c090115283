"""Robomimic's data sets: one HDF5 file, one group per demonstration.

The layout is that of https://robomimic.github.io/docs/datasets/overview.html.
"""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from labcrane import RecordingError
from labcrane.analysis import Exporter, Participant
from labcrane_learning.episodes import Episode, Layout, episodes_of, layout_of
from labcrane_learning.settings import EpisodeSettings

if TYPE_CHECKING:
    import h5py

NAME = "demonstrations.hdf5"
GYM = 2
"""Robomimic's number for environments of gymnasium."""


class Robomimic(Exporter):
    """``demonstrations.hdf5``: observations, actions, rewards and ends of each episode.

    Beside what robomimic reads, each demonstration says whose it is, its task in words, whether it
    succeeded and the operator's skill; ``mask/success`` lists those that succeeded, and names and
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
                    _describe(data, layout, participant, float(session.attrs["rate_hz"]))
                for episode in episodes_of(participant, layout, self._settings.task):
                    name = f"demo_{count}"
                    _write(data.create_group(name), episode, layout)
                    count += 1
                    total += len(episode.action)
                    if episode.success:
                        succeeded.append(name)
            if not count:
                raise RecordingError("no trial was recorded that could be an episode")
            data.attrs["total"] = total
            file.create_dataset("mask/success", data=np.array(succeeded, "S"))


def _describe(data: "h5py.Group", layout: Layout, participant: Participant, rate_hz: float) -> None:
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


def _write(demo: "h5py.Group", episode: Episode, layout: Layout) -> None:
    count = len(episode.action)
    demo.attrs["num_samples"] = count
    for name in ("participant", "session", "trial", "attempt", "task", "success", "skill"):
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
