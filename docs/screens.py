"""Pictures of the pages and of the report, as docs and README show them, with the day.

    python docs/screens.py

Runs the tests that look at each state (Chromium, its driver and axe-core are needed: `NODE_PATH`
says where), and keeps of what they saw the pictures of :data:`KEPT`, smaller. What a test refuses
is not kept.
"""

import os
import subprocess
import sys
import tempfile
from datetime import date
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
SCREENS = ROOT / "docs" / "screens"
TESTS = (
    "tests/pages/test_states.py", "tests/pages/test_control_room.py", "tests/pages/test_study.py",
    "tests/pages/test_viewer.py", "tests/results/test_report_page.py",
)  # fmt: skip
KEPT = {
    "running-1280": "The experimenter's page while a trial runs",
    "supervisor-fault-1280": "Two faults, what labcrane does, and the buttons that solve them",
    "wall-1920": "The status on a wall, to be read from 3 m",
    "supervisor-report-1280": "The end: what was saved, what remains, and the timestamps",
    "participant-all-scales-768": "A questionnaire on a tablet",
    "study-1280": "The study's page",
    "viewer-1280": "The viewer of a recorded session",
    "report-1280": "The report",
}
QUALITY = 60
WIDEST = 1280
"""Pixels: a picture of a wider screen is made smaller."""


def main() -> int:
    """Take all pictures; return the exit status of the tests."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(  # noqa: S603 - our own tests
            [sys.executable, "-m", "pytest", "-n0", "-q", "-m", "long", *TESTS],
            cwd=ROOT, env={**os.environ, "LABCRANE_SCREENS": folder}, check=False,
        )  # fmt: skip
        if done.returncode == 0:
            keep(Path(folder))
    return done.returncode


def keep(folder: Path) -> None:
    """Put the pictures where they stay, and write the page that shows them."""
    lines = ["# Pictures of the pages", "", f"Made by `python docs/screens.py` on {date.today()}."]
    for name, caption in KEPT.items():
        with Image.open(folder / f"{name}.png") as picture:
            picture.thumbnail((WIDEST, WIDEST))
            picture.convert("RGB").save(SCREENS / f"{name}.webp", quality=QUALITY)
        lines += ["", f"## {caption}", "", f"![{caption}](screens/{name}.webp)"]
    (ROOT / "docs" / "screens.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
