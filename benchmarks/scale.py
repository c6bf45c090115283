"""How time and memory grow: three sizes in equal steps, and by the line through them a larger one.

    python -m benchmarks.scale

The last column is the third step beside the second: 1.00 for a straight line, more where the cost
of one more grows. Seconds are of the processor; they and the MB at most are of one process. The
cost of a stream is that of writing it and of looking at its signals, without liblsl's own.
"""

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks import analysis, cohort, length, signals
from labcrane.monitoring.config import MonitorBuilder, MonitorConfig
from labcrane.recording.xdf.header import Channel, StreamHeader
from labcrane.recording.xdf.writer import XdfWriter

Figures = dict[str, float]
"""What one size took, by its unit."""


@dataclass(frozen=True)
class Scale:
    """One thing that grows: what, in which unit, the measured sizes, and the larger ones."""

    what: str
    unit: str
    sizes: tuple[int, int, int]
    asked: tuple[int, ...]
    measure: Callable[[int], Figures]


def scales(folder: Path) -> list[Scale]:
    """Return everything whose growth is measured."""
    recording = analysis.record(folder / "one", 4)

    def of_cohort(*words: str) -> Callable[[int], Figures]:
        def measure(participants: int) -> Figures:
            data = analysis.multiply(recording, folder / f"{words[0]}{participants}", participants)
            use = analysis.measured(words, data)
            return {"s": use.processor_s, "MB": use.megabytes}

        return measure

    def simulated(participants: int) -> Figures:
        use = cohort.command(folder / f"simulated{participants}", participants, 1)
        return {"s": use.processor_s, "MB": use.megabytes}

    grown = [
        ("report", of_cohort("report")),
        ("export --to tables", of_cohort("export", "--to", "tables")),
        ("simulate", simulated),
    ]
    long = [
        ("recover, 40 columns at 1 kHz", at_length(folder, length.RECOVER)),
        ("export of them", at_length(folder, length.EXPORT)),
    ]
    return [
        *(Scale(what, "participants", (12, 24, 36), (100, 1000), of) for what, of in grown),
        *(Scale(what, "minutes", (10, 20, 30), (600,), of) for what, of in long),
        Scale("a second of a stream at 1 kHz", "channels", (64, 128, 192), (512,), streamed),
    ]


def at_length(folder: Path, code: str) -> Callable[[int], Figures]:
    """Return what measures a program on sessions so many minutes long."""

    def measure(minutes: int) -> Figures:
        there = folder / f"minutes{minutes}" / "P001"
        count = round(60 * minutes * length.RATE_HZ)
        if not there.exists():
            length.record(there, minutes)
        seconds, megabytes = length.used(code, there, count)
        return {"s": seconds, "MB": megabytes}

    return measure


def streamed(channels: int) -> Figures:
    """Return what a second of a stream takes to be written, in chunks of 20 ms, and looked at."""
    seconds, chunk = 10, 20
    rows = np.random.default_rng(1).standard_normal((signals.RATE_HZ, channels)).astype(np.float32)
    header = StreamHeader(
        "Amplifier", "EEG", tuple(Channel(f"E{at}") for at in range(channels)), "float32",
        signals.RATE_HZ,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder, XdfWriter(Path(folder) / "a.xdf") as writer:
        stream = writer.add_stream(header)
        began = time.process_time()
        for at in range(0, seconds * len(rows), chunk):
            stamps = np.arange(at, at + chunk) / signals.RATE_HZ
            part = at % len(rows)
            writer.write_samples(stream, stamps, rows[part : part + chunk])
        written = (time.process_time() - began) / seconds
    builder = MonitorBuilder(MonitorConfig())
    return {"s": written + signals.cost(builder, "EEG", "microvolts", 4, channels)}


def lines(wanted: Sequence[Scale]) -> Iterator[str]:
    """Yield the rows of a table, one for each figure of each thing that grows."""
    yield "| what | sizes | took | would take | third step beside the second |"
    yield "|---|---|---|---|---|"
    for scale in wanted:
        took = [scale.measure(size) for size in scale.sizes]
        for unit in took[0]:
            figures = [each[unit] for each in took]
            law = np.polynomial.Polynomial.fit(scale.sizes, figures, 1)
            first, second = np.diff(figures)
            yield "| {} | {} {} | {} {} | {} | {} |".format(
                scale.what,
                ", ".join(map(str, scale.sizes)),
                scale.unit,
                ", ".join(f"{figure:.3g}" for figure in figures),
                unit,
                ", ".join(f"{law(size):.3g} {unit} for {size}" for size in scale.asked),
                f"{second / first:.2f}" if first > 0.05 * figures[0] else "none grows",
            )


def main() -> None:
    """Measure everything, and print a row for each figure."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    with tempfile.TemporaryDirectory(prefix="labcrane-scale-") as folder:
        for line in lines(scales(Path(folder))):
            print(line, flush=True)


if __name__ == "__main__":
    main()
