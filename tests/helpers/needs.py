"""Programs, libraries and rights that some tests need, and what to install for each.

A test marked ``@needs("Rscript", "afex")`` is skipped where one of them is missing, and its reason
says what to install. Inside a test or fixture, ``need`` does the same. With
``LABCRANE_SKIP_NOTHING`` set, as in the gate's full stage, what is missing is a failure.
"""

import ctypes
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest

SKIP_NOTHING = "LABCRANE_SKIP_NOTHING"
UNSHARE = ["unshare", "--user", "--map-root-user", "--mount"]
REAL_TIME_PRIORITY = 70
SUPERUSER = f"{os.environ.get('PATH', os.defpath)}:/usr/sbin:/sbin"

PACKAGES = {
    "Rscript": "r-base-core",
    "octave-cli": "octave",
    "chromium": "chromium",
    "chromedriver": "chromium-driver",
    "soffice": "libreoffice-calc-nogui",
    "Xvfb": "xvfb",
    "xdotool": "xdotool",
    "xrandr": "x11-xserver-utils",
    "xwininfo": "x11-utils",
    "jackd": "jackd2",
    "jack_wait": "jackd2",
    "gcc": "gcc libc6-dev",
    "g++": "g++",
    "sha256sum": "coreutils",
    "ufw": "ufw",
    "unshare": "util-linux",
}
"""Programs, and the Debian packages that they are in."""

R_PACKAGES = {
    "afex": "r-cran-afex",
    "emmeans": "r-cran-emmeans",
    "hdf5r": "r-cran-hdf5r",
    "rhdf5": "r-bioc-rhdf5",
}
"""Packages of R, and the Debian packages that they are in."""

LIBRARIES = {"libX11.so.6": "libx11-6", "libGL.so.1": "libgl1", "libEGL.so.1": "libegl1"}
"""Libraries, and the Debian packages that they are in."""


def _r_has(package: str) -> bool:
    if shutil.which("Rscript") is None:
        return False
    asked = f"quit(status = !requireNamespace('{package}', quietly = TRUE))"
    done = subprocess.run(["Rscript", "-e", asked], capture_output=True, check=False)
    return done.returncode == 0


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _succeeds(*command: str) -> bool:
    try:
        return subprocess.run(command, capture_output=True, check=False).returncode == 0
    except OSError:
        return False


def node_module(name: str) -> Path | None:
    """Return the folder of a module of Node.js, where npm has put it for everybody."""
    folders = os.environ.get("NODE_PATH", "").split(os.pathsep)
    folders += ["/usr/local/lib/node_modules", "/usr/lib/node_modules"]
    return next((Path(each, name) for each in folders if each and Path(each, name).is_dir()), None)


def _makes_links() -> bool:
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder, "link")
        try:
            link.symlink_to(folder, target_is_directory=True)
        except OSError:
            return False
        return link.is_symlink()


def _may_run_in_real_time() -> bool:
    asked = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, "
    asked += f"os.sched_param({REAL_TIME_PRIORITY}))"
    return _succeeds(sys.executable, "-c", asked)  # in a process of its own: it would stay so


GRAPHICS = tuple(LIBRARIES)
"""What any picture is drawn with, a hidden one by the software renderer too."""

