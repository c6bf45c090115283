"""The process of one recording: a camera, a microphone or a screen.

It is started by a :class:`labcrane.processes.handle.ProcessHandle` with a
:class:`labcrane.session.part.PartConfig` and ends when its parent does. Its frames are listed
in a stream, which the session's recorders take. It reports the stream (``sends``), the file that
was begun (``file``), the dropped frames (``missed``, which is its beat as well), and the reason
for which it ends (``failed``).
"""

import itertools
import math
import shutil
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from labcrane.core.records import Captured
from labcrane.core.roles import Capture
from labcrane.errors import LabcraneError
from labcrane.processes.parent import Parent, serve
from labcrane.recording.paths import captured_file
from labcrane.recording.pictures import CAPTURED, CHANNELS
from labcrane.session.part import PartConfig
from labcrane.streams.outlets import SampleOutlet, channel, check_clock, stream_info

BEAT_S = 0.5
TAKEN_S = 45.0
"""How long the recorder may take to receive the stream."""

SPARE_BYTES = 200e6
"""A recording leaves so much of the disk: a session without pictures can go on, one without room
for its own record cannot."""

DELIVERY_S = 0.3
"""How long the recorders are left to begin, and to take what was sent last."""


def run(config: PartConfig, parent: Parent) -> None:
    """Record until the parent is gone; raises what the recording raises."""
    study = config.load()
    recording = study.recordings[config.name].build(study.machine)
    assert isinstance(recording, Capture)  # noqa: S101 - an offer of this role
    recording.windows = {name: study.window_title(name) for name in study.protocol.views}
    check_clock()
    try:
        recording.begin()
        _follow(config, parent, recording)
    finally:
        recording.close()


def _follow(config: PartConfig, parent: Parent, recording: Capture) -> None:
    index = _Index(config, parent)
    settled = math.inf
    while time.monotonic() < settled and not parent.gone.is_set():
        recording.read()
        index.beat()
        if index.taken:  # a receiver counts before it receives
            settled = min(settled, time.monotonic() + DELIVERY_S)
    first, suffix = config.journal, recording.suffix
    files = ((at, captured_file(first, config.name, at, suffix)) for at in itertools.count(1))
    number, path = next((at, path) for at, path in files if not path.exists())
    _leave_room(path.parent)
    recording.write_to(path)
    parent.tell({"file": path.name})
    try:
        while not parent.gone.is_set():
            _leave_room(path.parent)
            index.push(number, recording.read())
    finally:
        index.push(number, recording.end())
        time.sleep(DELIVERY_S)


def _leave_room(folder: Path) -> None:
    free = shutil.disk_usage(folder).free
    if free < SPARE_BYTES:
        raise LabcraneError(
            f"only {free / 1e6:.0f} MB are free at {folder}, and a recording leaves "
            f"{SPARE_BYTES / 1e6:.0f} MB for the session itself; free some space"
        )


class _Index:
    """The stream that lists the frames."""

    def __init__(self, config: PartConfig, parent: Parent) -> None:
        info = stream_info(
            CAPTURED + config.name,
            "Capture",
            len(CHANNELS),
            "double64",
            rate_hz=0.0,
            source=config.source,
        )
        # As of any camera: frames may be missing.
        info.desc().child("synchronization").set_child_value("can_drop_samples", "true")
        for label, unit in CHANNELS.items():
            channel(info, label=label, unit=unit, type="Capture")
        self._outlet = SampleOutlet(info, len(CHANNELS))
        self._parent = parent
        self._last = -1
        self._missed = 0
        self._beaten = 0.0
        self._opened = time.monotonic()
        parent.tell({"sends": self._outlet.description})

    @property
    def taken(self) -> bool:
        """Whether the recorder receives it: samples without a receiver are lost."""
        if not self._outlet.taken and time.monotonic() - self._opened > TAKEN_S:
            raise LabcraneError(
                f"no recorder has received its list of frames for {TAKEN_S:g} s; labcrane doctor "
                "shows whether a firewall blocks this computer's own streams"
            )
        return self._outlet.taken

    def push(self, file: int, frames: Sequence[Captured]) -> None:
        for each in frames:
            self._missed += each.number - self._last - 1
            self._last = each.number
            row = (each.number, file, each.pts, each.clock, each.arrival, each.lag)
            self._outlet.push(np.array(row, np.float64), each.time)
        self.beat()

    def beat(self) -> None:
        if (now := time.monotonic()) - self._beaten >= BEAT_S:
            self._beaten = now
            self._parent.tell({"missed": self._missed})


if __name__ == "__main__":
    sys.exit(serve(run))
