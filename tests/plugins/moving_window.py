"""Two views with windows of their own, in which the crane turns until the input is closed.

With a fourth argument there is no back buffer, as the windows of before had none.

Prints what a whole picture holds of each of their colours, as counted in the picture itself.
"""

import json
import math
import sys
import threading

from plugins.whole_picture import counted
from windows import MACHINE, POSE, a_scene, make_frame

from labcrane.core import SessionState
from labcrane.testing import crane_at
from labcrane_view.screen import window
from labcrane_view.settings import ViewSettings
from labcrane_view.view import View

renderer, name, title, *bare = sys.argv[1:]
if bare:
    window.BACK_BUFFERS = 0
before = [ViewSettings(size=(480, 320))] if name == "examiner" else []
settings = ViewSettings(size=(480, 320), renderer=renderer, camera="free", seen_by=name, shadow=0)
view = View(settings, MACHINE)
view.title, view.before = title, before
view.open(a_scene())
view.update(SessionState(step=1, kind="block", block=1, block_name="first", trial=3, trials=9))


def show(number: int) -> None:
    frame = make_frame(number)
    frame.trial = 3
    frame.state = crane_at(MACHINE, (0.35 * math.sin(number / 15.0), *POSE[1:]))
    view.present(frame)


least: dict[str, int] = {}
for number in range(25):
    show(number)
    for colour, count in counted(view.picture()).items():
        least[colour] = min(count, least.get(colour, count))
sys.stdout.write(json.dumps(least) + "\n")
sys.stdout.flush()
over = threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), over.set()), daemon=True).start()
number = 0
while not over.is_set():
    number += 1
    show(number)
view.close()
