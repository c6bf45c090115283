"""Pictures and sound of a study that nobody has run yet."""

from pathlib import Path

import numpy as np
import pytest
from fed_study import FED
from needs import GRAPHICS, needs
from rehearsal import ScriptedConsole, a_study

import labcrane
from labcrane import Feedback, ProtocolError
from labcrane.feedback.preview import movement, write_preview
from labcrane.testing import Visit, run

PREVIEWED = FED.replace("distances: [2]", "distances: [2], limit_s: 1") + (
    "views: {operator: {use: view, renderer: software, size: [160, 90]}}\n"
)


@needs(*GRAPHICS)
def test_a_preview_has_pictures_and_sound_of_a_movement(tmp_path: Path) -> None:
    import wave

    study = a_study(tmp_path, PREVIEWED)
    files = write_preview(study, tmp_path / "out")
    pictures = [path for path in files if path.suffix == ".png"]
    assert len(pictures) == 3  # one each half second of a movement that ends after one
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in pictures)
    (sound,) = (path for path in files if path.suffix == ".wav")
    with wave.open(str(sound)) as file:
        assert file.getframerate() == 48000
        assert file.getnframes() == pytest.approx(48000, rel=0.02)
        samples = np.frombuffer(file.readframes(48000), "<i2")
    assert np.abs(samples).max() > 1000


@needs(*GRAPHICS)
def test_a_preview_shows_a_recorded_trial(tmp_path: Path) -> None:
    study = a_study(tmp_path, PREVIEWED)
    visit = Visit(study, "P001", 1, tmp_path / "data", simulated=True, fast=True)
    path = run(visit, ScriptedConsole())
    assert write_preview(study, tmp_path / "out", path, trial=3)
    session = labcrane.open_recording(path).session(1)
    frames = movement(session, 3)
    rows = session.streams["loop"].data["trial"] == 3
    np.testing.assert_array_equal(
        [frame.state for frame in frames], session.streams["state"].data[rows]
    )
    with pytest.raises(ProtocolError, match="there is no trial 99 in the recording; there is 2, 3"):
        movement(session, 99)


def test_a_study_without_feedback_has_no_preview(tmp_path: Path) -> None:
    with pytest.raises(ProtocolError, match="has neither views nor sounds; add views: or feedba"):
        write_preview(a_study(tmp_path), tmp_path / "out")


def test_a_sound_without_a_preview_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("labcrane_sonification.sonification.Sonification.preview", Feedback.preview)
    said: list[str] = []
    with pytest.raises(ProtocolError, match="nothing was written, as none of its views and sounds"):
        write_preview(a_study(tmp_path, FED), tmp_path / "out", say=said.append)
    assert len(said) == 1
    assert said[0].startswith("feedback 'tone' writes no file")
