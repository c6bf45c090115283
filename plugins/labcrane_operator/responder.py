"""Responses of a simulated operator to the stimuli of a secondary task."""

import math

import numpy as np

from labcrane import Frame
from labcrane_operator.settings import ResponseSettings

SALT = 488
"""Keeps the responses apart from all else that is drawn from a trial's seed."""


class Responder:
    """Notices stimuli and presses, later and less often the further the hands are deflected.

    Parameters
    ----------
    stimulus
        Place of the stimulus among the task's values.
    hands
        Places of the axes that steer.
    """

    def __init__(
        self, settings: ResponseSettings, stimulus: int, hands: list[int], rate_hz: float
    ) -> None:
        self._settings, self._stimulus, self._hands = settings, stimulus, hands
        self._rate_hz = rate_hz
        self._random = np.random.default_rng(SALT)
        self._on = False
        self._press = (0, -1)  # first tick and the one after the last

    def begin_trial(self, seed: int) -> None:
        """Draw from another trial's seed; a response under way goes on."""
        self._random = np.random.default_rng([seed, SALT])

    def pressing(self, seen: Frame) -> bool:
        """Whether the button is pressed after a frame was seen."""
        settings, tick = self._settings, seen.tick.number
        before, self._on = self._on, bool(seen.task[self._stimulus] > 0.0)
        if self._on and not before:
            load = float(np.abs(seen.axes[self._hands]).mean())
            more = 1.0 + settings.load * load
            noticed, z = self._random.random(), self._random.standard_normal()
            if noticed >= settings.lapse_rate * more:
                seconds = settings.median_s * math.exp(settings.sd * z) * more
                first = tick + max(1, round(seconds * self._rate_hz))
                self._press = (first, first + round(settings.press_s * self._rate_hz))
        return self._press[0] <= tick + 1 < self._press[1]
