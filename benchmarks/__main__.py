"""All benchmarks, and one table of their ratios.

    python -m benchmarks [--check] [--only tick,start_up] [--brief]

Writes ``benchmarks/RESULTS.md``, with a column for each computer; what is not measured now stays.
Absolute figures from a shared computer are noisy. Every row therefore has a bare reference from the
same run, the ratio to it, and the largest ratio that is allowed. With ``--check``, the exit status
is 1 when a ratio of the chosen benchmarks exceeds its limit on any computer. A benchmark that
cannot run counts as failed, with the reason, and the others continue; one whose programs are not
installed is not tried, and named. ``--brief`` runs each for an instant, to check that it can run;
its figures are meaningless and not written.
All benchmarks together take about 22 minutes; the computer should be idle.
"""

import argparse
import shutil
import sys
import time
import traceback
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from benchmarks.results import Results
from benchmarks.table import missed, show

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
    results, measured, failed, not_tried = Results.read(RESULTS), [], [], []
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
        results.put(subject, rows)
        show(rows)
        print(f"{subject} took {time.monotonic() - began:.0f} s", flush=True)
        if not asked.brief:
            RESULTS.write_text(results.text(SUBJECTS), encoding="utf-8")
    print("".join(f"{each}\n" for each in not_tried), end="")
    if asked.brief:
        print("\n".join(f"MISSED {each}" for each in failed) or "all could be run")
        return 1 if failed else 0
    beyond = [*failed, *missed(measured)]
    print("\n".join(f"MISSED {each}" for each in beyond) or f"all {len(measured)} are kept")
    elsewhere = results.missed_elsewhere(chosen)
    print("".join(f"MISSED {each}\n" for each in elsewhere), end="")
    return 1 if failed or (asked.check and (beyond or elsewhere)) else 0


if __name__ == "__main__":
    sys.exit(main())
