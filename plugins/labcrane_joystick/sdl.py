"""SDL in a process that has no window: joysticks, and nothing else."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from labcrane import DeviceError

ENVIRONMENT = {
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",
    # Events need a video system; this one has no window that could lose the focus.
    "SDL_VIDEODRIVER": "dummy",
    # If the user chose another video driver after all, sticks must be heard without focus.
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",
    # SDL would turn SIGTERM into an event, and the process could not be ended.
    "SDL_NO_SIGNAL_HANDLERS": "1",
}
"""Variables that SDL and pygame read at their start. The user's values take precedence."""


def start() -> None:
    """Start SDL, and let through only the events of sticks that come and go.

    Axis events are blocked: 65535 of them fit the queue, then SDL drops all kinds.
    """
    with _environment():
        import pygame  # noqa: PLC0415 - heavy, and reads the environment

        try:
            pygame.display.init()
            pygame.joystick.init()
        except pygame.error as error:
            raise DeviceError(
                f"SDL does not start: {error}; the video driver is "
                f"{os.environ['SDL_VIDEODRIVER']!r}, and 'dummy' is enough: unset SDL_VIDEODRIVER"
            ) from error
    pygame.event.set_blocked(None)
    pygame.event.set_allowed((pygame.JOYDEVICEADDED, pygame.JOYDEVICEREMOVED))
    pygame.event.clear()


def stop() -> None:
    """Let go of every stick, and end SDL."""
    import pygame  # noqa: PLC0415 - see start

    pygame.joystick.quit()
    pygame.display.quit()


@contextmanager
def _environment() -> Iterator[None]:
    """Set what the user has not set, and take it back: other processes inherit none of it."""
    unset = {name: value for name, value in ENVIRONMENT.items() if name not in os.environ}
    os.environ.update(unset)
    try:
        yield
    finally:
        for name in unset:
            del os.environ[name]
