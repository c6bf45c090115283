"""Pictures of every state of every page, and of the report, at three sizes.

    python docs/screens.py                             # all
    python docs/screens.py tests/pages/test_study.py   # of one

Runs the tests that look at each state (Chromium, its driver and axe-core are needed: `NODE_PATH`
says where), and keeps what they saw in ``docs/screens``, smaller. What a test refuses is not kept.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "docs" / "screens"
TESTS = (
    "tests/pages/test_states.py", "tests/pages/test_study.py", "tests/pages/test_viewer.py",
    "tests/results/test_report_page.py",
)  # fmt: skip
QUALITY = 60
WIDEST = 1280
"""Pixels: a picture of a wider screen is made smaller."""


def main() -> int:
    """Take all pictures; return the exit status of the tests."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(  # noqa: S603 - our own tests
            [sys.executable, "-m", "pytest", "-n0", "-q", "-m", "long", *(sys.argv[1:] or TESTS)],
            cwd=ROOT, env={**os.environ, "LABCRANE_SCREENS": folder}, check=False,
        )  # fmt: skip
        keep(sorted(Path(folder).glob("*.png")))
    return done.returncode


def keep(pictures: list[Path]) -> None:
    """Put pictures where they stay."""
    KEPT.mkdir(exist_ok=True)
    for path in pictures:
        with Image.open(path) as picture:
            picture.thumbnail((WIDEST, WIDEST))
            picture.convert("RGB").save(KEPT / f"{path.stem}.webp", quality=QUALITY)


if __name__ == "__main__":
    sys.exit(main())
