"""my_part keeps the contract of commands; add what else it promises."""

from pathlib import Path

import pytest
from my_module import count, labcrane_commands

from labcrane.registry import CommandOffer
from labcrane.testing import PARTICIPANT_TRIALS, CommandContract, make_participant


class TestCount(CommandContract):
    @pytest.fixture
    def command(self) -> CommandOffer:
        (command,) = labcrane_commands()
        return command


def test_trials_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_participant(tmp_path)
    count(tmp_path)
    assert capsys.readouterr().out == f"P001: {PARTICIPANT_TRIALS}\n"
