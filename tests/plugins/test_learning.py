"""Episodes for learning machines, read as the formats' own readers read them."""

import json
import os
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from needs import LEARNERS, missing, needs

from labcrane import RecordingError
from labcrane.analysis import Participant
from labcrane.testing.exporters import make_participant
from labcrane_learning import lerobot as lerobot_module
from labcrane_learning.episodes import episodes_of, layout_of
from labcrane_learning.lerobot import LeRobot
from labcrane_learning.robomimic import NAME, Robomimic
from labcrane_learning.settings import EpisodeSettings

ROBOMIMIC = """
import sys, h5py, numpy as np
from robomimic.utils import obs_utils
from robomimic.utils.dataset import SequenceDataset
low = {"low_dim": ["state"], "rgb": [], "depth": [], "scan": []}
obs_utils.initialize_obs_utils_with_obs_specs({"obs": low})
read = SequenceDataset(
    hdf5_path=sys.argv[1], obs_keys=("state",), dataset_keys=("actions", "rewards", "dones"),
    hdf5_cache_mode="low_dim", load_next_obs=True,
)
at = 0
with h5py.File(sys.argv[1]) as file:
    for name in read.demos:
        demo = file["data"][name]
        for row in range(demo.attrs["num_samples"]):
            for key, held in (("actions", "actions"), ("rewards", "rewards"), ("dones", "dones")):
                assert np.array_equal(read[at][key][0], demo[held][row])
            assert np.array_equal(read[at]["obs"]["state"][0], demo["obs/state"][row])
            at += 1
print(len(read) == at, at)
"""


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> list[Participant]:
    folder = tmp_path_factory.mktemp("data")
    return [make_participant(folder, name) for name in ("P001", "P002")]


