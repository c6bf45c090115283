"""What docs/feedback.md shows works as it is shown."""

import io
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest
from rehearsal import SHORT, a_study
from ruamel.yaml import YAML

from labcrane import Cue, rig
from labcrane.machine_file import load_machine
from labcrane.study import Study
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


PARTS = re.findall(r"```yaml\n(.+?)```", PAGE, re.S)


def completed(folder: Path, written: str) -> Study:
    """Return the short study with what a part of the page says instead."""
    yaml = YAML(typ="safe")
    text = io.StringIO()
    yaml.dump({**yaml.load(SHORT), **yaml.load(written)}, text)
    return a_study(folder, text.getvalue())


@pytest.mark.parametrize("written", PARTS)
def test_every_protocol_on_the_page_is_right(written: str, tmp_path: Path) -> None:
    study = completed(tmp_path, written)
    rig.describe(rig.build(study, simulated=False), study, 0)
    for choice in (*study.views.values(), *study.sounds.values(), *study.cues.values()):
        choice.build(study.machine)


def test_the_page_shows_views_and_fading(tmp_path: Path) -> None:
    study = completed(tmp_path, PARTS[0])
    assert set(study.views) == {"operator", "mirror", "examiner"}
    assert study.protocol.sessions[0].steps[1].block.fading == (1, 0.5, 0)
