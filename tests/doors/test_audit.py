"""The gate's look at known vulnerabilities: found, none, or said not to have been made."""

import json
import sys
from pathlib import Path

import pytest
from programs import ran

AUDIT = Path(__file__).parents[2] / ".ci" / "audit"
FINE = {"name": "numpy", "version": "2.0", "vulns": []}
BAD = {"name": "jinja2", "version": "1.0", "vulns": [{"id": "PYSEC-1"}]}
UNKNOWN = {"name": "h5py", "skip_reason": "Dependency not found on PyPI"}
OURS = {"name": "labcrane", "skip_reason": "distribution marked as editable"}


@pytest.mark.skipif(sys.platform == "win32", reason="the gate is a program of Debian's shell")
@pytest.mark.parametrize(
    ("answers", "status", "said"),
    [
        ([FINE, OURS], 0, "pypi: 1 packages looked up, 0 advisories, 0 not looked up"),
        ([FINE, BAD, OURS], 1, "jinja2 1.0: PYSEC-1"),
        ([FINE, BAD, UNKNOWN], 1, "jinja2 1.0: PYSEC-1"),
        ([FINE, UNKNOWN], 3, "NOT AUDITED: no service of advisories answered for every package"),
        ([], 3, "NOT AUDITED"),
        (None, 3, "osv: no answer"),
    ],
)
def test_an_audit_that_was_not_made_is_never_taken_for_one(
    tmp_path: Path, answers: list[dict] | None, status: int, said: str
) -> None:
    (tmp_path / "python").symlink_to(sys.executable)
    program = tmp_path / "pip-audit"
    answer = "" if answers is None else json.dumps({"dependencies": answers})
    (tmp_path / "answer").write_text(answer)
    program.write_text(f"""#!/bin/sh
while [ "$1" != --output ]; do shift; done
cat {tmp_path}/answer >"$2"
exit 1
""")
    program.chmod(0o755)
    done = ran([AUDIT, tmp_path / "python"])
    assert done.returncode == status, done.stdout + done.stderr
    assert said in done.stdout + done.stderr