@pytest.fixture(scope="module")
def lerobot(people: list[Participant], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lerobot")
    LeRobot(EpisodeSettings(task="Move the tip")).export(iter(people), folder)
    return folder


def frames(person: Participant) -> pd.DataFrame:
    """Every tick of a participant, as the participant file has it."""
    ((_, session),) = person.sessions()
    streams = {name: session.streams[name] for name in ("loop", "state", "input", "task")}
    return pd.concat([one.data.add_prefix(f"{name}.") for name, one in streams.items()], axis=1)


def test_an_action_is_what_was_done_upon_what_was_seen(people: list[Participant]) -> None:
    for person in people:
        ((_, session),) = person.sessions()
        layout = layout_of(session)
        ticks = frames(person)
        found = list(episodes_of(person, layout, ""))
        assert [episode.trial for episode in found] == list(session.trials["trial"])
        for episode in found:
            own = ticks[(ticks["loop.trial"] == episode.trial) & (ticks["loop.paused"] == 0)]
            seen = own[list(layout.observation)].to_numpy(np.float32)
            done = own[list(layout.action)].to_numpy(np.float32)
            np.testing.assert_array_equal(episode.observation, seen[:-1])
            np.testing.assert_array_equal(episode.action, done[1:])
            assert episode.skill == (session.trials["outcome"] == "success").mean()


def test_lerobots_tables_say_where_every_episode_is(
    lerobot: Path, people: list[Participant]
) -> None:
    info = json.loads((lerobot / "meta" / "info.json").read_text(encoding="utf-8"))
    assert info["codebase_version"] == "v3.0"
    episodes = pq.read_table(lerobot / "meta/episodes/chunk-000/file-000.parquet").to_pandas()
    assert len(episodes) == info["total_episodes"]
    tasks = pd.read_parquet(lerobot / "meta" / "tasks.parquet")
    rows = 0
    for number, episode in episodes.iterrows():
        place = info["data_path"].format(
            chunk_index=episode["data/chunk_index"], file_index=episode["data/file_index"]
        )
        data = pq.read_table(lerobot / place).to_pandas()
        own = data[data["episode_index"] == number]
        assert len(own) == episode["length"]
        assert list(own["index"]) == list(
            range(episode["dataset_from_index"], episode["dataset_to_index"])
        )
        assert tasks.loc[episode["tasks"][0], "task_index"] == own["task_index"].unique().item()
        np.testing.assert_allclose(
            own["timestamp"], np.arange(len(own)) / info["fps"], rtol=1e-6, atol=1e-9
        )
        assert list(own["next.success"]) == [False] * (len(own) - 1) + [bool(episode["success"])]
        rows += len(own)
    assert rows == info["total_frames"]
    assert set(episodes["participant"]) == {person.name for person in people}
    state = info["features"]["observation.state"]
    assert dict(zip(state["names"], state["units"], strict=True))["state.tip.position.x"] == "m"


def test_statistics_of_all_episodes_are_those_of_all_rows(lerobot: Path) -> None:
    stats = json.loads((lerobot / "meta" / "stats.json").read_text(encoding="utf-8"))
    data = pd.concat(
        [pq.read_table(path).to_pandas() for path in sorted(lerobot.glob("data/*/*.parquet"))]
    )
    for name in ("observation.state", "action"):
        values = np.stack(data[name]).astype(np.float64)
        for what in ("min", "max", "mean", "std"):
            np.testing.assert_allclose(
                stats[name][what], getattr(values, what)(axis=0), rtol=1e-9, atol=1e-12
            )
        assert stats[name]["count"] == [len(values)]


@pytest.mark.soak
@needs("lerobot")
def test_the_published_lerobot_loads_it_equal_in_float32(
    lerobot: Path, people: list[Participant], tmp_path: Path
) -> None:
    expected = []
    for person in people:
        ((_, session),) = person.sessions()
        expected += list(episodes_of(person, layout_of(session), "Move the tip"))
    seen = np.concatenate([episode.observation for episode in expected])
    done = np.concatenate([episode.action for episode in expected])
    at = np.random.default_rng().integers(0, len(seen), 20).tolist()
    reader = Path(__file__).with_name("lerobot_reader.py")
    said = subprocess.check_output(
        [os.environ[LEARNERS], str(reader), str(lerobot), *map(str, at)],
        env={**os.environ, "HF_HOME": str(tmp_path)},
    )
    read = json.loads(said.splitlines()[-1])
    assert (read["frames"], read["episodes"]) == (len(seen), len(expected))
    for number in at:
        row = read["rows"][str(number)]
        assert bytes.fromhex(row["observation.state"]) == seen[number].astype("<f4").tobytes()
        assert bytes.fromhex(row["action"]) == done[number].astype("<f4").tobytes()
        assert row["task"] == expected[row["episode"]].task


def test_robomimics_file_holds_every_episode_with_its_ends(
    people: list[Participant], tmp_path: Path
) -> None:
    Robomimic(EpisodeSettings()).export(iter(people), tmp_path)
    expected = []
    for person in people:
        ((_, session),) = person.sessions()
        expected += list(episodes_of(person, layout_of(session), ""))
    with h5py.File(tmp_path / NAME) as file:
        data = file["data"]
        assert len(data) == len(expected)
        assert data.attrs["total"] == sum(len(episode.action) for episode in expected)
        assert json.loads(data.attrs["env_args"])["env_name"] == "labcrane/Study-v0"
        names = json.loads(data.attrs["obs_names"])
        for number, episode in enumerate(expected):
            demo = data[f"demo_{number}"]
            assert demo.attrs["num_samples"] == len(episode.action)
            np.testing.assert_array_equal(demo["actions"][:], episode.action)
            state = [at for at, name in enumerate(names) if name.startswith("state.")]
            np.testing.assert_array_equal(demo["obs/state"][:], episode.observation[:, state])
            np.testing.assert_array_equal(demo["next_obs/state"][:-1], demo["obs/state"][1:])
            assert demo["dones"][:].tolist() == [0] * (len(episode.action) - 1) + [1]
            assert demo["rewards"][-1] == episode.success
            assert demo.attrs["participant"] == episode.participant
        succeeded = {f"demo_{at}" for at, episode in enumerate(expected) if episode.success}
        assert {name.decode() for name in file["mask/success"][:]} == succeeded


@pytest.mark.soak
@needs("robomimic")
def test_the_published_robomimic_reads_every_row(people: list[Participant], tmp_path: Path) -> None:
    Robomimic(EpisodeSettings()).export(iter(people), tmp_path)
    words = [os.environ[LEARNERS], "-c", ROBOMIMIC, str(tmp_path / NAME)]
    said = subprocess.check_output(words, text=True).splitlines()[-1]
    with h5py.File(tmp_path / NAME) as file:
        assert said == f"True {file['data'].attrs['total']}"


def test_people_with_other_columns_are_not_mixed(
    people: list[Participant], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    was = lerobot_module.layout_of

    def fewer(session):
        layout = was(session)
        return type(layout)(layout.observation[:-1], layout.action, layout.units)

    monkeypatch.setattr(lerobot_module, "layout_of", fewer)
    with pytest.raises(RecordingError, match="session 1 of P001 has other columns than"):
        LeRobot(EpisodeSettings()).export(iter(people), tmp_path)


def test_what_to_do_without_lerobot_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(LEARNERS, raising=False)
    missing.cache_clear()
    assert "pip install lerobot" in str(missing("lerobot"))
    missing.cache_clear()
