"""LSL on this computer only, apart from any other test run, before anything imports pylsl."""

import os
import signal
import tempfile
from pathlib import Path

from labcrane.streams.network import LOOPBACK

_FOLDER = tempfile.TemporaryDirectory(prefix="labcrane-tests-")
_CONFIG = Path(_FOLDER.name) / "lsl_api.cfg"
_CONFIG.write_text(LOOPBACK.replace("[lab]", f"[lab]\nSessionID = labcrane-tests-{os.getpid()}"))
os.environ["LSLAPICFG"] = str(_CONFIG)

# What a shell starts in the background ignores interrupts, and so does all that it starts itself:
# tests interrupt programs as a person does.
signal.signal(signal.SIGINT, signal.default_int_handler)
