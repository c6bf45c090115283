"""Axes of a panel in each tick, live or replayed."""

from collections.abc import Sequence

import numpy as np

from labcrane import FloatArray, Machine, ProtocolError, Signal
from labcrane_can.avc import FULL
from labcrane_can.settings import ValveMap


class PanelAxes:
    """One array that is refilled on every tick.

    Attributes
    ----------
    signals
        Each joint's signal as a share of full, whether it floats, and whether the panel is there.
    """

    def __init__(self, settings: ValveMap, machine: Machine) -> None:
        for joint in settings.valves:
            if joint not in machine.names:
                raise ProtocolError(
                    f"valves names joint {joint!r}; the machine has {', '.join(machine.names)}"
                )
        joints = tuple(settings.valves)
        self.signals = (
            Signal("valve", "1", joints),
            Signal("float", "1", joints),
            Signal("panel.connected", "1"),
        )
        self._joints = len(joints)
        self._values = np.zeros(2 * self._joints + 1)

    def given(self, signals: Sequence[float], floats: Sequence[bool]) -> FloatArray:
        """Return what the panel asks for; signals are -250 to 250."""
        self._values[: self._joints] = [signal / FULL for signal in signals]
        self._values[self._joints : -1] = floats
        self._values[-1] = 1.0
        return self._values

    def lost(self) -> FloatArray:
        """Return every valve shut, and no panel."""
        self._values[:] = 0.0
        return self._values
