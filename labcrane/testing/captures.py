"""Contract of recordings: cameras, microphones, screens."""

import math
import os
import stat
import time
from pathlib import Path

import pytest

from labcrane.core.records import Captured
from labcrane.core.roles import Capture
from labcrane.errors import LabcraneError

LONGEST_S = 10.0
"""How long frames may take to be safe in the file."""


def _frames(capture: Capture, path: Path) -> list[Captured]:
    """Return the frames that are in the file first."""
    began = time.perf_counter()
    capture.write_to(path)
    while not (frames := [*capture.read()]):
        assert time.perf_counter() - began < LONGEST_S, (
            f"no frame was in the file within {LONGEST_S:g} s; write a second at a time"
        )
    return frames


class CaptureContract:
    """What every recording must do. Provide the fixture ``capture``: built, and not begun.

    Its device, or a stand-in for it, is there.
    """

    @pytest.fixture
    def capture(self) -> Capture:
        raise NotImplementedError

    def test_frames_are_returned_when_they_are_in_the_file(
        self, capture: Capture, tmp_path: Path
    ) -> None:
        path = tmp_path / f"frames{capture.suffix}"
        began = time.perf_counter()
        try:
            capture.begin()
            assert not capture.read(), "before write_to() nothing is written: return no frames"
            frames = _frames(capture, path)
            assert path.stat().st_size, "frames were returned, and the file is empty: flush it"
            frames += capture.end()
        finally:
            capture.close()
        numbers = [each.number for each in frames]
        assert numbers[0] == 0, f"the first frame of a file has number {numbers[0]}; begin with 0"
        assert numbers == sorted(set(numbers)), "frames are counted on, and each once"
        places = [each.pts for each in frames]
        assert places == sorted(places), "frames are returned in the order of the file"
        for each in frames:
            terms = (each.clock, each.arrival, each.lag)
            assert all(term >= 0.0 or math.isnan(term) for term in terms), (
                f"the terms of the uncertainty are {terms} s; give 0 or more, NaN if unknown"
            )
            known = sum(term for term in terms if not math.isnan(term))
            assert began - 1.0 - known < each.time <= time.perf_counter() + known, (
                f"a frame is of {each.time} s; give time.perf_counter() at its capture"
            )

    @pytest.mark.skipif(os.name == "nt", reason="Windows has no such permissions")
    def test_the_file_is_for_the_user_only(self, capture: Capture, tmp_path: Path) -> None:
        path = tmp_path / f"frames{capture.suffix}"
        try:
            capture.begin()
            _frames(capture, path)
            capture.end()
        finally:
            capture.close()
        mode = stat.S_IMODE(path.stat().st_mode)
        assert mode & 0o077 == 0, f"the file has the permissions {mode:o}; create it with 0o600"

    def test_a_file_that_is_there_is_not_overwritten(
        self, capture: Capture, tmp_path: Path
    ) -> None:
        path = tmp_path / f"frames{capture.suffix}"
        path.write_bytes(b"a film")
        try:
            capture.begin()
            with pytest.raises(LabcraneError):
                _frames(capture, path)
        finally:
            capture.close()
        assert path.read_bytes() == b"a film", "the file was changed; open it as a new one"

    def test_it_ends_and_closes_though_it_was_not_begun(self, capture: Capture) -> None:
        assert not capture.end(), "nothing was written: return no frames"
        capture.close()
