"""What the doctor says of clock, scheduling and disk."""

import shutil
from pathlib import Path

import pytest
from needs import needs

from labcrane.core import Finding, Verdict
from labcrane.doctor import clock, disk, scheduling
from labcrane.doctor.clock import ClockReading


def verdicts(found: list[Finding]) -> set[Verdict]:
    return {finding.verdict for finding in found}


def watched(ppm: float, step: float) -> list[Finding]:
    """Look at a clock that runs ``ppm`` fast while the wall clock is set by ``step`` seconds."""
    readings = iter(
        [
            ClockReading(5.0, 7.0, 100.0),
            ClockReading(6.0, 8.0 + 1e-6 * ppm, 101.0 + 1e-6 * ppm + step),
        ]
    )
    return clock.examine(lambda: next(readings), lambda seconds: None)


def test_a_slewed_clock_is_told_apart_from_a_set_one() -> None:
    steady, slewed, was_set = watched(12.0, 0.0), watched(-480.0, 0.0), watched(0.0, -1.5)
    assert any(one.text == "the clock runs +12.0 ppm against the hardware" for one in steady)
    (warned,) = [one for one in slewed if "ppm" in one.text]
    assert warned.verdict is Verdict.WARN
    assert warned.text.startswith("the clock runs -480.0 ppm against the hardware")
    assert "wait until it has settled" in warned.advice
    (warned,) = [one for one in was_set if "wall clock" in one.text]
    assert warned.text == "the wall clock was set by -1.500 s during the check"


def test_this_computers_clock_is_fine_enough_and_runs_like_its_hardware() -> None:
    found = clock.examine()
    assert found[0].verdict is Verdict.PASS
    (bent,) = [one for one in found if "ppm" in one.text]
    said = float(bent.text.split()[3])
    assert abs(said) < 600.0, "NTP slews by 500 ppm at most"


@pytest.mark.slow
def test_lateness_is_measured_by_ticking() -> None:
    found = scheduling.examine(rate_hz=50.0)
    assert found[0].text.startswith("100 ticks at 50 Hz were late by ")
    assert any("processor core" in finding.text for finding in found)


def test_a_governor_that_saves_power_is_a_warning(tmp_path: Path) -> None:
    for number, name in enumerate(("performance", "powersave")):
        folder = tmp_path / f"cpu{number}" / "cpufreq"
        folder.mkdir(parents=True)
        (folder / "scaling_governor").write_text(f"{name}\n")
    (found,) = scheduling.governor(tmp_path)
    assert found.verdict is Verdict.WARN
    assert "performance, powersave" in found.text
    shutil.rmtree(tmp_path / "cpu1")
    assert verdicts(scheduling.governor(tmp_path)) == {Verdict.PASS}
    assert scheduling.governor(tmp_path / "cpu0") == []


MOUNTS = (
    "/dev/nvme0n1p2 / ext4 rw 0 0\n"
    "tmpfs /tmp tmpfs rw 0 0\n"
    "lab:/srv /home/lab\\040data nfs4 rw 0 0\n"
    "/dev/sdb1 /home/lab\\040data/local xfs rw 0 0\n"
)


@pytest.mark.parametrize(
    ("place", "kind"),
    [
        ("/home/me", "ext4"),
        ("/tmp/study", "tmpfs"),
        ("/home/lab data/study", "nfs4"),
        ("/home/lab data/local/study", "xfs"),
    ],
)
def test_the_innermost_mount_holds_a_folder(place: str, kind: str) -> None:
    assert disk.file_system(Path(place), MOUNTS) == kind


@needs("/dev/shm")
def test_a_folder_in_memory_fails() -> None:
    found = disk.light(Path("/dev/shm/labcrane-none/data"), needed=1.0)
    (kind,) = [one for one in found if "file system" in one.text]
    assert kind.verdict is Verdict.FAIL
    assert "switching off loses everything" in kind.text


def test_a_session_that_does_not_fit_fails(tmp_path: Path) -> None:
    found = disk.light(tmp_path, needed=1e18)
    assert found[0].verdict is Verdict.FAIL
    assert "1000000000.00 GB are needed" in found[0].text


def test_writing_is_timed_and_leaves_nothing_behind(tmp_path: Path) -> None:
    found = disk.examine(tmp_path / "to" / "come", needed=1.0)
    assert any(finding.text.startswith("a frame is written in ") for finding in found)
    assert any("is on the disk after" in finding.text for finding in found)
    assert list(tmp_path.iterdir()) == []
