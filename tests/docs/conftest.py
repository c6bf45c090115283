"""A recording that pages can copy, made once."""

import subprocess
import sys
from pathlib import Path

import pytest
from docs.page import BASE


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What pages may refer to: a study, its data folder, and a participant file in it."""
    folder = tmp_path_factory.mktemp("recorded")
    study = folder / "protocol.yaml"
    study.write_text(BASE)
    command = ["run", str(study), "--participant", "P001", "--simulate", "--fast"]
    subprocess.run([sys.executable, "-m", "labcrane", *command], capture_output=True, check=True)
    data = folder / "data"
    recording = data / "P001-SIMULATED" / "P001-SIMULATED.h5"
    assert recording.exists()
    root = Path(__file__).parents[2]
    return {
        "STUDY": str(study),
        "DATA": str(data),
        "RECORDING": str(recording),
        "REPOSITORY": str(root),
    }
