"""What docs/feedback.md shows works as it is shown."""

import re
import sys
from pathlib import Path
from types import ModuleType

import pytest
from rehearsal import SHORT, a_study

from labcrane import Cue
from labcrane.machine_file import load_machine
from labcrane.testing import CueContract

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "feedback.md").read_text()


class TestLine(CueContract):
    @pytest.fixture
    def cue(self) -> Cue:
        (source,) = re.findall(r"```python\n(.+?)```", PAGE, re.S)
        module = sys.modules["line"] = ModuleType("line")
        exec(source, module.__dict__)
        (offered,) = module.labcrane_cues()
        return offered.build(offered.settings(), load_machine("ch8"))


def test_the_page_shows_a_protocol_that_is_right(tmp_path: Path) -> None:
    (written,) = re.findall(r"```yaml\n(.+?)```", PAGE, re.S)
    head, _, _ = SHORT.partition("sessions:")
    study = a_study(tmp_path, head + written)
    assert set(study.views) == {"operator", "mirror", "examiner"}
    assert study.protocol.sessions[0].steps[1].block.fading == (1, 0.5, 0)
