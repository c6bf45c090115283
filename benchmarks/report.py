"""Report: how soon the page of 36 participants opens in a browser, with all of its figures.

    python -m benchmarks.report

Needs Chromium. The 36 are copies of one simulated participant: as many points, lines and rows.
"""

import sys
import tempfile
from pathlib import Path

from benchmarks.analysis import multiply, record
from benchmarks.own_process import used
from benchmarks.table import Row, show

TESTS = Path(__file__).parents[1] / "tests"
PARTICIPANTS, PROMISED_S = 36, 2.0

WHOLE = """
const done = arguments[0];
const all = [...document.images].map(i => { i.loading = 'eager'; return i.decode(); });
Promise.all(all).then(() => done([performance.now() / 1000, all.length]));
"""
"""Since the page was asked for, until the last figure can be painted."""


def rows(*, brief: bool = False) -> list[Row]:
    """Return how long it takes at its slowest of three."""
    participants = 3 if brief else PARTICIPANTS
    sys.path[:0] = [str(TESTS), str(TESTS / "helpers")]
    from pages.room import a_browser  # noqa: PLC0415

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        data = multiply(record(folder / "one", 4), folder / "data", participants)
        out = folder / "report"
        used("report", str(data), "--out", str(out), "--include", "simulated", "--workers", "2")
        with a_browser(folder / "profile") as browser:
            took = []
            for _ in range(3):
                browser.get((out / "report.html").as_uri())
                seconds, figures = browser.execute_async_script(WHOLE)
                assert figures > 5, "the study's figures are on the page"
                took.append(seconds)
    what = f"{participants} participants: open the page with {figures} figures, s"
    return [Row("report", what, max(took), PROMISED_S, "promised", 1.0)]


if __name__ == "__main__":
    show(rows())
