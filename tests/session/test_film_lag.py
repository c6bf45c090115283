"""The lag of a camera and of a microphone, measured by what a session showed and played."""

from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import av
import numpy as np
import pytest

from labcrane.recording.films.footage import Footage
from labcrane.session.postprocess import _filmed_back

RATE, SOUND_HZ, LATE_S, DECLARED_S = 60, 48_000, 0.084, 0.05
START = 500.0
FLIPS = START + np.cumsum(np.random.default_rng(5).uniform(0.7, 1.3, 20))


def footage(folder: Path, name: str, times: np.ndarray, places: np.ndarray) -> Footage:
    columns = {"frame.number": np.arange(len(times)), "file": np.ones(len(times)), "pts": places}
    stream = SimpleNamespace(
        name=f"labcrane.capture.{name}", time=times, time_error=0 * times, columns=lambda _: columns
    )
    return Footage(stream, folder, 1)


def filmed(folder: Path) -> Footage:
    """Film a patch that is white or black; times are right but for the lag that is left."""
    with av.open(str(folder / "ses-01_face.mkv"), "w") as file:
        stream = file.add_stream("mjpeg", rate=RATE)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuvj420p"
        stream.codec_context.time_base = Fraction(1, 1000)
        frames = np.arange(round(RATE * (FLIPS[-1] + 1 - START)))
        for n in frames.tolist():
            flips = (START + n / RATE >= FLIPS + LATE_S).sum()
            picture = np.full((48, 64, 3), 90, np.uint8)
            picture[8:24, 16:40] = 255 * (flips % 2)
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts, frame.time_base = round(1000 * n / RATE), Fraction(1, 1000)
            file.mux(stream.encode(frame.reformat(format="yuvj420p")))
        file.mux(stream.encode())
    return footage(folder, "face", START + frames / RATE, np.round(1000 * frames / RATE) / 1000)


def recorded(folder: Path) -> Footage:
    """Record a tone of 0.1 s after each flip."""
    times = START + np.arange(SOUND_HZ * 22) / SOUND_HZ
    since = (times[:, None] - FLIPS[None, :] - LATE_S).T
    on = ((since >= 0) & (since < 0.1)).any(axis=0)
    noise = np.random.default_rng(2).normal(0, 40, len(times))
    sound = (noise + on * 12_000 * np.sin(2 * np.pi * 997 * times)).astype(np.int16)
    with av.open(str(folder / "ses-01_face.mkv"), "w") as file:
        stream = file.add_stream("pcm_s16le", rate=SOUND_HZ, layout="mono")
        for at in range(0, len(sound), 960):
            frame = av.AudioFrame.from_ndarray(sound[None, at : at + 960], layout="mono")
            frame.sample_rate, frame.pts = SOUND_HZ, at
            file.mux(stream.encode(frame))
        file.mux(stream.encode())
    places = np.arange(0, len(sound), 960) / SOUND_HZ
    return footage(folder, "face", START + places, places)


def log(kind: str) -> SimpleNamespace:
    """Return what the view or sound logged: sounds only while they are there."""
    if kind == "light":
        flips = {"flip.time": np.r_[START, FLIPS], "patch": np.arange(21) % 2.0}
        return SimpleNamespace(units=flips, columns=lambda _: flips, time=flips["flip.time"])
    while_on = (FLIPS[:, None] + np.arange(0, 0.1, 0.01)[None, :]).ravel()
    return SimpleNamespace(units={}, time=while_on)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "make"), [("light", filmed), ("sound", recorded)])
def test_the_lag_that_was_put_in_is_measured_beside_the_declared_one(
    kind: str, make: object, tmp_path: Path
) -> None:
    session = SimpleNamespace(
        films={"face": make(tmp_path)}, streams={"labcrane.feedback.main": log(kind)}
    )
    settings = {"sees": "main", "sees_part": [16, 8, 24, 16], "lag_s": DECLARED_S}
    context = {"components": {"recordings.face": {"settings": settings}}}
    header = SimpleNamespace(name="labcrane.capture.face")
    one = SimpleNamespace(recorded=SimpleNamespace(header=header))
    (found,) = _filmed_back(session, one, 0.01, context)
    assert found.verdict == "PASS", found
    assert (found.delay.seen, found.delay.asked) == (20, 20)
    # An edge is found half way between two pictures: it is seen up to a picture late.
    assert found.delay.mean_s == pytest.approx(LATE_S, abs=1 / RATE if kind == "light" else 0.002)
    measured = 1e3 * (DECLARED_S + found.delay.mean_s)
    assert f"a lag of 50.00 ms is declared, and with it {measured:.2f} ms are" in found.in_words()
    assert _filmed_back(session, one, 0.01, {}) == []
