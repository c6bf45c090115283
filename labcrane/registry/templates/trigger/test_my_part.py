"""my_part keeps the contract of its role; add what else it promises."""

from pathlib import Path

import pytest
from my_module import MyPart, MyPartSettings

from labcrane import Trigger
from labcrane.testing import TriggerContract, ch8, make_run, opened


class TestMyPart(TriggerContract):
    @pytest.fixture
    def trigger(self, tmp_path: Path) -> Trigger:
        return MyPart(MyPartSettings(device=tmp_path / "line"))


def test_every_code_is_one_byte(tmp_path: Path) -> None:
    trigger = MyPart(MyPartSettings(device=tmp_path / "line"))
    with opened(trigger, make_run(ch8())):
        trigger.send([1, 2], 0.0)
    assert (tmp_path / "line").read_bytes() == bytes([1, 2])
