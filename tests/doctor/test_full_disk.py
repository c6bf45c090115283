"""The look at a real disk of 64 kB, in a user namespace."""

import json
import sys

from programs import ran
from recording.test_full_disk import UNSHARE, needs_mounts

LOOK = """
import json
from pathlib import Path
from labcrane.doctor import disk
print(json.dumps([[f.verdict, f.text] for f in disk.examine(Path("/mnt"), 1.0)]))
"""


@needs_mounts
def test_a_disk_that_is_full_fails_with_the_reason() -> None:
    shell = 'mount -t tmpfs -o size=64k none /mnt && exec "$0" -c "$1"'
    done = ran([*UNSHARE, "sh", "-c", shell, sys.executable, LOOK], check=True)
    *_, (verdict, text) = json.loads(done.stdout)
    assert verdict == "FAIL"
    assert "/mnt cannot be written" in text
    assert "No space left on device" in text
