"""A wheel of what is installed holds the same files, and is made of nothing else."""

import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from importlib.metadata import Distribution, PathDistribution, distribution
from pathlib import Path

import pytest

from labcrane.approval.bundle import _checked_wheels
from labcrane.approval.environment import fingerprint
from labcrane.approval.repacked import repacked
from labcrane.errors import ProtocolError

PACKAGES = ("pip", "pluggy", "h5py", "ruamel.yaml", "pytest")
"""With programs, plain, of a compiled library, in a namespace, with a name beside its own."""


def files(package: Distribution) -> dict[str, bytes]:
    """Return what of a package is in the folder of packages, but for what Python compiled."""
    paths = [str(each) for each in package.files or [] if each.suffix != ".pyc"]
    return {
        path: Path(str(package.locate_file(path))).read_bytes()
        for path in paths
        if not path.startswith("..")
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", PACKAGES)
def test_an_installer_makes_of_it_the_package_that_is_installed(name: str, tmp_path: Path) -> None:
    here = distribution(name)
    wheel = repacked(here, tmp_path)
    there = tmp_path / "there"
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-index", "--no-deps", "--no-compile"]
    subprocess.run([*pip, "--target", there, wheel], check=True)
    (info,) = (each for each in there.glob("*.dist-info"))
    installed = PathDistribution(info)
    assert fingerprint(installed) == fingerprint(here)
    mine, theirs = files(here), files(installed)
    own = {"INSTALLER", "REQUESTED", "RECORD", "direct_url.json"}
    for path in mine.keys() | theirs.keys():
        if Path(path).name not in own and not path.startswith("bin/"):
            assert mine[path] == theirs[path], path


def test_a_package_with_other_files_than_the_wheel_of_an_index_is_packed(tmp_path: Path) -> None:
    here = distribution("pluggy")
    right = repacked(here, tmp_path).read_bytes()
    other = tmp_path / "index" / f"pluggy-{here.version}-py3-none-any.whl"
    other.parent.mkdir()
    with zipfile.ZipFile(other, "w") as wheel:
        wheel.writestr(f"pluggy-{here.version}.dist-info/RECORD", "pluggy/__init__.py,sha256=a,1\n")
    wheels = _checked_wheels([here], other.parent)
    assert wheels["pluggy"].read_bytes() == right
    assert list(other.parent.iterdir()) == [wheels["pluggy"]]


def edit(root: Path) -> None:
    (root / "pluggy" / "_hooks.py").write_text("# edited\n")


def remove(root: Path) -> None:
    (root / "pluggy" / "_hooks.py").unlink()


def put_outside(root: Path) -> None:
    (record,) = root.glob("*.dist-info/RECORD")
    record.write_text(record.read_text() + "../../../share/man/pluggy.1,sha256=a,1\n")


def forget(root: Path) -> None:
    (record,) = root.glob("*.dist-info/RECORD")
    record.unlink()


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (edit, "pluggy/_hooks.py of pluggy {} was changed after it was installed; reinstall it"),
        (remove, "pluggy/_hooks.py of pluggy {} is gone; reinstall it"),
        (
            put_outside,
            "../../../share/man/pluggy.1 of pluggy {} is outside the folder of packages; ",
        ),
        (forget, "no record states how pluggy {} was installed; install it"),
    ],
)
def test_what_is_not_as_it_was_installed_is_refused_by_its_name(
    damage: Callable[[Path], None], said: str, tmp_path: Path
) -> None:
    here = distribution("pluggy")
    root = tmp_path / "packages"
    for path in here.files or []:
        if not str(path).startswith(".."):
            (root / str(path)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(str(here.locate_file(path)), root / str(path))
    damage(root)
    (info,) = root.glob("*.dist-info")
    with pytest.raises(ProtocolError) as told:
        repacked(PathDistribution(info), tmp_path)
    assert str(told.value).startswith(said.format(here.version))
    assert not list(tmp_path.glob("*.whl"))
