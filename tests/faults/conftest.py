"""Studies that fail as they are ordered to."""

import shutil
from pathlib import Path

import pytest
from faults.faulty_study import STUDY, Spoil
from faults.sessions import unique


@pytest.fixture
def spoil(tmp_path: Path) -> Spoil:
    """Return what writes a study whose plugin does as ordered."""

    def write(order: str) -> Path:
        (tmp_path / "plugins").mkdir()
        shutil.copy(Path(__file__).with_name("faulty.py"), tmp_path / "plugins")
        (tmp_path / "plugins" / "order.txt").write_text(order)
        path = tmp_path / "study.yaml"
        path.write_text(STUDY.format(study=unique("faulty")))
        return path

    return write
