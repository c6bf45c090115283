"""my_part: something the operator sees in every view."""

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field, PositiveFloat

from labcrane import Cue, FloatArray, Frame, Offer, Run, Settings, Signal, hookimpl, offer
from labcrane.core import Cylinder, Shape

labcrane_api = 1

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class MyPartSettings(Settings):
    """Settings of my_part; a protocol writes them next to ``use``."""

    radius: PositiveFloat = 0.03
    """Of the line, in metres."""

    colour: tuple[Share, Share, Share] = (1.0, 0.8, 0.1)
    """Red, green and blue, each 0 to 1."""

    def reveals(self) -> tuple[str, ...]:
        # Facts about the task's error that it shows: `labcrane check` asks who gets it. () for none
        return ("how far the tip is from the target", "where the target is")


class MyPart(Cue):
    """A line from the tip to the target."""

    # The numbers behind the picture; recorded with every frame shown.
    signals = (Signal("length", "m"),)

    def __init__(self, settings: MyPartSettings) -> None:
        self._settings = settings

    def open(self, run: Run) -> None:
        self._tip = run.state.find("tip.position")
        self._target = run.task.find("target.position")

    def draw(self, frame: Frame) -> Sequence[Shape]:
        x, y, z = frame.task[self._target].tolist()
        if math.isnan(x):  # between trials there is no target
            return ()
        tip_x, tip_y, tip_z = frame.state[self._tip].tolist()
        colour = (*self._settings.colour, 1.0)
        return (
            Cylinder("my_part", (tip_x, tip_y, tip_z), (x, y, z), self._settings.radius, colour),
        )

    def values(self, frame: Frame) -> FloatArray:
        return np.array([np.linalg.norm(frame.task[self._target] - frame.state[self._tip])])


@hookimpl
def labcrane_cues() -> list[Offer[Cue]]:
    return [offer("my_part", MyPartSettings, MyPart)]
