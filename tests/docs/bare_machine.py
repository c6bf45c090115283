"""Print the commands of the documentation that begin on a machine that has nothing yet.

.ci/run does them, in a copy of the repository; nothing but Python is there to read them with.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", "docs/first-study.md")
BLOCK = re.compile(r"^<!-- bare machine: [^\n]+ -->\n```sh\n(.+?)^```$", re.MULTILINE | re.DOTALL)


def commands() -> list[str]:
    """Return the marked blocks in order."""
    return [block for page in PAGES for block in BLOCK.findall((ROOT / page).read_text())]


if __name__ == "__main__":
    sys.stdout.write("\n".join(commands()))
