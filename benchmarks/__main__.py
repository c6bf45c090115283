"""All benchmarks, and one table of their ratios.

    python -m benchmarks [--check] [--only tick,start_up] [--brief]

Writes ``benchmarks/RESULTS.md`` with the machine and the date; rows of omitted benchmarks stay
unchanged. Absolute figures from a shared computer are noisy. Every row therefore has a bare
reference from the same run, the ratio to it, and the largest ratio that is allowed. With
``--check``, the exit status is 1 when a ratio exceeds its limit, and each such row is listed. A
benchmark that cannot run counts as failed, with the reason, and the others continue; one whose
programs are not installed is not tried, and named. ``--brief``
runs each for an instant, to check that it can run; its figures are meaningless and not written.
All benchmarks together take about 22 minutes; the computer should be idle.
"""

import argparse
import os
import platform
import shutil
import sys
import time
import traceback
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

from benchmarks.table import Row, missed

SUBJECTS = (
    "tick", "secondary", "scenario", "oversight", "beside", "real_time", "recording", "length",
    "sync", "signals", "view", "viewer", "sound", "film", "analysis", "report", "cohort",
    "start_up", "pages",
)  # fmt: skip
NEEDS = {
    "beside": ("jackd", "jack_wait"), "real_time": ("jackd", "jack_wait"), "sync": ("gcc",),
}  # fmt: skip
"""Programs without which a benchmark is not tried."""

RESULTS = Path(__file__).with_name("RESULTS.md")
HEAD = "| benchmark | figure | labcrane | reference | | ratio | at most | measured |"


def main(words: Sequence[str] | None = None) -> int:
    """Run the chosen benchmarks and write the table; 1 when a checked ratio exceeds its limit.

    It is 1, too, when a benchmark could not be run.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", help=f"some of {','.join(SUBJECTS)}")
    parser.add_argument("--brief", action="store_true", help="run each for an instant; no table")
    parser.add_argument("--check", action="store_true", help="fail when a ratio is above its limit")
    asked = parser.parse_args(words)
    chosen = asked.only.split(",") if asked.only else list(SUBJECTS)
    if unknown := set(chosen) - set(SUBJECTS):
        parser.error(f"there is no {', '.join(sorted(unknown))}; there is {', '.join(SUBJECTS)}")
    lines, measured, failed, not_tried = kept(), [], [], []
    for subject in chosen:
        print(f"== {subject}", flush=True)
        began = time.monotonic()
        if missing := [name for name in NEEDS.get(subject, ()) if shutil.which(name) is None]:
            not_tried.append(f"{subject} was not tried: there is no {' and no '.join(missing)}")
            continue
        try:
            rows = import_module(f"benchmarks.{subject}").rows(brief=asked.brief)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - the others go on
            traceback.print_exc()
            failed.append(f"{subject} could not be run: {type(error).__name__}: {error}")
            continue
        if not rows:
            failed.append(f"{subject} gave no figure")
        measured += rows
        lines[subject] = [line(subject, row) for row in rows]
        print("\n".join(lines[subject]), flush=True)
        print(f"{subject} took {time.monotonic() - began:.0f} s", flush=True)
        if not asked.brief:
            write(lines)
    print("".join(f"{each}\n" for each in not_tried), end="")
    if asked.brief:
        print("\n".join(f"MISSED {each}" for each in failed) or "all could be run")
        return 1 if failed else 0
    beyond = [*failed, *missed(measured)]
    print("\n".join(f"MISSED {each}" for each in beyond) or f"all {len(measured)} are kept")
    others = [text for each in lines if each not in chosen for text in lines[each]]
    print("".join(f"MISSED BEFORE {each}\n" for each in missed_before(others)), end="")
    return 1 if failed or (asked.check and beyond) else 0


def missed_before(lines: Iterable[str]) -> list[str]:
    """Return which kept rows were above their limits when they were measured, or had none."""
    found = []
    for text in lines:
        cells = [part.strip() for part in text.split("|")]
        subject, what, ratio, limit, when = (cells[at] for at in (1, 2, 6, 7, 8))
        if not limit or not float(ratio) <= float(limit):
            says = f"{ratio} of {limit}" if limit else f"{ratio}, without a limit"
            found.append(f"{subject}: {what}: {says}, kept of {when}; measure {subject} again")
    return found


def line(subject: str, row: Row) -> str:
    """Return a row of the table, with the machine and the date."""
    when = f"{datetime.now(UTC).date()}, {machine()}"
    ratio = f"{row.ratio:.2f}" if row.ratio >= 0.01 else f"{row.ratio:.1g}"
    figures = f"{row.ours:.3g} | {row.reference} | {row.bare:.3g} | {ratio} | {row.limit:.2f}"
    return f"| {subject} | {row.what} | {figures} | {when} |"


def machine() -> str:
    """Return a short description of the computer."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text(encoding="utf-8").splitlines()
        names = [line for line in lines if line.startswith("model name")]
        model = names[0].partition(":")[2].strip() if names else model
    return f"{os.cpu_count()} cores {model}, Python {platform.python_version()}"


def kept() -> dict[str, list[str]]:
    """Return the lines of the last table, by benchmark."""
    lines: dict[str, list[str]] = {subject: [] for subject in SUBJECTS}
    for text in RESULTS.read_text(encoding="utf-8").splitlines() if RESULTS.exists() else ():
        subject = text.split("|")[1].strip() if text.startswith("|") else ""
        if subject in lines:
            lines[subject].append(text)
    return lines


def write(lines: dict[str, list[str]]) -> None:
    """Write the table."""
    rows = "\n".join(text for subject in SUBJECTS for text in lines[subject])
    RESULTS.write_text(f"{head()}{rows}\n", encoding="utf-8")


def head() -> str:
    """Return the text above the rows."""
    return (
        "# Benchmarks\n\n"
        f"Made by `python -m benchmarks` with labcrane {version('labcrane')}. Each figure is "
        "compared with a bare reference\nthat ran in the same minutes. Compare the ratios; "
        "`--check` fails where a ratio exceeds its limit (*at most*).\n\n"
        f"{HEAD}\n|{'---|' * (HEAD.count('|') - 1)}\n"
    )


if __name__ == "__main__":
    sys.exit(main())
