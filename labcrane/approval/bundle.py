"""Bundle of a study: everything that another computer needs to install and run it without network.

It contains the wheels of all installed packages, the study with its lock and plugins, a list of
checksums, and ``install.py``, which needs only Python.
"""

import json
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import Distribution
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import urlsplit
from urllib.request import url2pathname

from labcrane.approval import bundle_install
from labcrane.approval.decision import otherwise_installed
from labcrane.approval.environment import (
    environment,
    fingerprint,
    fingerprint_of,
    installed,
    is_working_copy,
    source,
)
from labcrane.approval.lock import lock_path, read_lock
from labcrane.approval.materials import files_of_settings, study_files
from labcrane.errors import ProtocolError
from labcrane.files.atomic import UNFINISHED, copy, give_name, sha256, write_text
from labcrane.files.yaml import YamlFile
from labcrane.protocol.study import Study
from labcrane.registry.entry_points import one_name
from labcrane.registry.registry import Registry

WHEELS, STUDY, REQUIREMENTS = "wheels", "study", "requirements.txt"


@dataclass(frozen=True, slots=True)
class Bundle:
    """A folder that was written.

    Attributes
    ----------
    path
        Where it is.
    packages
        How many wheels are in it.
    files
        The study's files, relative to the folder of the protocol.
    size_mb
        Total size, in MB.
    """

    path: Path
    packages: int
    files: tuple[str, ...]
    size_mb: float


def bundle(study: Study, registry: Registry, folder: Path) -> Bundle:
    """Write a study's bundle into a new folder.

    Raises
    ------
    ProtocolError
        The installed packages are not those of the approval; the folder exists already; a wheel is
        not available.
    """
    if folder.exists():
        raise ProtocolError(f"{folder} is there already; give the bundle a new folder")
    files = tuple(_study_files(study, registry))
    if lock_path(study.path).exists():
        _check_installed(study)
    unfinished = folder.with_name(f".{folder.name}{UNFINISHED}")
    shutil.rmtree(unfinished, ignore_errors=True)  # left by a process that was killed
    unfinished.mkdir(parents=True)
    try:
        packages = _fill(unfinished, study, files)
        give_name(unfinished, folder)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) / 1e6
    return Bundle(folder, packages, files, size)


def _fill(folder: Path, study: Study, files: Sequence[str]) -> int:
    """Write everything into a folder; return the number of packages."""
    for name in files:
        copy(study.path.parent / name, folder / STUDY / name)
    packages = list(installed(sys.path))
    _fetch(packages, folder / WHEELS)
    wheels = _checked_wheels(packages, folder / WHEELS)
    here = environment()
    pins = [
        f"{name}=={package['version']} --hash=sha256:{sha256(wheels[name])}"
        for name, package in here["packages"].items()
    ]
    about = {
        "protocol": f"{STUDY}/{study.path.name}",
        "system": here["system"],
        "python": here["python"],
    }
    write_text(folder / REQUIREMENTS, "\n".join(pins) + "\n")
    write_text(folder / bundle_install.ABOUT, json.dumps(about, indent=1) + "\n")
    copy(Path(bundle_install.__file__), folder / "install.py")
    sums = [f"{digest}  {name}\n" for name, digest in _sums(folder)]
    write_text(folder / bundle_install.SUMS, "".join(sums))
    return len(wheels)


def _check_installed(study: Study) -> None:
    lock = read_lock(study.path)
    if others := otherwise_installed(lock):
        listed = "\n".join(f"  {each}" for each in others)
        raise ProtocolError(
            f"{study.path} was approved under {lock.approval['reference']!r} with other packages "
            f"than are installed here:\n{listed}\n"
            "make the bundle where it was approved, or record the change with labcrane amend"
        )


def _study_files(study: Study, registry: Registry) -> Iterator[str]:
    """Yield the study's files in the protocol's folder: neither data nor keys."""
    folder = study.path.parent
    found = {study.path, *study_files(YamlFile.read(study.path).data, folder)}
    found |= set(files_of_settings(study))
    found |= set(registry.local.values())
    if (lock := lock_path(study.path)).exists():
        found |= {lock, read_lock(study.path).consent}
        found |= set(folder.glob(f"{lock.stem}.[0-9]*.json"))
    for path in sorted(found):
        yield path.resolve().relative_to(folder.resolve()).as_posix()


def _fetch(packages: list[Distribution], wheels: Path) -> None:
    """Let pip fetch or build a wheel of each package, in exactly the installed version.

    Raises
    ------
    ProtocolError
        There is no pip, or it fails.
    """
    if find_spec("pip") is None:
        raise ProtocolError("a bundle is made by pip, which is not installed; python -m ensurepip")
    with TemporaryDirectory() as scratch:
        wanted = Path(scratch) / REQUIREMENTS
        wanted.write_text("\n".join(map(_wanted, packages)) + "\n", encoding="utf-8")
        command = ["-m", "pip", "wheel", "--no-deps", "--disable-pip-version-check", "-q"]
        done = subprocess.run(
            [sys.executable, *command, "--wheel-dir", str(wheels), "-r", str(wanted)],
            stderr=subprocess.PIPE,
            encoding="utf-8",
            check=False,
        )
    if done.returncode:
        raise ProtocolError(f"pip cannot make all wheels:\n{done.stderr.strip()[-2000:]}")


def _wanted(package: Distribution) -> str:
    """Return the requirement for pip: a version from an index, or the folder it came from."""
    url = source(package).get("url", "")
    if url.startswith("file:"):
        return str(Path(url2pathname(urlsplit(url).path)))
    return f"{package.name} @ {url}" if url else f"{package.name}=={package.version}"


def _checked_wheels(packages: list[Distribution], folder: Path) -> dict[str, Path]:
    """Return the wheel of each package by its name, with the installed files.

    Raises
    ------
    ProtocolError
        A wheel is missing, or has other files than those that are installed and approved: Debian's
        Python brings a setuptools and a pip of its own, which no index has.
    """
    others = list[str]()
    wheels = {one_name(path.name.partition("-")[0]): path for path in folder.glob("*.whl")}
    for package in packages:
        name = one_name(package.name)
        if name not in wheels:
            raise ProtocolError(f"pip made no wheel of {name} {package.version}; reinstall it")
        if not is_working_copy(package) and fingerprint(package) != _of_wheel(wheels[name]):
            others.append(f"{name}=={package.version}")
    if others:
        raise ProtocolError(
            f"the wheels of {', '.join(others)} have other files than those installed; install "
            f"them from the wheels: pip install --force-reinstall --no-deps {' '.join(others)}"
        )
    return wheels


def _of_wheel(path: Path) -> str:
    with zipfile.ZipFile(path) as wheel:
        (record,) = (name for name in wheel.namelist() if name.endswith(".dist-info/RECORD"))
        return fingerprint_of(wheel.read(record).decode("utf-8"))


def _sums(folder: Path) -> Iterator[tuple[str, str]]:
    for path in sorted(file for file in folder.rglob("*") if file.is_file()):
        yield path.relative_to(folder).as_posix(), sha256(path)
