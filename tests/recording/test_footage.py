"""Footage: the frame that stands at a time is read from its file, also where a kill has cut it."""

import io
import sys
import wave
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import av
import numpy as np
import pytest

from labcrane import RecordingError
from labcrane.recording.films.footage import Footage

BLOCK, BITS, RATE = 16, 12, 30


def bars(number: int) -> np.ndarray:
    """Return a picture of black and white blocks, the lowest bit first."""
    bits = [255 * (number >> bit & 1) for bit in range(BITS)]
    return np.repeat(np.array(bits, np.uint8), BLOCK)[None, :].repeat(32, 0)


def number_in(jpeg: bytes) -> int:
    """Return the number that a picture shows, as another decoder sees it."""
    with av.open(io.BytesIO(jpeg), format="jpeg_pipe") as file:
        grey = next(file.decode(0)).to_ndarray(format="gray")
    blocks = grey[8:24].mean(axis=0).reshape(BITS, BLOCK)[:, 4:-4].mean(axis=1) > 128
    return int(sum(1 << bit for bit, white in enumerate(blocks) if white))


def film(path: Path, codec: str, numbers: range) -> list[float]:
    """Write a film whose frames show their numbers; return the places of the frames."""
    with av.open(str(path), "w", options={"cluster_time_limit": "1000"}) as file:
        stream = file.add_stream(codec, rate=RATE)
        stream.width, stream.height = BLOCK * BITS, 32
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        stream.codec_context.max_b_frames, stream.codec_context.gop_size = 0, RATE
        stream.codec_context.time_base = Fraction(1, 1000)
        for at, number in enumerate(numbers):
            frame = av.VideoFrame.from_ndarray(bars(number), format="gray")
            frame.pts, frame.time_base = round(1000 * at / RATE), Fraction(1, 1000)
            file.mux(stream.encode(frame.reformat(format=stream.pix_fmt)))
        file.mux(stream.encode())
    with av.open(str(path)) as file:
        return [float(each.pts * each.time_base) for each in file.demux(0) if each.size]


def listed(folder: Path, rows: list[tuple[float, int, int, float]], name: str = "face") -> Footage:
    """Return footage by its list: time, number, file and place of each frame."""
    time, number, file, pts = np.array(rows, float).T
    columns = {"frame.number": number, "file": file, "pts": pts}
    stream = SimpleNamespace(
        name=f"labcrane.capture.{name}",
        time=time,
        time_error=0.001 * time,
        columns=lambda _: columns,
    )
    return Footage(stream, folder, 1)


@pytest.mark.parametrize("codec", ["mjpeg", "libx264"])
def test_each_frame_is_found_at_its_time_in_any_order(codec: str, tmp_path: Path) -> None:
    places = film(tmp_path / "ses-01_face.mkv", codec, range(200))
    found = listed(tmp_path, [(70.0 + pts, n, 1, pts) for n, pts in enumerate(places)])
    dice = np.random.default_rng(76)
    for row in [*range(40), *dice.integers(0, 200, 30), 7, 7]:
        at = found.row(70.0 + places[row] + dice.uniform(0.0, 0.03))
        assert (at, number_in(found.picture(at))) == (row, row)
    assert found.period_s == pytest.approx(1 / RATE, abs=1e-3)


@pytest.mark.parametrize("codec", ["mjpeg", "libx264"])
def test_a_film_that_was_cut_is_read_as_far_as_it_goes(codec: str, tmp_path: Path) -> None:
    path = tmp_path / "ses-01_face.mkv"
    places = film(path, codec, range(300))
    path.write_bytes(path.read_bytes()[: int(0.7 * path.stat().st_size)])  # no index at its end
    found = listed(tmp_path, [(pts, n, 1, pts) for n, pts in enumerate(places)])
    for row in (150, 30, 31, 149, 0):
        assert number_in(found.picture(row)) == row
    with pytest.raises(RecordingError, match=r"no frame at 9\.967 s|cannot be read at 9\.967 s"):
        found.picture(299)
    assert number_in(found.picture(40)) == 40


