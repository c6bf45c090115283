"""Film: the share of a core that a camera costs which sends 720p MJPEG or H.264, 30 a second.

python -m benchmarks.film
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import av
import numpy as np

from benchmarks.table import Row
from labcrane_film.film import FilmedSource
from labcrane_film.settings import FilmCameraSettings

SECONDS, RATE_HZ = 20.0, 30

CAMERA = """
import sys, time
from fractions import Fraction
import av
source, pipe = sys.argv[1:]
with av.open(source) as made, av.open(pipe, "w", format="matroska",
                                      options={"flush_packets": "1"}) as out:
    stream = out.add_stream_from_template(made.streams.video[0])
    began = time.monotonic()
    for number, packet in enumerate(p for p in made.demux(0) if p.size):
        time.sleep(max(began + number / 30 - time.monotonic(), 0.0))
        packet.pts = packet.dts = round(1000 * number / 30)
        packet.time_base, packet.stream = Fraction(1, 1000), stream
        out.mux(packet)
"""
"""A camera in a process of its own, which sends through a pipe."""


def rows(*, brief: bool = False) -> list[Row]:
    """Return the processor time of copying a camera's pictures, in shares of the 5 % allowed."""
    seconds = 2.0 if brief else SECONDS
    return [
        Row("film", f"720p {name}, % of a core", 100 * _share(codec, seconds), 5.0, "allowed", 1.0)
        for name, codec in (("MJPEG", "mjpeg"), ("H.264", "libx264"))
    ]


def _share(codec: str, seconds: float) -> float:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source, pipe = folder / "source.mkv", folder / "camera.mkv"
        _make(source, codec, round(seconds * RATE_HZ))
        os.mkfifo(pipe)
        camera = subprocess.Popen([sys.executable, "-c", CAMERA, str(source), str(pipe)])
        settings = FilmCameraSettings(device=str(pipe), format="matroska", consent="none")
        film = FilmedSource(settings)
        film.begin()
        film.write_to(folder / "film.mkv")
        used, began = time.process_time(), time.perf_counter()
        for _ in range(round(0.8 * seconds * RATE_HZ)):
            film.read()
        share = (time.process_time() - used) / (time.perf_counter() - began)
        film.end()
        film.close()
        camera.kill()
        camera.wait()
    return share


def _make(path: Path, codec: str, count: int) -> None:
    """Write pictures with some noise, about 100 kB each as MJPEG."""
    dice = np.random.default_rng(1)
    picture = dice.integers(0, 60, (720, 1280, 3), dtype=np.uint8)
    with av.open(str(path), "w") as file:
        stream = file.add_stream(codec, rate=RATE_HZ)
        stream.width, stream.height = 1280, 720
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        stream.codec_context.max_b_frames = 0
        if codec == "libx264":
            stream.options = {"preset": "ultrafast"}
        for number in range(count):
            frame = av.VideoFrame.from_ndarray(np.roll(picture, 4 * number, axis=1))
            frame.pts = number
            file.mux(stream.encode(frame))
        file.mux(stream.encode())


if __name__ == "__main__":
    for row in rows():
        print(row)
