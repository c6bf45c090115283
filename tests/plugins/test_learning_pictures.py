"""Pictures of episodes, taken afterwards: the view's own, of a replay of the same session."""

import io
import json
import os
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from needs import GRAPHICS, LEARNERS, need, needs
from PIL import Image
from results.recorded import STUDY, record, study

from labcrane import ProtocolError, RecordingError, open_recording
from labcrane.analysis import Participant, find_cohort
from labcrane.core.records import Frame
from labcrane.protocol.rig import Rig
from labcrane.replay import Retake, replay_session
from labcrane_learning.episodes import episodes_of, layout_of
from labcrane_learning.lerobot import LeRobot
from labcrane_learning.robomimic import NAME, Robomimic
from labcrane_learning.settings import EpisodeSettings
from labcrane_view.settings import ViewSettings
from labcrane_view.view import View

EVERY = 120
SIZE = (96, 64)
OWN = {"name": "mine", "eye": [8.0, -6.0, 4.0], "look": [3.0, 0.0, 1.0]}
CAMERAS = ("free", OWN)
SETTINGS = EpisodeSettings(cameras=CAMERAS, size=SIZE, every=EVERY)


@pytest.fixture(scope="module")
def person(tmp_path_factory: pytest.TempPathFactory) -> Participant:
    need(*GRAPHICS)
    folder = tmp_path_factory.mktemp("pictures")
    text = STUDY.replace("distances: [2, 3], movements: 2", "distances: [2], movements: 1")
    record(study(folder, text), folder / "data", "P001", simulated=True)
    return find_cohort(folder / "data", ["simulated"]).included[0]


@pytest.fixture(scope="module")
def expected(
    person: Participant, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, dict[int, np.ndarray]]:
    """What a view shows while the session is replayed, at the ticks of the episodes' rows."""
    chosen = study(tmp_path_factory.mktemp("again"), person.recording.session(1).protocol)
    run = Rig.build(chosen, simulated=True).describe(chosen, participant_seed=0)
    ticks = {tick for episode in episodes(person) for tick in episode.ticks.tolist()}
    found: dict[str, dict[int, np.ndarray]] = {}
    for camera in CAMERAS:
        bare = {"display": "hidden", "hud": (), "notices": False, "areas": ()}
        view = View(ViewSettings(camera=camera, size=SIZE, **bare), chosen.machine)
        view.open(run)
        own: dict[int, np.ndarray] = {}

        def show(frame: Frame, view: View = view, own: dict[int, np.ndarray] = own) -> None:
            if frame.tick.number in ticks:
                view.present(frame)
                view.present(frame)
                own[frame.tick.number] = view.picture()

        replayed = replay_session(person.path, 1, sinks=[show])
        assert replayed.difference is None
        view.close()
        found[camera if isinstance(camera, str) else camera["name"]] = own
    return found


def episodes(person: Participant) -> list:
    ((_, session),) = person.sessions()
    return list(episodes_of(person, layout_of(session), "", EVERY))


