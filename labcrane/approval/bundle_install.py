"""Installation of a study's bundle on a computer without network: ``python install.py FOLDER``.

A copy of this module lies in every bundle, as ``install.py``; it needs Python and its pip alone.
"""

import hashlib
import json
import platform
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path

ABOUT, SUMS = "bundle.json", "SHA256SUMS"
OF_A_DISK = (".DS_Store", "Thumbs.db", "desktop.ini")
"""Files that operating systems add to folders."""


def main(arguments: list[str]) -> int:
    """Install the bundle that contains this file; return 0, or 1 after printing why not."""
    bundle = Path(__file__).resolve().parent
    if len(arguments) != 1:
        print(f"write: {Path(sys.executable).name} install.py FOLDER, the folder to install into")
        return 1
    target = Path(arguments[0]).resolve()
    for wrong in _wrong(bundle, target):
        print(wrong, file=sys.stderr)
        return 1
    python = _environment(target)
    options = ["--no-index", "--no-deps", "--require-hashes", "--disable-pip-version-check", "-q"]
    wheels = ["--find-links", str(bundle / "wheels"), "-r", str(bundle / "requirements.txt")]
    pip = [sys.executable, "-m", "pip", "--python", str(python)]
    if (done := subprocess.run([*pip, "install", *options, *wheels], check=False)).returncode:
        print(f"pip could not install it; remove {target} and try again", file=sys.stderr)
        return done.returncode
    shutil.copytree(bundle / "study", target / "study")
    protocol = target / json.loads((bundle / ABOUT).read_text(encoding="utf-8"))["protocol"]
    checked = subprocess.run([python, "-m", "labcrane", "check", protocol], check=False)
    if checked.returncode == 0:
        print(f"installed; run the study with: {python} -m labcrane run {protocol}")
    return checked.returncode


def _wrong(bundle: Path, target: Path) -> Iterator[str]:
    """Yield why the bundle cannot be installed here; nothing when it can."""
    about = _about(bundle)
    if isinstance(about, str):
        yield about
        return
    here = {"system": sysconfig.get_platform(), "python": platform.python_version()}
    if _kind(about) != _kind(here):
        yield (
            f"this bundle is for Python {about['python']} on {about['system']}; here is Python "
            f"{here['python']} on {here['system']}: make one on a computer of this kind"
        )
    if target.exists():
        yield f"{target} is there already; name a new folder"
    yield from _other_files(bundle)


def _other_files(bundle: Path) -> Iterator[str]:
    """Yield each file that differs from the packed one, is missing, or was added."""
    listed = {(bundle / SUMS).resolve()}
    try:
        lines = (bundle / SUMS).read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:
        yield f"{SUMS} cannot be read ({error}); copy the bundle again"
        return
    for line in lines:
        digest, _, name = line.partition("  ")
        path = bundle / name
        listed.add(path.resolve())
        if not path.is_file():
            yield f"{name} is missing; copy the bundle again"
        elif hashlib.sha256(path.read_bytes()).hexdigest() != digest:
            yield f"{name} is damaged or was changed; copy the bundle again"
    # A plugin that was added to the study's would be run with it.
    for path in sorted(bundle.rglob("*")):
        name = path.relative_to(bundle).as_posix()
        if path.is_symlink():
            yield f"{name} is a link, which bundles do not contain; copy the bundle again"
        elif path.is_file() and path.resolve() not in listed and path.name not in OF_A_DISK:
            yield f"{name} is not part of this bundle; remove it, or copy the bundle again"


def _about(bundle: Path) -> "dict[str, str] | str":
    """Return the bundle's description, or why it cannot be read."""
    try:
        about = json.loads((bundle / ABOUT).read_text(encoding="utf-8"))
        texts = {name: about[name] for name in ("python", "system", "protocol")}
    except (OSError, ValueError, LookupError, TypeError, RecursionError) as error:
        why = f"{type(error).__name__}: {error}"
        return f"{ABOUT} is missing or damaged ({why}); copy the bundle again"
    inside = bundle.resolve()
    if not all(isinstance(text, str) for text in texts.values()):
        return f"{ABOUT} is damaged: it has no texts; copy the bundle again"
    if not (bundle / texts["protocol"]).resolve().is_relative_to(inside):
        return f"{ABOUT} names a protocol outside of the bundle; copy the bundle again"
    return texts


def _kind(of: dict[str, str]) -> tuple[str, list[str]]:
    """Return what wheels depend on: the system, and Python's first two numbers."""
    return of["system"], of["python"].split(".")[:2]


def _environment(target: Path) -> Path:
    """Make an environment without pip, which the bundle has if it is wanted; return its Python."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(target)], check=True)
    windows = target / "Scripts" / "python.exe"
    return windows if windows.exists() else target / "bin" / "python"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
