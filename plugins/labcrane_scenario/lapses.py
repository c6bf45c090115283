"""Lapses of a simulated operator: when it bumps and presses on."""

import numpy as np

from labcrane_scenario.settings import ErrorSettings

SECONDS = 60.0


class Lapses:
    """Draws one trial's lapses, tick by tick; the same seeds and frames, the same lapses.

    Parameters
    ----------
    seeds
        Of the participant and of the trial.

    Attributes
    ----------
    overlooks, imagines
        Whether it sees no deformity in this trial, and whether it sees one where there is none.
    """

    def __init__(self, settings: ErrorSettings, rate_hz: float, seeds: tuple[int, int]) -> None:
        self._settings = settings
        self._dt = 1.0 / rate_hz
        self._random = np.random.default_rng([*seeds, 0xE44])
        self._bump = round(settings.bump_s * rate_hz)
        self._press = round(settings.over_grip_s * rate_hz)
        self._bump_left = self._press_left = 0  # ticks
        self._held = False
        looks = np.random.default_rng([*seeds, 0x5EE])
        self.overlooks = bool(looks.random() < settings.misses)
        self.imagines = bool(looks.random() < settings.false_reports)

    def sinks(self) -> float:
        """Take a tick in which the arm is moved; return how fast it is let sink, in m/s."""
        rate = self._settings.bumps_per_min / SECONDS
        if self._random.random() < rate * self._dt and self._bump_left == 0:
            self._bump_left = self._bump
        if self._bump_left == 0:
            return 0.0
        self._bump_left -= 1
        return self._settings.bump_m_s

    def presses_on(self, *, held: bool) -> bool:
        """Take whether something is in the grip; return whether the jaws go on to be shut."""
        if held and not self._held and self._random.random() < self._settings.over_grip:
            self._press_left = self._press
        self._held = held
        if not held or self._press_left == 0:
            return False
        self._press_left -= 1
        return True
