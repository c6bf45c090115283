"""Wheel of a package as it is installed, where no index has one with the same files.

Debian's Python brings a setuptools and a pip of its own into every environment, under a version
whose wheel on an index has other files. The installed files were approved, so they are packed.
"""

import base64
import csv
import hashlib
import io
import zipfile
from collections.abc import Iterator
from importlib.metadata import Distribution
from pathlib import Path

from labcrane.approval.environment import OF_THE_INSTALLER
from labcrane.errors import ProtocolError

RECORD = "RECORD"
WHEN = (1980, 1, 1, 0, 0, 0)
"""Date of every file in the wheel, the first that a zip can hold: equal files make equal wheels."""


def repacked(package: Distribution, folder: Path) -> Path:
    """Write a wheel of the installed files, and return it.

    It contains neither programs that an installer makes for entry points nor compiled Python
    files.

    Raises
    ------
    ProtocolError
        A file is gone or was changed since it was installed, or is where no wheel can put it.
    """
    record = package.read_text(RECORD)
    about = package.read_text("WHEEL")
    name, version = package.name, package.version
    if record is None or about is None:
        raise ProtocolError(f"no record states how {name} {version} was installed; install it")
    rows: list[tuple[str, str, str]] = []
    whole = io.BytesIO()
    tags = [line.partition(":")[2].strip() for line in about.splitlines() if line[:4] == "Tag:"]
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, content in _files(package, record):
            wheel.writestr(zipfile.ZipInfo(path, WHEN), content, zipfile.ZIP_DEFLATED)
            rows.append((path, f"sha256={_digest(content)}", str(len(content))))
        (info,) = {path.partition("/")[0] for path, _, _ in rows if path.endswith("info/METADATA")}
        rows.append((f"{info}/{RECORD}", "", ""))
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(rows)
        wheel.writestr(zipfile.ZipInfo(rows[-1][0], WHEN), text.getvalue())
    parts = zip(*(each.split("-") for each in tags), strict=True)
    tag = "-".join(".".join(sorted(set(part))) for part in parts)
    target = folder / f"{info.removesuffix('.dist-info')}-{tag}.whl"
    target.write_bytes(whole.getvalue())
    return target


def _files(package: Distribution, record: str) -> Iterator[tuple[str, bytes]]:
    """Yield each file of the installer's record, with its content."""
    programs = {each.name for each in package.entry_points if "_scripts" in each.group}
    for path, digest, *_ in filter(None, csv.reader(record.splitlines())):
        file = Path(path)
        of_installer = file.parent.suffix == ".dist-info" and file.name in OF_THE_INSTALLER
        if of_installer or file.suffix == ".pyc":
            continue
        outside = path.startswith((".", "/")) or file.is_absolute()
        if outside and _is_program(file.name.removesuffix(".exe"), programs):
            continue
        what = f"{path} of {package.name} {package.version}"
        if outside:
            raise ProtocolError(f"{what} is outside the folder of packages; reinstall it")
        place = Path(str(package.locate_file(path)))
        if not place.is_file():
            raise ProtocolError(f"{what} is gone; reinstall it")
        content = place.read_bytes()
        if digest and digest != f"sha256={_digest(content)}":
            raise ProtocolError(f"{what} was changed after it was installed; reinstall it")
        yield file.as_posix(), content


def _is_program(name: str, programs: set[str]) -> bool:
    """Whether a program is one that installers make: pip also makes pip3 and pip3.11."""
    return any(name.rstrip("0123456789.") == each.rstrip("0123456789.") for each in programs)


def _digest(content: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(content).digest()).decode().rstrip("=")
