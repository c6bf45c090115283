"""The tone as feedback."""

import math
import wave
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel

from labcrane import Feedback, FloatArray, Frame, Run, Signal
from labcrane.core import ByEstimate, Following, SessionState, Value
from labcrane_sonification import real_time
from labcrane_sonification.settings import SonificationSettings
from labcrane_sonification.synth import Synth, offline_server, server
from labcrane_sonification.tone import Tone, tone
from labcrane_sonification.underruns import Underruns

Maker = Callable[[SonificationSettings], Any]
"""Makes a sound server."""

LIVE = ("far", "pitch_hz", "level", "loudness", "aside", "pan", "silent_after_s", "ramp_s")
"""Settings that can change while the sound server runs: a server that is closed and opened again is
silent for seconds."""


class Sonification(Feedback):
    """Follows the distance of tip and target with a tone.

    Parameters
    ----------
    make_server
        Makes the sound server; offline rendering gives another one.
    """

    signals: tuple[Signal, ...] = (
        Signal("tone.pitch", "Hz"),
        Signal("tone.overtones", "1"),
        Signal("tone.level", "1"),
        Signal("tone.pan", "1"),
        Signal("tone.sample", "1"),  # made by the server when the change was given
        Signal("tone.missed", "1"),  # blocks that JACK was not given in time, since it is open
    )

    def __init__(self, settings: SonificationSettings, make_server: Maker = server) -> None:
        self._settings = settings
        self._loudness = Following(settings.loudness)
        self.signals = (*self.signals, *self._loudness.signals("tone.loudness"))
        self._make_server = make_server
        self._synth: Synth | None = None
        self._underruns: Underruns | None = None
        self._scheduling = "ordinary"
        self._trial = 0
        self._entered: float | None = None

    @property
    def synth(self) -> Synth:
        """What makes the sound, once it is open."""
        if self._synth is None:
            raise AssertionError("the tone is opened before it sounds")
        return self._synth

    def open(self, run: Run) -> None:
        self._tip = run.state.find("tip.position")
        self._target = run.task.find("target.position")
        self._radius = run.task.find("target.radius")
        stimulus = self._settings.stimulus
        self._stimulus = None if stimulus is None else run.task.index(stimulus)
        self._loudness.open(run.axes)
        made, by_jack = self._make_server(self._settings), self._settings.driver == "jack"
        live = by_jack and self._make_server is server
        self._scheduling = real_time.follow() if live else "ordinary"
        self._synth = Synth(made, self._settings)
        # Other drivers ask for several blocks at a time, which does not say when each is due.
        self._underruns = Underruns(self._settings.block / self._settings.rate_hz) if live else None
        if self._underruns is not None:
            self._synth.at_every_block(self._underruns.begun)

    def close(self) -> None:
        if self._synth is not None:
            self._synth.close()
            self._synth = None
        if self._scheduling == "real time":  # until here: closing keeps Python's lock for a while
            real_time.unfollow()
            self._scheduling = "ordinary"

    def adjust(self, settings: BaseModel) -> bool:
        if not isinstance(settings, SonificationSettings) or self._synth is None:
            return False
        before, now = (each.model_dump(exclude=set(LIVE)) for each in (self._settings, settings))
        if before != now:
            return False
        self._settings = settings
        if not isinstance(settings.loudness, ByEstimate):
            self._loudness = Following(settings.loudness)
        self._synth.ramp(settings.ramp_s)
        return True

    def update(self, situation: SessionState) -> None:
        if situation.trial != self._trial:
            self._trial, self._entered = situation.trial, None

    def present(self, frame: Frame) -> FloatArray:
        now, loudness = self.tone(frame), self._loudness.shown(frame)
        if now is None:
            self.idle()
            return np.array([math.nan, math.nan, 0.0, math.nan, *self._beside()])
        now = replace(now, level=loudness * now.level)
        self.synth.sound(now)
        return np.array([*now.values, *self._beside()])

    def tone(self, frame: Frame) -> Tone | None:
        """Return the tone for a frame that follows those presented; None without a target."""
        if self._stimulus is not None:
            at_target = tone(self._settings, 0.0, 0.0, 0.0)
            return at_target if frame.task[self._stimulus] > 0.0 else None
        way = frame.task[self._target] - frame.state[self._tip]
        distance = float(np.linalg.norm(way))
        if math.isnan(distance):
            self._entered = None
            return None
        inside = distance <= float(frame.task[self._radius][0])
        if not inside:
            self._entered = None
        elif self._entered is None:
            self._entered = frame.tick.due
        inside_s = 0.0 if self._entered is None else frame.tick.due - self._entered
        if frame.paused:
            return Tone(self._settings.pitch_hz[0], 0.0, 0.0, 0.0)
        # A moment before the tip has been inside for long enough it still sounds.
        return tone(self._settings, distance, float(way[1]), inside_s if inside else 0.0)

    def preview(self, run: Run, frames: Sequence[Frame], path: Path) -> Sequence[Path]:
        file = path.with_suffix(".wav")
        offline = Sonification(self._settings, offline_server)
        offline.open(run)
        try:
            write_wav(file, offline.rendered(frames), self._settings.rate_hz)
        finally:
            offline.close()
        return [file]

    def rendered(self, frames: Sequence[Frame]) -> npt.NDArray[np.float32]:
        """Return the sound of consecutive frames, shape ``(n_samples, 2)``.

        Needs an offline server. Each block sounds like the newest frame at its start.
        """
        dues = [frame.tick.due for frame in frames]
        step = self._settings.block / self._settings.rate_hz
        blocks = []
        for time in np.arange(dues[0], dues[-1], step):
            frame = frames[int(np.searchsorted(dues, time, side="right")) - 1]
            self.present(frame)
            blocks.append(self.synth.block())
        return np.concatenate(blocks)

    def idle(self) -> None:
        self.synth.silence()

    def metadata(self) -> Mapping[str, Value]:
        return {
            "driver": self._settings.driver,
            "rate_hz": self._settings.rate_hz,
            "block": self._settings.block,
            "scheduling": self._scheduling,
            "delay": "not measured",
        }

    def _beside(self) -> tuple[float, ...]:
        """Return how many samples were made, how many blocks were missed, and the loudness."""
        missed = math.nan if self._underruns is None else float(self._underruns.missed)
        made = float(self.synth.server.getCurrentTimeInSamples())
        return made, missed, *self._loudness.recorded


def write_wav(path: Path, sound: npt.NDArray[np.float32], rate_hz: int) -> None:
    """Write a sound between -1 and 1, shape ``(n_samples, n_channels)``, with 16 bits a sample."""
    with wave.open(str(path), "wb") as file:
        file.setnchannels(sound.shape[1])
        file.setsampwidth(2)
        file.setframerate(rate_hz)
        file.writeframes(np.round(32767.0 * sound).astype("<i2").tobytes())
