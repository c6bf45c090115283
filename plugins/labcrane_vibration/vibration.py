"""The vibration as feedback."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from labcrane import DeviceError, Feedback, FloatArray, Frame, Run, Signal
from labcrane.core import ByEstimate, Following, SessionState, Value
from labcrane_vibration.device import Device, opened
from labcrane_vibration.law import ON, shares, strength
from labcrane_vibration.settings import VibrationSettings

LIVE = ("far", "amplitude", "intensity", "pulse_hz", "aside", "silent_after_s")
"""Settings that can change while the device is open."""

ANSWER, ANSWERS = (
    "answer",
    (Signal("command", "1"), Signal("delay", "s"), Signal("device.time", "s")),
)


class Vibration(Feedback):
    """Follows the distance and direction of the target with tactors.

    The device was not tried with real tactors or a real controller.

    Parameters
    ----------
    open_device
        Opens the device; a preview gives another one.
    """

    def __init__(
        self,
        settings: VibrationSettings,
        open_device: Callable[[VibrationSettings], Device] = opened,
    ) -> None:
        self._intensity = Following(settings.intensity)
        self.signals = (
            Signal("vibration.amplitude", "1"),
            Signal("vibration.pulse", "Hz"),
            Signal("vibration.level", "1", tuple(settings.tactors)),
            Signal("vibration.command", "1"),  # number of the last command, as in its answer
            Signal("vibration.given", "s"),  # time with vibration so far
            *self._intensity.signals("vibration.intensity"),
        )
        if settings.driver != "rumble":  # a controller does not answer
            self.streams = {ANSWER: ANSWERS}
        self._settings = settings
        self._open_device = open_device
        self._device: Device | None = None
        self._given: float | None = None
        self._trial = 0
        self._forget()

    def _forget(self) -> None:
        """Begin again, with the first half of a pulse."""
        self._entered: float | None = None
        self._last: float | None = None
        self._cycles = 0.0

    def open(self, run: Run) -> None:
        self._tip = run.state.find("tip.position")
        self._target = run.task.find("target.position")
        self._radius = run.task.index("target.radius")
        stimulus = self._settings.stimulus
        self._stimulus = None if stimulus is None else run.task.index(stimulus)
        self._intensity.open(run.axes)
        self._rate = run.rate_hz
        self._given = None
        self._trial = 0
        self._forget()
        self._device = self._open_device(self._settings)

    def close(self) -> None:
        if self._device is not None:
            self._device.close()
            self._device = None

    def adjust(self, settings: BaseModel) -> bool:
        if not isinstance(settings, VibrationSettings) or self._device is None:
            return False
        before, now = (each.model_dump(exclude=set(LIVE)) for each in (self._settings, settings))
        if before != now:
            return False
        self._settings = settings
        if not isinstance(settings.intensity, ByEstimate):
            self._intensity = Following(settings.intensity)
        return True

    def update(self, situation: SessionState) -> None:
        if situation.trial != self._trial:
            self._trial, self._entered = situation.trial, None

    def present(self, frame: Frame) -> FloatArray:
        device = self._open()
        amplitude, pulse, wanted = self._felt(frame)
        part = self._intensity.shown(frame)
        self._count(frame, device)
        device.set(tuple(part * level for level in wanted))
        felt = (part * amplitude, pulse, *device.levels, device.number, self._given)
        return np.array([*felt, *self._intensity.recorded])

    def samples(self) -> Mapping[str, FloatArray]:
        found = np.array(self._open().answers()).reshape(-1, len(ANSWERS))
        return dict.fromkeys(self.streams, found)

    def idle(self) -> None:
        device = self._open()
        device.set((0.0,) * len(device.levels))
        self._forget()

    def preview(self, run: Run, frames: Sequence[Frame], path: Path) -> Sequence[Path]:
        from matplotlib.figure import Figure  # noqa: PLC0415 - loads for a second

        file = path.with_suffix(".png")
        felt = Vibration(self._settings, lambda settings: Preview(len(settings.tactors), "none"))
        felt.open(run)
        rows = [felt._felt(frame)[2] for frame in frames]
        start = frames[0].tick.due
        figure = Figure((8.0, 3.0), layout="constrained")
        axes = figure.subplots()
        for name, levels in zip(self._settings.tactors, np.transpose(rows), strict=True):
            axes.step([frame.tick.due - start for frame in frames], levels, label=name)
        axes.set(xlabel="time in s", ylabel="amplitude", ylim=(0.0, 1.0))
        axes.legend(loc="upper left")
        figure.savefig(file)
        return [file]

    def metadata(self) -> Mapping[str, Value]:
        name = self._device.name if self._device else "not open"
        return {
            "driver": self._settings.driver,
            "device": name,
            "tactors": len(self._settings.tactors),
            "delay": "not measured",
            "tried": "not with a real device",
        }

    def _open(self) -> Device:
        if self._device is None:
            raise AssertionError("the device is opened before it vibrates")
        return self._device

    def _felt(self, frame: Frame) -> tuple[float, float, tuple[float, ...]]:
        """Return amplitude, pulses per second and each tactor's level, for the next frame."""
        if self._stimulus is not None:
            on = self._settings.amplitude[1] * float(frame.task[self._stimulus] > 0.0)
            return on, math.nan, (on,) * len(self._settings.tactors)
        way = frame.task[self._target] - frame.state[self._tip]
        distance, now = float(np.linalg.norm(way)), frame.tick.due
        passed = 0.0 if self._last is None else now - self._last
        self._last = now
        still = (0.0,) * len(self._settings.tactors)
        if frame.paused or math.isnan(distance):
            self._entered, self._cycles = None, 0.0
            return 0.0, math.nan, still
        if distance > float(frame.task[self._radius]):
            self._entered = None
        elif self._entered is None:
            self._entered = now
        inside_s = 0.0 if self._entered is None else now - self._entered
        amplitude, pulse = strength(self._settings, distance, inside_s)
        self._cycles += pulse * passed
        if self._cycles % 1.0 >= ON:
            return amplitude, pulse, still
        of_each = shares(self._settings, float(way[0]), float(way[1]))
        return amplitude, pulse, tuple(amplitude * share for share in of_each)

    def _count(self, frame: Frame, device: Device) -> None:
        """Count the time with vibration; raises :class:`DeviceError` above the limit.

        What was given before this process began is not known: it counts as all of the session.
        """
        if self._given is None:
            self._given, self._counted = frame.tick.number / self._rate, frame.tick.due
        if any(device.levels):
            self._given += frame.tick.due - self._counted
        self._counted = frame.tick.due
        if self._given > 60.0 * self._settings.minutes:
            device.set((0.0,) * len(device.levels))
            raise DeviceError(
                f"the participant was given {self._settings.minutes:g} minutes of vibration in "
                "this session, which is the limit (after a restart, the whole time before it "
                "counts); go on without it, or set minutes: for the next session"
            )


class Preview(Device):
    """A device that is not there."""

    def send(self, levels: Sequence[int]) -> None:
        pass
