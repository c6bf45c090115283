"""What docs/feedback.md shows keeps the contract of its role."""

import sys
from types import ModuleType

import pytest
from docs.page import ROOT, blocks

from labcrane import Cue
from labcrane.machines.library import load_machine
from labcrane.testing import CueContract


class TestLine(CueContract):
    @pytest.fixture
    def cue(self) -> Cue:
        found = blocks(ROOT / "docs" / "feedback.md")
        (source,) = [block.text for block in found if block.language == "python"]
        module = sys.modules["line"] = ModuleType("line")
        exec(source, module.__dict__)
        (offered,) = module.labcrane_cues()
        return offered.build(offered.settings(), load_machine("ch8"))
