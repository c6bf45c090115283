"""``python -m labcrane``, and what the ``labcrane`` command calls."""

import sys

from labcrane.cli.app import main

if __name__ == "__main__":
    sys.exit(main())
