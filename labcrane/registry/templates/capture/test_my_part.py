"""my_part keeps the contract of its role; add what else it promises."""

from pathlib import Path

import pytest
from my_module import MyPart, MyPartSettings

from labcrane import Capture
from labcrane.testing import CaptureContract


class TestMyPart(CaptureContract):
    @pytest.fixture
    def capture(self) -> Capture:
        return MyPart(MyPartSettings(consent="we write lines"))


def test_there_is_a_line_for_every_frame(tmp_path: Path) -> None:
    path = tmp_path / "lines.txt"
    part = MyPart(MyPartSettings(consent="we write lines", period_s=0.0))
    part.begin()
    part.write_to(path)
    frames = [frame for _ in range(3) for frame in part.read()]
    part.end()
    part.close()
    assert len(path.read_bytes().splitlines()) == len(frames) == 3
