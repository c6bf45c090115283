"""Recent studies: the paths of those that were opened last, kept for the user of this computer."""

import json
import os
import sys
from pathlib import Path

from labcrane.files.atomic import write_text

MOST = 10


def place() -> Path:
    """Return the file of the recent studies, where this system keeps a user's state."""
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA", str(Path.home()))
    else:
        base = os.environ.get("XDG_STATE_HOME", str(Path.home() / ".local" / "state"))
    return Path(base) / "labcrane" / "recent.json"


def recent() -> list[Path]:
    """Return the studies, the last one first; none where the file is missing or damaged."""
    try:
        found = json.loads(place().read_text(encoding="utf-8"))
        return [Path(each) for each in found if isinstance(each, str)]
    except (OSError, ValueError, TypeError):
        return []


def remember(path: Path) -> None:
    """Put a study first."""
    paths = [path, *(each for each in recent() if each != path)][:MOST]
    write_text(place(), json.dumps([str(each) for each in paths], indent=1))