def test_a_gap_has_its_words_and_no_old_picture(tmp_path: Path) -> None:
    rows = [(n / 10, n, 1, n / 10) for n in range(10) if n not in {4, 5}]
    rows += [(3.0 + n / 10, n, 2, n / 10) for n in range(10)]
    found = listed(tmp_path, rows)
    said = {
        -0.1: "begins later",
        0.46: "2 were dropped here",
        1.5: "a gap of 2.1 s between files 1 and 2",
        4.06: "has ended",
    }
    for at, words in said.items():
        with pytest.raises(RecordingError, match=f"no frame: .*{words}"):
            found.row(at)
    assert [found.row(at) for at in (0.0, 0.39, 0.44, 0.6, 0.99, 3.0, 3.95)] == [
        0,
        3,
        3,
        4,
        7,
        8,
        17,
    ]
    (folder := tmp_path / "ses-01_face.2.mkv").touch()
    one, two = found.listed()
    assert (one["file"], one["frames"], one["dropped"], one["until"]) == ("", 8, 2, 0.9)
    assert (two["file"], two["frames"], two["dropped"], two["time"]) == (folder.name, 10, 0, 3.0)
    assert two["rate_hz"] == pytest.approx(10.0)
    assert two["time_error"] == pytest.approx(np.quantile(0.003 + 1e-4 * np.arange(10), 0.95))
    folder.unlink()
    with pytest.raises(RecordingError, match=r"face: file 2 is missing in .*; put it back"):
        found.picture(8)


def test_a_recording_that_is_called_as_the_journal_has_its_own_file(tmp_path: Path) -> None:
    for ending, own in ((".xdf", None), (".jsonl", None), (".mkv", "ses-01_run.mkv")):
        (tmp_path / f"ses-01_run{ending}").touch()
        found = listed(tmp_path, [(0.0, 0, 1, 0.0)], "run").files[1]
        assert (found and found.name) == own


def test_without_pyav_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ses-01_face.mkv").touch()
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(RecordingError, match=r"pip install 'labcrane\[video\]'"):
        listed(tmp_path, [(0.0, 0, 1, 0.0)]).picture(0)


def test_brightness_is_that_of_a_part_of_each_picture(tmp_path: Path) -> None:
    places = film(tmp_path / "ses-01_face.mkv", "mjpeg", range(64))
    found = listed(tmp_path, [(9.0 + pts, n, 1, pts) for n, pts in enumerate(places)])
    times, level = found.level((3 * BLOCK + 4, 8, 8, 16))
    np.testing.assert_allclose(times, 9.0 + np.array(places))
    assert ((level > 0.5) == [bool(n & 8) for n in range(64)]).all()
    with pytest.raises(RecordingError, match="is outside the picture, which is 192 x 32"):
        found.level((400, 0, 5, 5))


def test_sound_is_where_it_was_in_time_and_silent_in_a_gap(tmp_path: Path) -> None:
    """Two files of noise with a second between them, which begins at a known sample."""
    rate, rows, noise = 48_000, [], np.random.default_rng(1).integers(-9000, 9000, (2, 48_000))
    for at, starts in enumerate((20.0, 22.0)):
        path = tmp_path / f"ses-01_room{('', '.2')[at]}.mkv"
        with av.open(str(path), "w") as file:
            stream = file.add_stream("pcm_s16le", rate=rate, layout="mono")
            for n in range(0, rate, 960):
                piece = noise[at, None, n : n + 960].astype(np.int16)
                frame = av.AudioFrame.from_ndarray(piece, format="s16", layout="mono")
                frame.sample_rate, frame.pts = rate, n
                file.mux(stream.encode(frame))
            file.mux(stream.encode())
        rows += [(starts + n / 50, n, at + 1, n / 50) for n in range(50)]
    found = listed(tmp_path, rows, "room")
    assert found.is_sound
    with wave.open(io.BytesIO(found.sound(20.5, 2.0))) as file:
        assert (file.getframerate(), file.getnchannels(), file.getnframes()) == (rate, 1, 2 * rate)
        heard = np.frombuffer(file.readframes(2 * rate), np.int16)
    np.testing.assert_array_equal(heard[: rate // 2], noise[0, rate // 2 :])
    assert not heard[rate // 2 : 3 * rate // 2].any()
    np.testing.assert_array_equal(heard[3 * rate // 2 :], noise[1, : rate // 2])
    times, level = found.level()
    assert level[10] == pytest.approx(np.abs(noise[0, 480:528]).max() / 32_768)
    assert times[10] == pytest.approx(20.01)
