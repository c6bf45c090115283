"""Gaze and pupils of an eye tracker."""

import numpy as np

from labcrane import FloatArray
from labcrane.core import SHARES, Eye, SignalFault, SignalStream, eyes_of, is_pupil
from labcrane_signals.settings import GazeSettings
from labcrane_signals.windows import WindowedMonitor

MILLIMETRES = {
    "mm": 1.0,
    "millimeter": 1.0,
    "millimeters": 1.0,
    "millimetres": 1.0,
    "m": 1e3,
    "meter": 1e3,
    "meters": 1e3,
    "metres": 1e3,
}
PIXELS = frozenset({"pixel", "pixels", "px"})

PUPIL_MM = (1.2, 9.5)
"""Range of pupil diameters; 2 to 8 mm in room light (Watson and Yellott 2012, Journal of Vision
12(10), 12)."""

PUPIL_UNIT_MM = (0.05, 40.0)
"""Range of pupil diameters; a value outside means that the unit is wrong."""

JUMP_MM = 1.0
"""Change between samples that a pupil does not make; the edge of a blink sometimes does."""

LOST = 0.8
"""Fraction of a window without gaze: a blink takes 0.15 to 0.4 s."""

NEED = {"gaze lost": 5, "pupil implausible": 6, "wrong unit": 6}

ADVICE = {
    "gaze lost": "no gaze for {lost:.0f} % of the last second: check the headset's fit, and "
    "calibrate again",
    "pupil implausible": "{pupil}: calibrate again, and check the eye camera's picture",
    "wrong unit": "{middle:.3g} cannot be in {unit}: correct the unit in the eye tracker's program",
}


class GazeMonitor(WindowedMonitor):
    """Tells lost gaze, implausible pupils, and a wrong unit."""

    def __init__(self, settings: GazeSettings) -> None:
        self._settings = settings

    def knows(self, stream: SignalStream) -> bool:
        return (
            stream.type.lower() == "gaze" and stream.rate_hz > 0 and bool(eyes_of(stream.channels))
        )

    def begin(self, stream: SignalStream) -> None:
        self.watch(stream, range(len(stream.channels)), NEED)
        self._units = [channel.unit.strip().lower() for channel in stream.channels]
        self._eyes = eyes_of(stream.channels)
        self._pupils = [at for at, channel in enumerate(stream.channels) if is_pupil(channel)]

    def _judge(self, window: FloatArray) -> list[SignalFault]:
        count = window.shape[1]
        bad = {kind: np.zeros(count, dtype=np.bool_) for kind in NEED}
        text: dict[tuple[str, int], str] = {}
        for eye in self._eyes:
            x = eye.x
            lost, middle = self._gaze(window, eye)
            bad["gaze lost"][x] = lost > LOST
            text["gaze lost", x] = ADVICE["gaze lost"].format(lost=100.0 * lost)
            bad["wrong unit"][x] = self._wrong(x, middle)
            unit = self._units[x] or "its unit"
            text["wrong unit", x] = ADVICE["wrong unit"].format(middle=middle, unit=unit)
        for at in self._pupils:
            wrong, odd, middle = self._pupil(window[:, at], self._units[at])
            bad["wrong unit"][at] = wrong
            bad["pupil implausible"][at] = bool(odd)
            unit = self._units[at] or "mm"
            text["wrong unit", at] = ADVICE["wrong unit"].format(middle=middle, unit=unit)
            text["pupil implausible", at] = ADVICE["pupil implausible"].format(
                pupil=odd or "was implausible"
            )
        return [
            SignalFault(self._labels[at], kind, text[kind, int(at)])
            for kind, now in bad.items()
            for at in np.flatnonzero(self._streaks[kind].add(now))
        ]

    def _gaze(self, window: FloatArray, eye: Eye) -> tuple[float, float]:
        """Return the share of a window without gaze, and the middle of what gaze there is."""
        across, down = window[:, eye.x], window[:, eye.y]
        none = ~eye.seen(window, self._settings.confidence)
        seen = across[~none]
        frozen = len(seen) > 1 and bool(
            (seen == seen[0]).all() and (down[~none] == down[~none][0]).all()
        )
        share = 1.0 if frozen else float(none.mean())
        return share, float(np.median(np.abs(seen))) if len(seen) else float("nan")

    def _wrong(self, x: int, middle: float) -> bool:
        """Whether positions cannot be in the unit that the header states."""
        if self._units[x] in SHARES:
            return middle >= 5.0  # noqa: PLR2004 - five screens away
        return self._units[x] in PIXELS and middle < 2.0  # noqa: PLR2004 - all in one corner

    def _pupil(self, pupil: FloatArray, unit: str) -> tuple[bool, str, float]:
        """Return whether a pupil's unit is wrong, what else is, and its middle."""
        seen = pupil[np.isfinite(pupil) & (pupil > 0.0)]
        if len(seen) < max(2.0, 0.2 * len(pupil)):  # it is the gaze that is lost
            return False, "", float("nan")
        middle = float(np.median(seen))
        factor = MILLIMETRES.get(unit or "mm")
        if factor is None:  # in pixels of the eye's camera: any size may be right
            same = bool((seen == seen[0]).all())
            return False, "does not change at all" if same else "", middle
        size = middle * factor
        if not PUPIL_UNIT_MM[0] <= size <= PUPIL_UNIT_MM[1]:
            return True, "", middle
        if not PUPIL_MM[0] <= size <= PUPIL_MM[1]:
            return False, f"{size:.1f} mm wide", middle
        if (seen == seen[0]).all():
            return False, "does not change at all", middle
        jumps = float((np.abs(np.diff(seen)) * factor > JUMP_MM).mean())
        return False, f"jumps in {100.0 * jumps:.0f} % of samples" if jumps > 0.15 else "", middle  # noqa: PLR2004
