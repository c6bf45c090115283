"""A bundle installs a study where there is no network, and the study runs there as here."""

import json
import platform
import re
import shutil
import sys
import sysconfig
import venv
import zipfile
from hashlib import sha256
from importlib.metadata import distribution
from pathlib import Path

import h5py
import numpy as np
import pytest
from fresh_environment import run
from governed import PERSON, put_stand_in
from needs import needs

from labcrane.approval import bundle_install
from labcrane.approval.bundle import _checked_wheels, bundle
from labcrane.approval.materials import materials
from labcrane.errors import ProtocolError
from labcrane.protocol.study import load
from labcrane.registry.registry import discover

ROOT = Path(__file__).parents[2]
PROTOCOL = (ROOT / "tests" / "recording" / "before" / "protocol.yaml").read_text(encoding="utf-8")
ANSWERED = """\
environment: refuse
expected: [scheme.map.slew, scheme.map.wrist, feedback.ball]
"""
"""What is locked has no open warnings."""

CALM = ["--participant", "P001", "--simulate", "--fast"]


def study(folder: Path) -> Path:
    folder.mkdir()
    path = folder / "protocol.yaml"
    put_stand_in(folder)
    text = PROTOCOL.replace("{use: dual_joystick}", PERSON)
    path.write_text(ANSWERED + text, encoding="utf-8")
    (folder / "consent.txt").write_text("I take part.\n", encoding="utf-8")
    return path


def datasets(file: Path) -> dict[str, np.ndarray]:
    """Return every dataset of a participant file."""
    found: dict[str, np.ndarray] = {}

    def keep(name: str, node: object) -> None:
        if isinstance(node, h5py.Dataset):
            found[name] = np.asarray(node[()])

    with h5py.File(file) as opened:
        opened.visititems(keep)
    return found


@pytest.mark.long
@needs("networks")
def test_a_bundle_is_installed_without_network_and_gives_the_same_bits(tmp_path: Path) -> None:
    venv.create(tmp_path / "here", with_pip=True)
    here = tmp_path / "here" / "bin" / "python"
    done = run(here, "-m", "pip", "install", "-q", ROOT, "pylsl")
    assert done.returncode == 0, done.stderr
    protocol = study(tmp_path / "study")
    approval = ["--board", "B", "--reference", "1", "--valid-until", "2999-01-01"]
    consent = ["--consent", protocol.parent / "consent.txt"]
    done = run(here, "-m", "labcrane", "approve", protocol, *approval, *consent)
    assert done.returncode == 0, done.stderr
    done = run(here, "-m", "labcrane", "bundle", protocol, tmp_path / "stick")
    assert done.returncode == 0, done.stderr

    there = tmp_path / "there"
    done = run("unshare", "-rn", sys.executable, tmp_path / "stick" / "install.py", there)
    assert done.returncode == 0, done.stderr
    assert "is fine" in done.stdout
    python, moved = there / "bin" / "python", there / "study" / "protocol.yaml"
    for each, path in ((here, protocol), (python, moved)):
        done = run(each, "-m", "labcrane", "run", path, *CALM)
        assert done.returncode == 0, done.stderr
    name = Path("data") / "P001-SIMULATED" / "P001-SIMULATED.h5"
    before, after = datasets(protocol.parent / name), datasets(moved.parent / name)
    assert before.keys() == after.keys()
    assert len(before["ses-01/state/tip/position/x"]) > 100
    for key, values in before.items():
        assert values.tobytes() == after[key].tobytes(), key

    other = ["install", "-q", "--no-deps", "pluggy==1.5.0"]
    done = run(here, "-m", "pip", "--python", python, *other)
    assert done.returncode == 0, done.stderr
    person = [python, "-m", "labcrane", "run", moved, "--participant", "P001", "--no-page"]
    done = run(*person)
    assert done.returncode == 2
    assert "and specifies environment: refuse:" in done.stderr
    assert re.search(r"^  pluggy was \S+, is 1\.5\.0$", done.stderr, re.MULTILINE)