OTHERS: dict[str, tuple[Callable[[], bool], str]] = {
    "mounts": (
        lambda: _succeeds(*UNSHARE, "sh", "-c", "mount -t tmpfs none /mnt"),
        "allow user namespaces with mounts",
    ),
    "clocks": (
        lambda: _succeeds("unshare", "-r", "--time", "true"),
        "apt install util-linux; allow user namespaces with clocks",
    ),
    "networks": (
        lambda: _succeeds("unshare", "-rn", "true"),
        "apt install util-linux; allow user namespaces with networks",
    ),
    "/dev/shm": (lambda: Path("/dev/shm").is_dir(), "mount a tmpfs there"),
    "real-time priorities": (_may_run_in_real_time, "docs/lab.md says how a user is allowed them"),
    "links": (_makes_links, "Windows has them for administrators, Wine has none for Python"),
    "named pipes": (lambda: hasattr(os, "mkfifo"), "Windows has others"),
    "fork": (lambda: hasattr(os, "fork"), "Windows has none"),
    "terminals": (lambda: find_spec("pty") is not None, "Windows has no pseudo-terminals"),
    "limits of files": (lambda: find_spec("resource") is not None, "Windows has none"),
    "permissions": (lambda: sys.platform != "win32", "Windows has access lists instead"),
    "locales": (
        lambda: bool(shutil.which("localedef")) and Path("/usr/share/i18n/locales/de_DE").is_file(),
        "apt install locales",
    ),
    "Linux": (lambda: sys.platform == "linux", "it is about Linux's own calls"),
    "root": (lambda: os.geteuid() == 0, "only root may ask what a firewall would do"),
    "pybullet": (lambda: find_spec("pybullet") is not None, "Python 3.11: it has no later wheels"),
    "mujoco": (lambda: find_spec("mujoco") is not None, "pip install mujoco"),
    "mne": (lambda: find_spec("mne") is not None, "pip install 'labcrane[eeg]'"),
    "mne_bids": (lambda: find_spec("mne_bids") is not None, "pip install mne-bids"),
    "pybv": (lambda: find_spec("pybv") is not None, "pip install pybv"),
    "bids-validator-deno": (
        lambda: shutil.which("bids-validator-deno", path=Path(sys.executable).parent) is not None,
        "pip install bids-validator-deno",
    ),
    "axe-core": (
        lambda: node_module("axe-core") is not None,
        "npm install --global axe-core@4.14.1",  # as .ci/run has it
    ),
    "questplus": (lambda: find_spec("questplus") is not None, "pip install questplus"),
    "pupil_apriltags": (
        lambda: find_spec("pupil_apriltags") is not None,
        "pip install pupil-apriltags",
    ),
    "numba": (lambda: find_spec("numba") is not None, "pip install 'labcrane[fast]'"),
    "alsa.conf": (
        lambda: Path("/usr/share/alsa/alsa.conf").exists(),
        "apt install libasound2-data",  # PortAudio ends the process without it
    ),
    "no sound card": (lambda: not Path("/dev/snd").exists(), "this computer has one"),
}
"""Whatever else there may be: how it is found, and what to do where it is not."""


@cache
def missing(name: str) -> str | None:
    """Return what to do for something that is not there, None when it is."""
    if name in OTHERS:
        there, remedy = OTHERS[name]
        return None if there() else remedy
    if name in R_PACKAGES:
        return None if _r_has(name) else f"apt install {R_PACKAGES[name]}"
    if name in LIBRARIES:
        return None if _loads(name) else f"apt install {LIBRARIES[name]}"
    there_is = shutil.which(name, path=SUPERUSER)
    return None if there_is else f"apt install {PACKAGES[name]}"


def need(*names: str) -> None:
    """Skip the test that is running unless all of it is there; fail where nothing is skipped."""
    lacking = {name: remedy for name in names if (remedy := missing(name)) is not None}
    if not lacking:
        return
    reason = "needs " + ", ".join(f"{name} ({remedy})" for name, remedy in lacking.items())
    if os.environ.get(SKIP_NOTHING):
        pytest.fail(f"{reason}; {SKIP_NOTHING} is set, so it has to be there", pytrace=False)
    pytest.skip(reason)


def needs(*names: str) -> pytest.MarkDecorator:
    """Mark a test that is skipped, before its fixtures are made, unless all of it is there."""
    known = {*OTHERS, *R_PACKAGES, *LIBRARIES, *PACKAGES}
    if unknown := set(names) - known:
        raise ValueError(f"nothing is known of {sorted(unknown)}; add it to {__file__}")
    return pytest.mark.needs(*names)


def not_tried(reasons: Iterable[str]) -> list[str]:
    """Return what a run says at its end of tests that were skipped for these reasons."""
    counts: dict[str, int] = {}
    packages: set[str] = set()
    for reason in reasons:
        words = reason.removeprefix("Skipped: ")
        counts[words] = counts.get(words, 0) + 1
        packages.update(" ".join(re.findall(r"\(apt install ([^)]+)\)", words)).split())
    lines = [f"{count:4} not tried: {reason}" for reason, count in sorted(counts.items())]
    if packages:
        lines.append(f"to try them: apt install {' '.join(sorted(packages))}")
    return lines
