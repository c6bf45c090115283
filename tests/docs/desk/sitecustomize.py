"""Two sticks at the desk of every Python that has this folder in ``PYTHONPATH``.

``HANDS`` names a pipe; each line of it moves a stick: ``left 0 32000`` an axis, ``right trigger 1``
the trigger. A process has sticks from when it first starts SDL, which only those do that look for
some.
"""

import os
import sys
import threading
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2] / "helpers"))

from labcrane_joystick import sdl

START = sdl.start
SIDES = ("left", "right")


def start() -> None:
    """Start SDL, with two sticks plugged in."""
    START()
    if sdl.start is not start:
        return
    sdl.start = START  # once: sticks stay when the device that found them is closed
    from virtual_sticks import SDL_INIT_JOYSTICK, VirtualStick, _mapped_sdl

    library = _mapped_sdl()
    library.SDL_InitSubSystem(SDL_INIT_JOYSTICK)
    sticks = {side: VirtualStick(library) for side in SIDES}
    threading.Thread(target=follow, args=(sticks,), daemon=True).start()


def follow(sticks) -> None:
    """Move the sticks as the pipe says, for as long as there are any."""
    # For writing as well, so that the pipe does not end with the person's last movement.
    with open(os.open(os.environ["HANDS"], os.O_RDWR), encoding="ascii") as pipe:  # noqa: PTH123
        for line in pipe:
            side, what, much = line.split()
            try:
                if what == "trigger":
                    sticks[side].press(down=much == "1")
                else:
                    sticks[side].move(int(what), int(much))
            except OSError:  # the program is at its end and has let go of SDL
                return


sdl.start = start