@pytest.fixture(scope="module")
def lerobot(person: Participant, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lerobot")
    LeRobot(SETTINGS).export([person], folder)
    return folder


@pytest.mark.slow
def test_pictures_are_those_of_a_view_that_shows_the_replay(
    lerobot: Path, person: Participant, expected: dict[str, dict[int, np.ndarray]]
) -> None:
    table = pq.read_table(lerobot / "data" / "chunk-000" / "file-000.parquet").to_pylist()
    ticks = [tick for episode in episodes(person) for tick in episode.ticks.tolist()]
    assert len(ticks) == len(table) > 5
    features = json.loads((lerobot / "meta" / "info.json").read_text(encoding="utf-8"))["features"]
    for name, pictures in expected.items():
        key = f"observation.images.{name}"
        assert features[key]["shape"] == [SIZE[1], SIZE[0], 3]
        for tick, row in zip(ticks, table, strict=True):
            picture = np.asarray(Image.open(io.BytesIO(row[key]["bytes"])))
            np.testing.assert_array_equal(picture, pictures[tick])
        assert len({each.tobytes() for each in pictures.values()}) > len(ticks) // 2
    assert np.any(expected["free"][ticks[0]] != expected["mine"][ticks[0]])


@pytest.mark.slow
def test_what_is_said_of_pictures_is_so_of_all_of_their_pixels(
    lerobot: Path, expected: dict[str, dict[int, np.ndarray]]
) -> None:
    stats = json.loads((lerobot / "meta" / "stats.json").read_text(encoding="utf-8"))
    for name, pictures in expected.items():
        told = stats[f"observation.images.{name}"]
        pixels = np.stack(list(pictures.values())).reshape(-1, 3) / 255.0
        for what in ("min", "max", "mean", "std"):
            assert np.shape(told[what]) == (3, 1, 1)
            np.testing.assert_allclose(
                np.ravel(told[what]), getattr(pixels, what)(axis=0), rtol=1e-9, atol=1e-12
            )
        assert told["count"] == [len(pictures)]


@pytest.mark.slow
def test_robomimic_has_the_same_pictures_and_those_of_each_next_row(
    person: Participant, expected: dict[str, dict[int, np.ndarray]], tmp_path: Path
) -> None:
    Robomimic(SETTINGS).export([person], tmp_path)
    with h5py.File(tmp_path / NAME) as file:
        for number, episode in enumerate(episodes(person)):
            for name, pictures in expected.items():
                demo = file[f"data/demo_{number}"]
                seen = np.stack([pictures[tick] for tick in episode.ticks.tolist()])
                np.testing.assert_array_equal(demo[f"obs/{name}_image"][:], seen)
                after = demo[f"next_obs/{name}_image"][:]
                np.testing.assert_array_equal(after, np.concatenate([seen[1:], seen[-1:]]))


@pytest.mark.slow
def test_every_so_manieth_row_is_that_of_all_rows(person: Participant) -> None:
    ((_, session),) = person.sessions()
    whole = list(episodes_of(person, layout_of(session), ""))
    for few, all_ in zip(episodes(person), whole, strict=True):
        np.testing.assert_array_equal(few.observation, all_.observation[::EVERY])
        np.testing.assert_array_equal(few.action, all_.action[::EVERY])
        assert few.rate_hz * EVERY == all_.rate_hz


@pytest.mark.slow
@pytest.mark.parametrize(
    ("camera", "said"),
    [
        ("fre", r"camera 'fre': there is no such camera as 'fre'; did you mean 'free'\?"),
        ({"name": "x"}, r"camera \{'name': 'x'\}: Field required"),
        ({**OWN, "on": "tail"}, "camera 'mine' is attached to 'tail', which this machine does not"),
    ],
)
def test_a_camera_that_cannot_be_is_refused_in_words(
    person: Participant, camera: object, said: str
) -> None:
    ((_, session),) = person.sessions()
    with pytest.raises(ProtocolError, match=said), Retake(session, camera, SIZE):
        pass


@pytest.mark.slow
def test_two_cameras_of_one_name_are_refused(person: Participant, tmp_path: Path) -> None:
    twice = SETTINGS.model_copy(update={"cameras": ("free", "free")})
    with pytest.raises(ProtocolError, match="two cameras are called 'free'"):
        LeRobot(twice).export([person], tmp_path)


@pytest.mark.slow
def test_pictures_are_taken_in_order(person: Participant) -> None:
    record = open_recording(person.path).session(1)
    with Retake(record, "free", SIZE) as retake:
        retake.take(50)
        with pytest.raises(RecordingError, match="row 49 is before row 50"):
            retake.take(49)


@pytest.mark.soak
@needs("lerobot")
def test_the_published_lerobot_gives_the_views_pictures(
    lerobot: Path,
    person: Participant,
    expected: dict[str, dict[int, np.ndarray]],
    tmp_path: Path,
) -> None:
    ticks = [tick for episode in episodes(person) for tick in episode.ticks.tolist()]
    reader = Path(__file__).with_name("lerobot_reader.py")
    words = [os.environ[LEARNERS], str(reader), str(lerobot), *map(str, range(len(ticks)))]
    said = subprocess.check_output(words, env={**os.environ, "HF_HOME": str(tmp_path)})
    rows = json.loads(said.splitlines()[-1])["rows"]
    for name, pictures in expected.items():
        for number, tick in enumerate(ticks):
            got = bytes.fromhex(rows[str(number)][f"observation.images.{name}"])
            assert got == pictures[tick].tobytes()
