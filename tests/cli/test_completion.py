"""What a shell is told when the user presses the tabulator."""

import sys
from pathlib import Path

import pytest
from programs import ran


@pytest.mark.parametrize(
    ("typed", "completed"),
    [("labcrane new-p", "new-plugin"), ("labcrane plugins sh", "show"), ("labcrane dmd fi", "fit")],
)
def test_commands_are_completed_those_of_plugins_too(typed: str, completed: str) -> None:
    program = Path(sys.executable).with_name("labcrane")
    asked = {"_LABCRANE_COMPLETE": "complete_bash", "COMP_WORDS": typed}
    asked["COMP_CWORD"] = str(len(typed.split()) - 1)
    done = ran([program], env=asked, check=True)
    assert done.stdout.split() == [completed]
