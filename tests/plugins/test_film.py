"""Cameras, microphones and screens: their files, read by another decoder, and the times."""

import math
import os
import stat
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import av
import numpy as np
import pytest

from labcrane import Capture, DeviceError, Offer, Settings
from labcrane.core import Captured, Finding, Verdict
from labcrane.streams.sync.correction import as_stated
from labcrane.streams.sync.raw import RawStream
from labcrane.testing import CaptureContract, ExaminationContract
from labcrane_film import labcrane_captures, stamps
from labcrane_film.film import FilmedSource, examine
from labcrane_film.settings import LOGIN, FilmCameraSettings, MicrophoneSettings, SourceSettings

CLOCKED = "settb=1/1000000,realtime,setpts=RTCTIME"
"""A source in real time, stamped with the computer's date as drivers do."""


def camera(filters: str = CLOCKED, rate: float = 30, **settings: object) -> FilmedSource:
    device = f"testsrc2=size=160x120:rate={rate},{filters}"
    return FilmedSource(
        FilmCameraSettings.model_validate(
            {"device": device, "format": "lavfi", "consent": "we film", **settings}
        )
    )


def microphone() -> FilmedSource:
    device = "sine=sample_rate=48000,arealtime"
    return FilmedSource(
        MicrophoneSettings(device=device, format="lavfi", consent="we record sound")
    )


@pytest.mark.slow
class TestCamera(CaptureContract):
    """Offered as "camera" and "screen"."""

    @pytest.fixture
    def capture(self) -> Capture:
        return camera()


@pytest.mark.slow
class TestMicrophone(CaptureContract):
    """Offered as "microphone"."""

    @pytest.fixture
    def capture(self) -> Capture:
        return microphone()


@pytest.mark.slow
class TestExamination(ExaminationContract):
    """It is that of all three."""

    @pytest.fixture
    def offered(self) -> Offer[Capture]:
        return labcrane_captures()[0]

    @pytest.fixture(params=[CLOCKED, "realtime", "no filter"])
    def settings(self, request: pytest.FixtureRequest) -> Settings:
        device = f"testsrc2=size=160x120:rate=30,{request.param}"
        return FilmCameraSettings(device=device, format="lavfi", consent="we film")


@pytest.mark.slow
def test_an_examination_tells_a_device_with_timestamps_from_one_without() -> None:
    def found(filters: str) -> Finding:
        device = f"testsrc2=size=160x120:rate=30,{filters}"
        return examine(FilmCameraSettings(device=device, format="lavfi", consent="we film"))[0]

    assert found(CLOCKED).verdict is Verdict.PASS
    assert "160 x 120, 30.0 a second, which is encoded by libx264" in found(CLOCKED).text
    assert found("realtime").verdict is Verdict.WARN
    assert found("no filter").verdict is Verdict.FAIL


def frames_in(path: Path) -> list[float]:
    """Return where the frames of a file are, in seconds, as a demuxer finds them."""
    with av.open(str(path)) as file:
        return [float(each.pts * each.time_base) for each in file.demux(0) if each.size]


def recorded(film: FilmedSource, path: Path, seconds: float) -> Iterator[list[Captured]]:
    """Yield what is returned while a film records."""
    film.begin()
    film.write_to(path)
    until = time.perf_counter() + seconds
    while time.perf_counter() < until:
        yield list(film.read())


def read_on(film: FilmedSource, told: list[Captured], seconds: float) -> None:
    until = time.perf_counter() + seconds
    while time.perf_counter() < until:
        told += film.read()


@pytest.mark.slow
@pytest.mark.parametrize("make", [camera, microphone], ids=["camera", "microphone"])
def test_a_file_that_is_cut_by_a_kill_has_the_frames_that_were_returned(
    make: type[FilmedSource], tmp_path: Path
) -> None:
    film, path, cut = make(), tmp_path / "a.mkv", tmp_path / "cut.mkv"
    told: list[Captured] = []
    seen = 0
    for frames in recorded(film, path, 2.6):
        told += frames
        if frames:  # what is on the disk now is all that a kill would leave
            seen += 1
            cut.write_bytes(path.read_bytes())
            assert frames_in(cut) == pytest.approx([each.pts for each in told])
    assert seen >= 2
    told += film.end()
    film.close()
    assert frames_in(path) == pytest.approx([each.pts for each in told])
    assert (np.diff([each.number for each in told]) >= 1).all()  # a busy computer leaves some out


