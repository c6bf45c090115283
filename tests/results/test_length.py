"""Exports of long recordings: by chunks, in memory that does not grow with their length."""

import sys
from pathlib import Path

import pytest

from labcrane.analysis.cohort import Cohort
from results.lengthened import lengthened, megabytes

SHORT_S, TIMES = 600.0, 4


@pytest.fixture(scope="module")
def short_and_long(
    electrodes: Cohort, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Path]:
    """The same session of 10 minutes, and of 40."""
    folder = tmp_path_factory.mktemp("length")
    source = electrodes.included[0].path
    made = [folder / f"{times}" for times in (1, TIMES)]
    for data, times in zip(made, (1, TIMES), strict=True):
        lengthened(source, data / "P001" / "P001.h5", SHORT_S * times)
    return made[0], made[1]


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize(("exporter", "per_sample"), [("matlab", 0), ("bids", 56)])
def test_a_recording_four_times_as_long_takes_hardly_more_memory(
    short_and_long: tuple[Path, Path], exporter: str, per_sample: int, tmp_path: Path
) -> None:
    """Of EEG, bids keeps the stamps, and works on copies of these: no channel of any stream."""
    used = [
        megabytes("export", data, "--to", exporter, "--out", tmp_path / data.name)
        for data in short_and_long
    ]
    more = (TIMES - 1) * SHORT_S * 250.0 * per_sample / 1e6
    assert used[1] - used[0] < 0.05 * used[0] + more
