"""Cost of a secondary task in the loop: ticks of the aiming study with and without one.

    python -m benchmarks.secondary

Rounds alternate, so that a wandering machine moves both figures together.
"""

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from benchmarks.table import Row
from benchmarks.tick import STUDY, whole
from labcrane.core.clock import ManualClock, SystemClock
from labcrane.protocol.study import Study, load
from labcrane.registry.registry import discover

RATE_HZ, ROUNDS, PACED_S = 240, 5, 5.0

MOST = 1.3
"""How much longer the median tick may take with a detection response task."""

SECONDARY = """\
secondary:
  drt: {use: drt, response: right.trigger}
sessions:
"""


def studies(folder: Path) -> Mapping[str, Study]:
    """Return the study without and with a detection response task."""
    plain = STUDY.format(rate=RATE_HZ)
    texts = {"without": plain, "with": plain.replace("sessions:\n", SECONDARY)}
    found = {}
    for name, text in texts.items():
        path = folder / f"{name}.yaml"
        path.write_text(text)
        found[name] = load(path, discover())
    return found


def rows(*, brief: bool = False) -> list[Row]:
    """Return what a tick costs with a secondary task, and how many ticks come late."""
    took: dict[str, list[float]] = {"without": [], "with": []}
    late = dict.fromkeys(took, 1)
    count = round((0.1 if brief else PACED_S) * RATE_HZ)
    with tempfile.TemporaryDirectory() as made:
        of_each = studies(Path(made))
        for _ in range(1 if brief else ROUNDS):
            for name, study in of_each.items():
                seen = whole(study, Path(made), ManualClock(), count, lsl=False)
                took[name].append(float(np.median(np.diff([frame.elapsed for frame in seen]))))
                seen = whole(study, Path(made), SystemClock(), count, lsl=False)
                late[name] += sum(frame.tick.late_s > 1.0 / RATE_HZ for frame in seen)
    # Neighbours' medians: the computer's speed can change by a half between two rounds.
    pairs = sorted(zip(*took.values(), strict=True), key=lambda pair: pair[1] / pair[0])
    bare, ours = (1e6 * median for median in pairs[len(pairs) // 2])
    return [
        Row("secondary", "a tick with a response task, median us", ours, bare, "without", MOST),
        Row(
            "secondary", "late ticks with it, and one", late["with"], late["without"], "without", 2
        ),
    ]


if __name__ == "__main__":
    for row in rows():
        print(f"{row.what}: {row.ours:.3g}, {row.reference} {row.bare:.3g}")
