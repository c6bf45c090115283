"""LSL on this computer only, before anything imports pylsl."""

import os
import tempfile
from pathlib import Path

CONFIG = Path(tempfile.mkdtemp(prefix="nback-")) / "lsl_api.cfg"
CONFIG.write_text(
    "[multicast]\nResolveScope = machine\n[ports]\nIPv6 = disable\n"
    f"[lab]\nKnownPeers = {{127.0.0.1}}\nSessionID = nback-{os.getpid()}\n"
)
os.environ.setdefault("LSLAPICFG", str(CONFIG))
