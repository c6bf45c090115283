"""Where the processes that tests start find the tests' own modules."""

import os
from pathlib import Path

HELPERS = Path(__file__).parent
OWN_MODULES = os.pathsep.join(map(str, (HELPERS.parent, HELPERS)))
"""What they have as ``PYTHONPATH``."""
