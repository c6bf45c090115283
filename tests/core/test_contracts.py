"""Contract tests take what the documentation allows, and answer in words."""

import types
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from labcrane import Cue, Frame, Run, Settings, offer
from labcrane.core import Sphere
from labcrane.core.primitives import Shape
from labcrane.testing import CueContract, PluginContract


class Trail(Cue):
    """A cue of speed: a ball at the tip, the larger the faster; at rest there is none."""

    def open(self, run: Run) -> None:
        self._tip = run.state.find("tip.position")
        self._speed = run.state.find("tip.velocity")
        self._target = run.task.find("target.position")

    def draw(self, frame: Frame) -> Sequence[Shape]:
        speed = float(np.linalg.norm(frame.state[self._speed]))
        if speed == 0.0 or np.isnan(frame.task[self._target]).any():
            return ()
        return (Sphere("trail", tuple(frame.state[self._tip].tolist()), speed, (1, 1, 0, 1)),)


class Nothing(Trail):
    """A cue that forgets to draw."""

    def draw(self, frame: Frame) -> Sequence[Shape]:
        return ()


def said(check: Callable[[], None]) -> str:
    with pytest.raises(AssertionError) as raised:
        check()
    return str(raised.value)


def test_a_cue_of_speed_fulfils_its_contract() -> None:
    contract = CueContract()
    for name in dir(CueContract):
        if name.startswith("test_"):
            getattr(contract, name)(Trail())


def test_a_cue_that_draws_nothing_is_told_so() -> None:
    text = said(lambda: CueContract().test_cue_draws_shapes_with_names_of_their_own(Nothing()))
    assert "draw() returned no shape for a frame with a target" in text


class Bare(Settings):
    length: float = 1.0
    """In metres."""


def test_settings_without_a_docstring_are_told_what_to_write() -> None:
    Bare.__doc__ = None
    plugin = types.ModuleType("bare")
    plugin.labcrane_cues = lambda: [offer("bare", Bare, lambda settings, machine: Trail())]
    text = said(lambda: PluginContract().test_every_setting_says_what_it_means(plugin))
    assert text.startswith("Bare needs a docstring: write what 'bare' is, in a sentence, below ")
    assert "<class" not in text
