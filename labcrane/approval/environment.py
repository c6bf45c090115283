"""Environment of a study: the installed packages, by version and by the installer's record.

Another NumPy may give other numbers, unnoticed. Hashing all files would take seconds before each
session, so only those of labcrane and plugins are. The materials have a hash of their own, which is
the same on every computer.
"""

import csv
import hashlib
import json
import platform
import re
import sys
import sysconfig
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from importlib.metadata import Distribution, distributions
from typing import Any

from labcrane.registry.entry_points import one_name

OF_THE_INSTALLER = frozenset(
    {"INSTALLER", "RECORD", "REQUESTED", "direct_url.json", "uv_cache.json", "uv_build.json"}
)
"""Files about the installation of a package, not about its content."""

# The parser of mail, which the standard library reads each of them with, takes most of the time.
_FIELD = re.compile(r"^(Name|Version):[ \t]*(\S.*)$", re.MULTILINE | re.IGNORECASE)

Environment = Mapping[str, Any]


def environment() -> dict[str, Any]:
    """Return the installed packages, ready for JSON.

    Returns
    -------
    dict
        ``system``, ``python``, and ``packages``: for each a ``version`` and ``sha256``, a hash of
        the names and hashes of its files as its installer recorded them. It is None for a package
        whose files are a working copy or whose installer kept no record.
    """
    return _environment(tuple(sys.path))


@lru_cache(maxsize=1)
def _environment(path: tuple[str, ...]) -> dict[str, Any]:
    packages = {
        name: {"version": version, "sha256": fingerprint(each)}
        for name, version, each in _named(path)
    }
    return {
        "system": sysconfig.get_platform(),
        "python": platform.python_version(),
        "packages": dict(sorted(packages.items())),
    }


def _named(path: Sequence[str]) -> Iterator[tuple[str, str | None, Distribution]]:
    """Yield each package once with its name, by PEP 503, and its version.

    Of two the first, which is the one that is imported. Remains of an interrupted installation have
    no name and are not packages: on Windows, where files in use cannot be removed, such folders are
    common.
    """
    seen: set[str] = set()
    for each in distributions(path=list(path)):
        about = each.read_text("METADATA") or each.read_text("PKG-INFO") or each.read_text("")
        fields: dict[str, str] = {}
        for field, value in _FIELD.findall((about or "").partition("\n\n")[0]):
            fields.setdefault(field.lower(), value)
        if "name" in fields and (name := one_name(fields["name"])) not in seen:
            seen.add(name)
            yield name, fields.get("version"), each


def fingerprint(of: Distribution) -> str | None:
    """Return a hash of a package's content, equal wherever the same wheel is installed."""
    record = of.read_text("RECORD")
    if record is None or _is_working_copy(of):
        return None
    return fingerprint_of(record)


def fingerprint_of(record: str) -> str:
    """Return the hash of a wheel's or an installed package's ``RECORD``.

    Files without a hash are not counted, as the record itself and what Python compiled; nor those
    outside the folder of packages, whose first line says where Python is.
    """
    lines = sorted(f"{name} {digest}" for name, digest in _counted(record))
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def _counted(record: str) -> Iterator[tuple[str, str]]:
    for name, digest, *_ in filter(None, csv.reader(record.splitlines())):
        folder, _, file = name.replace("\\", "/").rpartition("/")
        from_installer = folder.endswith(".dist-info") and file in OF_THE_INSTALLER
        outside = name.startswith((".", "/")) or ".data/" in name
        if digest and not from_installer and not outside:
            yield f"{folder}/{file}", digest


def _is_working_copy(of: Distribution) -> bool:
    source = json.loads(of.read_text("direct_url.json") or "{}")
    return bool(source.get("dir_info", {}).get("editable"))


def changes(before: Environment, now: Environment) -> list[str]:
    """Return one line for every package that is installed differently; none if there is none.

    On another system packages have other files under the same version: only versions are compared.
    """
    lines = [
        f"{word} was {before[key]}, is {now[key]}"
        for key, word in (("system", "the system"), ("python", "Python"))
        if before[key] != now[key]
    ]
    alike = before["system"] == now["system"]
    for name in sorted({*before["packages"], *now["packages"]}):
        old, new = before["packages"].get(name), now["packages"].get(name)
        if new is None:
            lines.append(f"{name} {old['version']} is not installed")
        elif old is None:
            lines.append(f"{name} {new['version']} is new")
        elif old["version"] != new["version"]:
            lines.append(f"{name} was {old['version']}, is {new['version']}")
        elif alike and _other_files(old["sha256"], new["sha256"]):
            lines.append(
                f"{name} {new['version']} has other files than when the study was approved"
            )
    return lines


def _other_files(before: str | None, now: str | None) -> bool:
    return before is not None and now is not None and before != now