@pytest.mark.slow
@pytest.mark.parametrize("codec", ["mjpeg", "libx264"])
def test_compressed_pictures_are_copied_and_not_encoded_again(codec: str, tmp_path: Path) -> None:
    source, path = tmp_path / "source.mkv", tmp_path / "copy.mkv"
    with av.open(str(source), "w") as file:
        stream = file.add_stream(codec, rate=25)
        stream.width, stream.height = 160, 120
        stream.codec_context.max_b_frames = 0  # as of a camera
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        for number in range(50):
            frame = av.VideoFrame(160, 120, "rgb24")
            frame.pts = number
            file.mux(stream.encode(frame))
        file.mux(stream.encode())
    with av.open(str(source)) as file:
        sent = [bytes(each) for each in file.demux(0) if each.size]
    film = FilmedSource(
        FilmCameraSettings(device=str(source), format="matroska", consent="we film")
    )
    film.begin()
    film.write_to(path)
    told: list[Captured] = []
    with pytest.raises(DeviceError, match="has ended"):
        read_on(film, told, math.inf)
    told += film.end()
    film.close()
    with av.open(str(path)) as file:
        assert [bytes(each) for each in file.demux(0) if each.size] == sent
    assert len(told) == 50


@pytest.mark.slow
def test_a_stamp_of_the_computers_date_is_on_the_sessions_clock(tmp_path: Path) -> None:
    film = camera()
    film.begin()
    film.write_to(tmp_path / "a.mkv")
    before = time.perf_counter()
    told = [frame for _ in range(40) for frame in film.read()]
    after = time.perf_counter()
    film.close()
    late = [frame for frame in told if not before - 0.2 <= frame.time <= after]
    assert not late
    assert all(frame.arrival == 0.0 and frame.clock < 1e-3 for frame in told)
    assert all(math.isnan(frame.lag) for frame in told)  # it was not declared


@pytest.mark.slow
def test_a_frame_of_an_unknown_clock_has_its_arrival_and_a_period_at_least(tmp_path: Path) -> None:
    film = camera("realtime", lag_s=0.02, lag_error_s=0.005)
    told = [frame for frames in recorded(film, tmp_path / "a.mkv", 1.5) for frame in frames]
    film.close()
    assert told
    assert all(frame.arrival >= 1 / 30 and frame.lag == 0.005 for frame in told)
    assert told[-1].time <= time.perf_counter() - 0.02


@pytest.mark.slow
def test_frames_that_the_device_left_out_are_counted(tmp_path: Path) -> None:
    film = camera(f"{CLOCKED},select='not(eq(mod(n,10),5))'")  # each tenth is missing
    told = [frame for frames in recorded(film, tmp_path / "a.mkv", 2.0) for frame in frames]
    told += film.end()
    film.close()
    missed = told[-1].number + 1 - len(told)
    assert missed >= len(told) / 9 - 1.5  # a busy computer leaves out more


def test_a_camera_that_sends_half_of_the_pictures_it_declares_drops_none(tmp_path: Path) -> None:
    film = camera(f"{CLOCKED},select='not(mod(n,2))'")  # as in the dark
    told = [frame for frames in recorded(film, tmp_path / "a.mkv", 2.0) for frame in frames]
    told += film.end()
    film.close()
    assert [frame.number for frame in told] == list(range(len(told)))


def test_a_stamp_of_another_clock_is_not_taken_for_one_of_ours() -> None:
    now = time.perf_counter()
    assert stamps.StampClock().time_of(12.5, now) is None
    found = stamps.StampClock().time_of(time.time() - 0.1, time.perf_counter())
    assert found is not None
    assert found[0] == pytest.approx(time.perf_counter() - 0.1, abs=0.05)


