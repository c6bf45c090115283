"""A scenario's record: with its scenes and its model in it, it can be run again from itself."""

import json
import shutil
from pathlib import Path

import pytest
from cranes import needs_bullet
from rehearsal import loaded

from labcrane import open_recording
from labcrane.replay import replay_session
from labcrane.testing import QueueConsole, Visit, run

pytestmark = needs_bullet

RETRIEVAL = Path(__file__).parents[2] / "protocols" / "retrieval"


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """Run one scenario of a study that lies somewhere and is gone afterwards."""
    study = tmp_path / "somewhere" / "study"
    shutil.copytree(RETRIEVAL, study)
    text = (study / "protocol.yaml").read_text(encoding="utf-8")
    for line in text.splitlines():
        stage = "- reference:" in line or "- practice:" in line
        if (line.startswith("    - scenes/") and "touch" not in line) or stage:
            text = text.replace(line + "\n", "")
    (study / "protocol.yaml").write_text(text, encoding="utf-8")
    visit = Visit(
        loaded(study / "protocol.yaml"),
        "R001",
        1,
        tmp_path / "data",
        simulated=True,
        fast=True,
    )
    path = run(visit, QueueConsole())
    shutil.rmtree(study)
    return path


@pytest.mark.slow
def test_a_scenario_is_replayed_bit_for_bit_from_its_record_alone(recorded: Path) -> None:
    context = open_recording(recorded).session(1).context
    scene = "scenes/touch.yaml"
    assert context["files"][scene]["text"] == (RETRIEVAL / scene).read_text(encoding="utf-8")
    part = "scenes/parts/table.yaml"  # which the scene uses
    assert context["files"][part]["text"] == (RETRIEVAL / part).read_text(encoding="utf-8")
    assert context["components"]["dynamics"]["settings"]["scenes"] == [scene]
    assert "somewhere" not in json.dumps(context)
    again = replay_session(recorded, 1)
    assert again.difference is None
    assert again.parts == ()
    assert again.ticks > 240
