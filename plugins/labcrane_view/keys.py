"""Keys that are down while the window has the focus."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from panda3d import core

from labcrane import DeviceError, FloatArray, ProtocolError

DOWN, UP = "labcrane-down", "labcrane-up"


class Keys:
    """Watches a window's keys.

    A window that loses the focus lets go of all of them, so that none stays down for ever.
    """

    def __init__(self, names: Sequence[str]) -> None:
        registry = core.ButtonRegistry.ptr()
        for name in names:
            if registry.find_button(name) == core.ButtonHandle.none():
                raise ProtocolError(
                    f"there is no key {name!r}; keys are single letters and digits, arrow_left, "
                    "arrow_up, space, enter, lshift, f1 and so on"
                )
        self._places = {name: place for place, name in enumerate(names)}
        self._state = np.zeros(len(names))

    def open(self, output: Any) -> None:
        """Watch a window's keys; a hidden picture has none."""
        if not isinstance(output, core.GraphicsWindow):
            raise DeviceError("keys need a window, and display: hidden has none; leave keys out")
        self._graph = core.NodePath("keys")
        board = self._graph.attach_new_node(core.MouseAndKeyboard(output, 0, "keyboard"))
        thrower = core.ButtonThrower("keys")
        thrower.set_button_down_event(DOWN)
        thrower.set_button_up_event(UP)
        board.attach_new_node(thrower)
        self._walk = core.DataGraphTraverser()
        self._events = core.EventQueue.get_global_event_queue()

    def rows(self) -> FloatArray:
        """Return the keys' states after every change since the last call, and as they are now.

        Returns
        -------
        numpy.ndarray
            1 for a key that is down, shape ``(n_changes + 1, n_keys)``.
        """
        self._walk.traverse(self._graph.node())
        rows = []
        while not self._events.is_queue_empty():
            event = self._events.dequeue_event()
            if event.get_name() not in {DOWN, UP}:
                continue
            place = self._places.get(event.get_parameter(0).get_string_value())
            if place is not None:
                self._state[place] = float(event.get_name() == DOWN)
                rows.append(self._state.copy())
        return np.array([*rows, self._state])