def test_a_file_of_a_bundle_that_was_changed_is_named_before_anything_is_installed(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "stick"
    folder.mkdir()
    shutil.copy(bundle_install.__file__, folder / "install.py")
    here = {"system": sysconfig.get_platform(), "python": platform.python_version()}
    (folder / "bundle.json").write_text(json.dumps({"protocol": "study/a.yaml", **here}))
    (folder / "a.whl").write_bytes(b"a wheel")
    digest = sha256(b"a wheel").hexdigest()
    (folder / "SHA256SUMS").write_text(f"{digest}  a.whl\n{digest}  b.whl\n")
    done = run(sys.executable, folder / "install.py", tmp_path / "there")
    assert (done.returncode, done.stderr) == (1, "b.whl is missing; copy the bundle again\n")
    (folder / "SHA256SUMS").write_text(f"{digest}  a.whl\n")
    (folder / "a.whl").write_bytes(b"A wheel")
    done = run(sys.executable, folder / "install.py", tmp_path / "there")
    assert done.stderr == "a.whl is damaged or was changed; copy the bundle again\n"
    (folder / "bundle.json").write_text(
        json.dumps({"protocol": "study/a.yaml", "system": "another-system", "python": "3.11.9"})
    )
    done = run(sys.executable, folder / "install.py", tmp_path / "there")
    assert done.stderr.startswith(
        "this bundle is for Python 3.11.9 on another-system; here is Python"
    )
    assert not (tmp_path / "there").exists()


def test_neither_data_beside_the_study_nor_the_labs_key_are_in_its_bundle_or_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    protocol = study(tmp_path / "study")
    with protocol.open("a", encoding="utf-8") as file:
        file.write("page: {certificate: lab.pem, key: lab.key, logo: crane.svg}\n")
    for name in ("lab.pem", "lab.key", "crane.svg"):
        (protocol.parent / name).write_text(f"<svg>what is in {name}\n", encoding="utf-8")
    (protocol.parent / "data").mkdir()
    (protocol.parent / "data" / "P001.h5").write_bytes(b"somebody")
    registry = discover(study=protocol)
    monkeypatch.setattr("labcrane.approval.bundle._fetch", lambda *_: None)
    monkeypatch.setattr("labcrane.approval.bundle._checked_wheels", lambda *_: {})
    monkeypatch.setattr(
        "labcrane.approval.bundle.environment",
        lambda: {"system": "x", "python": "3.11", "packages": {}},
    )
    assert "what is in lab" not in str(materials(load(protocol, registry), registry))
    made = bundle(load(protocol, registry), registry, tmp_path / "stick")
    assert made.files == ("crane.svg", "plugins/person.py", "protocol.yaml")
    there = {path.name for path in (tmp_path / "stick").rglob("*") if path.is_file()}
    assert there == {
        "protocol.yaml",
        "person.py",
        "crane.svg",
        "requirements.txt",
        "bundle.json",
        "install.py",
        "SHA256SUMS",
    }
    with pytest.raises(ProtocolError, match="is there already; give the bundle a new folder"):
        bundle(load(protocol, registry), registry, tmp_path / "stick")


def packed(folder: Path) -> Path:
    """Return a bundle of a study that has a plugin, as far as it is looked at before it is used."""
    (folder / "study" / "plugins").mkdir(parents=True)
    shutil.copy(bundle_install.__file__, folder / "install.py")
    here = {"system": sysconfig.get_platform(), "python": platform.python_version()}
    (folder / "bundle.json").write_text(json.dumps({"protocol": "study/a.yaml", **here}))
    (folder / "study" / "plugins" / "own.py").write_text("own = 1")
    files = [path for path in folder.rglob("*") if path.is_file()]
    lines = [
        f"{sha256(each.read_bytes()).hexdigest()}  {each.relative_to(folder)}" for each in files
    ]
    (folder / "SHA256SUMS").write_text("\n".join(lines) + "\n")
    return folder


SPOILT = {
    "a plugin beside": (
        "study/plugins/evil.py",
        "import os",
        "study/plugins/evil.py is not part",
    ),
    "a wheel beside": (
        "wheels/a.whl",
        "a wheel",
        "wheels/a.whl is not part of this bundle; remove",
    ),
    "half an about": ("bundle.json", '{"python": "3.1', "bundle.json is missing or damaged (JSOND"),
    "an about of a list": ("bundle.json", "[]", "bundle.json is missing or damaged (TypeError"),
    "a deep about": ("bundle.json", "[" * 100_000, "bundle.json is missing or damaged (Recursion"),
    "no texts": (
        "bundle.json",
        '{"python": 3, "system": 1, "protocol": []}',
        "bundle.json is damaged: it has no texts",
    ),
    "another place": (
        "bundle.json",
        '{"python": "3", "system": "1", "protocol": "../a.yaml"}',
        "bundle.json names a protocol outside of the bundle",
    ),
    "sums that are none": ("SHA256SUMS", "\x00" * 9, " is missing; copy the bundle again"),
}


@pytest.mark.parametrize("case", SPOILT.values(), ids=SPOILT)
def test_a_bundle_with_more_or_less_in_it_than_was_packed_is_not_installed(
    case: tuple[str, str, str], tmp_path: Path
) -> None:
    name, text, why = case
    folder = packed(tmp_path / "stick")
    (folder / ".DS_Store").write_text("of a disk")
    assert list(bundle_install._wrong(folder, tmp_path / "there")) == []
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_text(text)
    done = run(sys.executable, folder / "install.py", tmp_path / "there")
    assert done.returncode == 1
    assert why in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "there").exists()


@needs("links")
def test_a_link_in_a_bundle_is_refused(tmp_path: Path) -> None:
    folder = packed(tmp_path / "stick")
    (folder / "study" / "more.py").symlink_to("plugins/own.py")
    [why] = bundle_install._wrong(folder, tmp_path / "there")
    assert why == "study/more.py is a link, which bundles do not contain; copy the bundle again"


def test_a_package_with_other_files_than_the_wheel_of_an_index_is_refused(tmp_path: Path) -> None:
    here = distribution("pluggy")
    with zipfile.ZipFile(tmp_path / f"pluggy-{here.version}-py3-none-any.whl", "w") as wheel:
        wheel.writestr(f"pluggy-{here.version}.dist-info/RECORD", "pluggy/__init__.py,sha256=a,1\n")
    with pytest.raises(ProtocolError, match=rf"--no-deps pluggy=={here.version}$"):
        _checked_wheels([here], tmp_path)