def test_a_date_that_is_set_while_frames_come_widens_the_uncertainty(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    date = [1000.0]
    monkeypatch.setattr(stamps, "CLOCKS", (lambda: date[0] + time.perf_counter(),))
    clock = stamps.StampClock()
    arrival = time.perf_counter()
    assert clock.time_of(date[0] + arrival - 0.01, arrival)[1] < 1e-3
    date[0] += 0.5
    arrival = time.perf_counter()
    assert clock.time_of(date[0] + arrival - 0.01, arrival)[1] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("ppm", [-90.0, 0.0, 90.0])
@pytest.mark.parametrize("grown", [0.1, 1.0])
def test_a_delay_that_grows_and_stays_is_in_the_uncertainty(grown: float, ppm: float) -> None:
    """It was forgotten after 300 frames: 0.98 s off where 0.077 were stated."""
    random = np.random.default_rng(3)
    taken = np.arange(3000) / 30.0 * (1.0 + ppm * 1e-6)
    pts = np.arange(3000) / 30.0 + 71.0
    late = random.exponential(0.01, 3000) + grown * (taken > 20.0) + grown * (taken > 60.0)
    spread = stamps.ArrivalSpread()
    stated = [spread.of(p, t, 1 / 30) for p, t in zip(pts, taken + late, strict=True)]
    assert np.mean(late <= np.array(stated) + 0.001) > 0.999
    assert stated[-1] < 2.0 * grown + 0.15


def test_a_frame_without_pictures_is_counted_and_the_next_one_is_recorded(tmp_path: Path) -> None:
    """A camera sends an empty buffer where it lost one; the file ended, and seconds were lost."""
    film = camera()
    film.begin()
    whole, empty = film._packets, [7, 8]  # no device here sends an empty one

    def packets() -> Iterator[object]:
        for number, each in enumerate(whole):
            yield SimpleNamespace(size=0, pts=each.pts) if number in empty else each

    film._packets = packets()
    film.write_to(tmp_path / "face.mkv")
    found = [each.number for _ in range(18) for each in film.read()]
    found += [each.number for each in film.end()]
    film.close()
    assert len(found) == 18
    assert found[-1] >= 19


def test_missing_film_between_two_files_is_a_gap() -> None:
    time = np.r_[np.arange(90), np.arange(310, 400)] / 30.0
    quality = as_stated(RawStream(time), {"clock": np.zeros(180)}, 14.0).quality
    assert (quality.gaps, round(quality.longest_gap_s, 3)) == (1, round(221 / 30, 3))
    assert as_stated(RawStream(time[:90]), {"clock": np.zeros(90)}, 3.0).quality.gaps == 0


def with_b_frames(path: Path) -> SourceSettings:
    with av.open(str(path), "w") as file:
        stream = file.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 160, 120, "yuv420p"
        stream.codec_context.max_b_frames = 2
        for number in range(100):
            frame = av.VideoFrame.from_ndarray(
                np.full((120, 160, 3), 2 * number, np.uint8), format="rgb24"
            )
            frame.pts = number
            file.mux(stream.encode(frame))
        file.mux(stream.encode())
    return FilmCameraSettings(device=str(path), format="matroska", consent="we film")


def test_b_frames_are_refused_by_name_before_a_file_begins(tmp_path: Path) -> None:
    settings = with_b_frames(tmp_path / "source.mkv")
    (found,) = examine(settings)
    assert found.verdict is Verdict.FAIL
    assert "source.mkv' (matroska) go back: it sends B-frames" in found.text


@pytest.mark.parametrize("login", ["", "admin:s3cr@t"])
def test_a_message_about_a_network_camera_has_its_address_without_the_password(
    login: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(LOGIN, login)
    settings = FilmCameraSettings(device="rtsp://127.0.0.1:9/stream", consent="we film")
    assert settings.source()[0] == f"rtsp://{login}@127.0.0.1:9/stream".replace("//@", "//")
    film = FilmedSource(settings)
    with pytest.raises(DeviceError, match=r"'rtsp://127.0.0.1:9/stream' cannot be") as raised:
        film.begin()
    film.close()
    assert "s3cr" not in f"{raised.value}{raised.value.__cause__}"
    assert "admin" not in str(raised.value)


def test_a_login_in_the_address_is_refused_since_every_recording_would_keep_it() -> None:
    with pytest.raises(ValueError, match="environment variable LABCRANE_CAMERA_LOGIN to name:pass"):
        FilmCameraSettings(device="rtsp://admin:s3cr@t@127.0.0.1/stream", consent="we film")


def test_a_device_that_is_not_there_is_named_with_what_to_do() -> None:
    film = FilmedSource(FilmCameraSettings(device="/dev/video-none", consent="we film"))
    with pytest.raises(DeviceError, match=r"'/dev/video-none' .*cannot be opened.*plug it in"):
        film.begin()
    film.close()


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no limit of a file's size")
def test_a_full_disk_is_reported_and_what_was_written_stays(tmp_path: Path) -> None:
    import resource

    path, told = tmp_path / "a.mkv", []
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    film = camera()
    film.begin()
    film.write_to(path)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
    try:
        with pytest.raises(DeviceError, match=r"a\.mkv cannot be written.*make room"):
            read_on(film, told, 60.0)
    finally:
        film.close()
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert told
    assert frames_in(path)[: len(told)] == pytest.approx([each.pts for each in told])
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


@pytest.mark.parametrize(
    ("system", "expected"),
    [
        ("linux", ("/dev/video0", "v4l2", {"video_size": "1280x720", "input_format": "mjpeg"})),
        ("win32", ("video=/dev/video0", "dshow", {"video_size": "1280x720", "vcodec": "mjpeg"})),
    ],
)
def test_a_camera_is_called_as_its_system_calls_it(
    system: str, expected: tuple[object, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("labcrane_film.settings.SYSTEM", system)
    settings: SourceSettings = FilmCameraSettings(
        device="/dev/video0", size=(1280, 720), compression="mjpeg", consent="we film"
    )
    assert settings.source() == expected
