"""Disk examination: whether it stores a session's data in time and reliably."""

import os
import shutil
import tempfile
import time
from pathlib import Path

import numpy as np

from labcrane.core.clock import SystemClock, ticks
from labcrane.core.findings import Finding, Verdict
from labcrane.errors import RecordingError
from labcrane.files.append import AppendFile
from labcrane.files.system import PRIVATE_MODES
from labcrane.streams.sync.report.limits import WarnLimit

NEEDED_BYTES = 1_000_000_000
"""Required free space without a protocol."""

BLOCK_BYTES, BLOCKS, RATE_HZ = 512, 240, 240.0
WRITE_S = WarnLimit(0.001, 0.004)
"""Limit of a write's 99th percentile; a write happens within a tick."""

SYNC_S = WarnLimit(0.2, 1.0)
"""Limit of the time to sync a second of recording; a power cut loses data not yet synced."""

MOUNTS = Path("/proc/self/mounts")
REMOTE = ("nfs", "cifs", "smb", "fuse.sshfs", "9p", "ceph")
VOLATILE = ("tmpfs", "ramfs")


def light(folder: Path, needed: float = NEEDED_BYTES) -> list[Finding]:
    """Return the findings that need no measurement: free space, file system, access rights."""
    place = existing(folder)
    return [_space(place, needed), *_kind(place), *_privacy(place)]


def examine(folder: Path, needed: float = NEEDED_BYTES) -> list[Finding]:
    """Write like a session's journal for a second, and report how long it took."""
    return [*light(folder, needed), *_speed(existing(folder))]


def existing(folder: Path) -> Path:
    """Return ``folder``, or the nearest folder above that exists."""
    return next(path for path in (folder.absolute(), *folder.absolute().parents) if path.is_dir())


def _space(place: Path, needed: float) -> Finding:
    free = shutil.disk_usage(place).free
    text = f"{free / 1e9:.2f} GB are free at {place}; {needed / 1e9:.2f} GB are needed"
    if free >= needed:
        return Finding(Verdict.PASS, text)
    return Finding(Verdict.FAIL, text, "free some space, or give another folder with --data")


def _kind(place: Path) -> list[Finding]:
    if not MOUNTS.is_file():
        return []
    kind = file_system(place, MOUNTS.read_text(encoding="utf-8"))
    text = f"{place} is on a file system of kind {kind}"
    if kind in VOLATILE:
        fix = "record into a folder on a disk: --data"
        return [Finding(Verdict.FAIL, f"{text}: switching off loses everything", fix)]
    if kind.startswith(REMOTE):
        fix = "record on this computer's disk, and copy with labcrane transfer"
        return [Finding(Verdict.WARN, f"{text}: the network can make the loop wait", fix)]
    return [Finding(Verdict.PASS, text)]


def file_system(place: Path, mounts: str) -> str:
    """Return the kind of file system that holds ``place``, from a table like /proc/mounts."""
    best, kind = -1, "unknown"
    for line in mounts.splitlines():
        _, mounted, this, *_ = line.split()
        point = Path(mounted.replace("\\040", " "))
        if place.is_relative_to(point) and len(point.parts) >= best:
            best, kind = len(point.parts), this
    return kind


def _privacy(place: Path) -> list[Finding]:
    if PRIVATE_MODES:  # every file is written for this user only, wherever it is
        return []
    text = f"the access list of {place} determines who may read files there"
    if place.is_relative_to(Path.home()):
        return [Finding(Verdict.PASS, f"{text}, and folders of this user are closed to others")]
    fix = f'icacls "{place}" /inheritance:r /grant:r "%USERNAME%:(OI)(CI)F"'
    return [Finding(Verdict.WARN, f"{text}, possibly everybody on this computer", fix)]


def _speed(place: Path) -> list[Finding]:
    try:
        with tempfile.TemporaryDirectory(prefix=".labcrane-doctor-", dir=place) as folder:
            took, sync = _timed(Path(folder) / "journal")
    except (OSError, RecordingError) as error:
        text = f"{place} cannot be written: {error}"
        return [Finding(Verdict.FAIL, text, "check permissions and free space, or give --data")]
    most, worst = float(np.quantile(took, 0.99)), float(took.max())
    text = f"a frame is written in {1e3 * most:.3f} ms (p99), {1e3 * worst:.3f} ms (most)"
    synced = f"a second of recording is on the disk after {1e3 * sync:.0f} ms"
    return [
        _judged(text, WRITE_S.judge(most), "use another disk, or run fewer programs that write"),
        _judged(
            synced, SYNC_S.judge(sync), "use another disk: a power cut would lose that much more"
        ),
    ]


def _timed(path: Path) -> tuple[np.ndarray, float]:
    """Return the times of each write, and of the sync after them, in s."""
    block, took = os.urandom(BLOCK_BYTES), np.empty(BLOCKS)
    file = AppendFile(path, sync_s=10.0)  # none of its own in between
    try:
        for tick in ticks(SystemClock(), RATE_HZ):
            began = time.perf_counter()
            file.write(block)
            took[tick.number] = time.perf_counter() - began
            if tick.number == BLOCKS - 1:
                break
        began = time.perf_counter()
        file.sync()
        return took, time.perf_counter() - began
    finally:
        file.close()


def _judged(text: str, verdict: Verdict, advice: str) -> Finding:
    return Finding(verdict, text, "" if verdict is Verdict.PASS else advice)
