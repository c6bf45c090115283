"""Full and read-only disks: real ones, in a user namespace."""

import subprocess
import sys
from pathlib import Path

import pytest
from needs import UNSHARE, needs
from own_modules import OWN_MODULES
from programs import ran

needs_mounts = needs("mounts")

FULL_DISK = """
import sys
from pathlib import Path
from labcrane import RecordingError
from labcrane.recording.xdf.reader import read_xdf
from recording.journals import *

folder = Path(sys.argv[1])
ballast = folder / "ballast"
ballast.write_bytes(bytes(150_000))
journal = SessionJournal(folder / "ses-01_run.xdf", COLUMNS, RATE_HZ)
journal.write_event(Event("session.start", START, CONTEXT), 0)
number, refused = 0, 0
while number < 2000:
    try:
        journal.write_frame(stamp(number), frame(number))
    except RecordingError as error:
        refused += 1
        assert "No space left on device" in str(error), error
        assert "free space on the disk" in str(error), error
        torn = read_xdf(journal.path)
        assert torn.torn == 0 and len(torn.stream("labcrane.frames").stamps) == number
        ballast.unlink()
    else:
        number += 1
journal.close()
file = read_xdf(journal.path)
assert refused == 1, refused
assert file.whole and file.checked == journal.path.stat().st_size
assert (file.stream("labcrane.frames").data == frames(2000)).all()
print("went on")
"""


def in_namespace(mount: str, script: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = f'mount -t tmpfs -o {mount} none "$0" && exec "$@"'
    return ran(
        [*UNSHARE, "sh", "-c", command, str(folder), sys.executable, "-c", script, str(folder)],
        env={"PYTHONPATH": OWN_MODULES},
    )


@needs_mounts
def test_a_full_disk_loses_nothing_and_the_session_goes_on_when_there_is_room(
    tmp_path: Path,
) -> None:
    done = in_namespace("size=300k", FULL_DISK, tmp_path)
    assert done.stdout == "went on\n", done.stderr


READ_ONLY = """
import sys
from pathlib import Path
from labcrane import RecordingError
from labcrane.recording.xdf.writer import XdfWriter
try:
    XdfWriter(Path(sys.argv[1]) / "ses-01_run.xdf")
except RecordingError as error:
    print(error)
"""


@needs_mounts
def test_a_read_only_folder_is_refused_at_the_start(tmp_path: Path) -> None:
    done = in_namespace("ro", READ_ONLY, tmp_path)
    assert "cannot create" in done.stdout, done.stderr
    assert "Read-only file system; the disk is read-only" in done.stdout


FULL_AT_THE_END = """
import shutil
import sys
from pathlib import Path
from labcrane import RecordingError
from labcrane.recording.participant_file.writer import consolidate
from labcrane.recording.participant_file.reader import open_recording
from recording.journals import *

folder = Path(sys.argv[1])
path = folder / "P001.h5"
consolidate(path, [write(folder / "ses-01_run.xdf", 200)])
before = path.read_bytes()
journal = write(folder / "ses-02_run.xdf", 8000)
ballast = folder / "ballast"
ballast.write_bytes(bytes(shutil.disk_usage(folder).free - 120_000))
names = sorted(entry.name for entry in folder.iterdir())
try:
    consolidate(path, [journal])
except RecordingError as error:
    assert "P001.h5: No space left on device; it is as it was" in str(error), error
    assert "labcrane recover" in str(error), error
else:
    raise AssertionError("the disk was not full")
assert path.read_bytes() == before
assert sorted(entry.name for entry in folder.iterdir()) == names
ballast.unlink()
consolidate(path, [journal])
assert open_recording(path).sessions == [1, 2]
print("went on")
"""


@pytest.mark.slow
@needs_mounts
def test_a_full_disk_at_the_end_leaves_the_participant_file_as_it_was(tmp_path: Path) -> None:
    done = in_namespace("size=1500k", FULL_AT_THE_END, tmp_path)
    assert done.stdout == "went on\n", done.stderr
