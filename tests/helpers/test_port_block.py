"""Checks of the ports that a run of tests takes for itself."""

import subprocess
import sys
from pathlib import Path

import port_block
import pytest

CLAIMING = """
import sys
sys.path.insert(0, {folder!r})
import port_block
block, holder = port_block.claim({first})
print(block, flush=True)
sys.stdin.read()
"""


def claiming(first: int) -> subprocess.Popen[str]:
    """Start a process that claims a block, says which, and holds it until it is killed."""
    program = CLAIMING.format(folder=str(Path(port_block.__file__).parent), first=first)
    return subprocess.Popen(
        [sys.executable, "-c", program],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def test_two_runs_never_have_a_block_in_common_and_a_killed_one_leaves_its_own() -> None:
    first, holder = port_block.claim()
    holder.close()
    with claiming(first) as one, claiming(first) as other:
        assert one.stdout is not None
        assert other.stdout is not None
        blocks = {int(one.stdout.readline()), int(other.stdout.readline())}
        assert len(blocks) == 2
        assert all((block - port_block.FIRST) % port_block.LENGTH == 0 for block in blocks)
        one.kill()
        other.kill()
    again, holder = port_block.claim(min(blocks))
    holder.close()
    assert again == min(blocks)


def test_it_says_so_when_every_block_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    free, holder = port_block.claim()
    monkeypatch.setattr(port_block, "FIRST", free)
    monkeypatch.setattr(port_block, "LAST", free + port_block.LENGTH - 1)
    with pytest.raises(RuntimeError, match=f"no block of 140 ports is free from {free} to"):
        port_block.claim()
    holder.close()
    again, holder = port_block.claim()
    holder.close()
    assert again == free
