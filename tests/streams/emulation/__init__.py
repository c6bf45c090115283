"""Devices with wrong clocks, recorded by the real recorder, on one computer."""

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyxdf

from labcrane.recording import XdfWriter
from labcrane.recording.foreign_streams import RecordedStream, read_streams
from labcrane.recording.paths import parts

HERE = Path(__file__).parent


def build(folder: Path) -> Path:
    """Compile the library that gives a process another clock."""
    library = folder / "skew.so"
    source = HERE / "skew.c"
    subprocess.run(
        ["gcc", "-O2", "-fPIC", "-shared", "-o", library, source, "-ldl", "-lm"], check=True
    )
    return library


@dataclass(frozen=True)
class Skew:
    """What a device's clock does; seconds and parts per million."""

    offset: float = 1000.0
    ppm: float = 100.0
    wander: float = 0.0
    step: float = 0.0
    step_after: float = 0.0
    slew: float = 0.0
    slew_after: float = 0.0
    slew_s: float = 0.0
    reply: float = 0.0
    mode: str = "exact"

    def environment(self, library: Path) -> dict[str, str]:
        """Return the environment of a process with that clock."""
        now = time.perf_counter()
        values = {
            "OFFSET": self.offset,
            "PPM": self.ppm,
            "REF": now,
            "WANDER": self.wander,
            "STEP": self.step,
            "STEP_AT": now + self.step_after if self.step else 1e18,
            "SLEW": self.slew,
            "SLEW_AT": now + self.slew_after if self.slew else 1e18,
            "SLEW_S": self.slew_s,
            "REPLY": self.reply,
        }
        skew = {f"SKEW_{name}": f"{value:.9f}" for name, value in values.items()}
        return {**os.environ, "LD_PRELOAD": str(library), **skew}


@dataclass
class Lab:
    """Runs devices, a marker program and the recorder; ends them all."""

    folder: Path
    library: Path
    processes: list[subprocess.Popen[str]] = field(default_factory=list)

    @property
    def journal(self) -> Path:
        return self.folder / "ses-01_streams.xdf"

    def start(self, *command: str, env: dict[str, str] | None = None) -> subprocess.Popen[str]:
        process = subprocess.Popen([sys.executable, *command], env=env, encoding="utf-8")
        self.processes.append(process)
        return process

    def device(self, name: str, skew: Skew, **options: float) -> subprocess.Popen[str]:
        arguments = ["--name", name, "--mode", skew.mode]
        for option, value in options.items():
            arguments += [f"--{option.replace('_', '-')}", str(value)]
        return self.start(str(HERE / "device.py"), *arguments, env=skew.environment(self.library))

    def markers(self) -> subprocess.Popen[str]:
        return self.start(str(HERE / "markers.py"))

    def sender(
        self,
        name: str,
        kind: str,
        source_id: str,
        rate: float = 100.0,
        first: int = 0,
        channels: int = 2,
        form: str = "float32",
    ) -> subprocess.Popen[str]:
        script = str(HERE / "sender.py")
        return self.start(script, name, kind, source_id, str(rate), str(first), str(channels), form)

    def load(self) -> subprocess.Popen[str]:
        """Keep a core busy."""
        return self.start("-c", "while True: sum(range(20000))")

    def recorder(self, *streams: dict[str, object], **orders: object) -> subprocess.Popen[str]:
        told = {"journal": str(self.journal), "streams": list(streams), **orders}
        process = subprocess.Popen(
            [sys.executable, "-m", "labcrane.streams.recorder.process", json.dumps(told)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            encoding="utf-8",
        )
        self.processes.append(process)
        return process

    def streams(self) -> dict[str, RecordedStream]:
        found, _ = read_streams(parts(self.journal))
        return {stream.header.name: stream for stream in found}

    def close(self) -> None:
        for process in self.processes:
            process.kill()
        for process in self.processes:
            process.wait()
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    pipe.close()


def until(recorder: subprocess.Popen[str], holds, wait_s: float = 240.0) -> dict:
    """Read the recorder's status until something holds of it."""
    deadline = time.monotonic() + wait_s
    status = None
    while time.monotonic() < deadline:
        line = recorder.stdout.readline()
        assert line, f"the recorder has ended, with status {recorder.wait()}"
        status = json.loads(line)
        if holds(status):
            return status
    raise AssertionError(f"still not so after {wait_s} s: {status}")


def until_ready(recorder: subprocess.Popen[str]) -> dict:
    """Read the recorder's status until all that is required flows."""
    return until(recorder, lambda status: status["ready"])


def stop(recorder: subprocess.Popen[str]) -> int:
    recorder.stdin.write("stop\n")
    recorder.stdin.flush()
    recorder.stdout.read()
    return recorder.wait(240)


def truth(stream: RecordedStream) -> np.ndarray:
    """Return the true times that a stream carries."""
    if stream.texts:
        return np.array([json.loads(text)["truth"] for (text,) in stream.texts])
    return stream.data[:, 0]


def alignment(true_samples, samples, true_markers, markers):
    """Return how far markers lie from where they should among samples, in seconds.

    The first five seconds are left out, as in the figures it is compared with.
    """
    inside = (true_markers > true_samples[0] + 5.0) & (true_markers < true_samples[-1] - 1.0)
    return np.interp(true_markers[inside], true_samples, samples) - markers[inside]


def as_labrecorder(stream: RecordedStream, path: Path, every_s: float = 5.0) -> dict:
    """Return what pyxdf makes of a stream had LabRecorder recorded it.

    LabRecorder asks every five seconds for the offset, and pairs what it is told, however old, with
    the time of asking.
    """
    told, offsets = stream.probes[:, 3], stream.probes[:, 1]
    with XdfWriter(path) as writer:
        number = writer.add_stream(stream.header)
        if stream.texts:
            writer.write_texts(number, stream.time_raw, stream.texts)
        else:
            writer.write_samples(number, stream.time_raw, stream.data)
        for now in np.arange(told[0], told[-1], every_s):
            offset = float(offsets[np.searchsorted(told, now, side="right") - 1])
            writer.write_offset(number, now - offset, offset)
    return load(path)[stream.header.name]


def load(path: Path, **how: bool) -> dict:
    """Return the streams that pyxdf reads, by name."""
    streams, _ = pyxdf.load_xdf(path, **how)
    return {one["info"]["name"][0]: one for one in streams}
