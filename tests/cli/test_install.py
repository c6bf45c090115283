"""A lean installation reads, checks, exports and simulates, and says what the rest needs."""

import subprocess
import sys
from pathlib import Path

import pytest
from fresh_environment import run

import labcrane
from labcrane.testing import discover, load

ROOT = Path(__file__).parents[2]
BEFORE = ROOT / "tests" / "recording" / "before"
AIMING = ROOT / "protocols" / "aiming" / "protocol.yaml"

ONLY = """
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in sys.argv[1].split(","):
            raise ModuleNotFoundError(f"no {name}", name=name)

sys.meta_path.insert(0, Refuse())
import labcrane
session = labcrane.open_recording(sys.argv[2]).session(1)
print(len(session.streams["state"].data), len(session.events), len(session.questionnaires))
"""


def installed() -> set[str]:
    """Return what can be imported here, but for Python's own and what reads a recording."""
    from importlib.metadata import packages_distributions

    needed = {"labcrane", "lazy_loader", "numpy", "h5py", "pandas", "dateutil", "pytz", "six"}
    kept = {*needed, "packaging", "tzdata"}
    return {name for name in packages_distributions() if name not in kept and name.isidentifier()}


def test_a_recording_opens_with_numpy_h5py_and_pandas_alone(tmp_path: Path) -> None:
    import gzip

    path = tmp_path / "P001.h5"
    path.write_bytes(gzip.decompress((BEFORE / "P001-SIMULATED.h5.gz").read_bytes()))
    refused = ",".join(sorted(installed()))
    assert "pydantic" in refused
    done = run(sys.executable, "-c", ONLY, refused, path)
    assert done.stdout == "454 72 11\n", done.stderr


def study(folder: Path, **parts: str) -> Path:
    """Return a protocol that uses other parts."""
    text = (BEFORE / "protocol.yaml").read_text(encoding="utf-8")
    for key, part in parts.items():
        lines = [f"{key}: {part}" if x.startswith(f"{key}:") else x for x in text.splitlines()]
        text = "\n".join(lines)
    path = folder / "protocol.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("key", "part", "module"),
    [
        ("input", "{use: dual_joystick}", "pygame"),
        ("input", "{use: gateway}", "pylsl"),
        ("dynamics", "{use: bullet_crane}", "pybullet"),
        ("dynamics", "{use: mujoco_crane}", "mujoco"),
    ],
)
def test_a_part_that_is_missing_is_named_with_its_line_and_the_extra(
    key: str, part: str, module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    path = study(tmp_path, **{key: part})
    lines = path.read_text(encoding="utf-8").splitlines()
    at = 1 + lines.index(f"{key}: {part}")
    chosen = load(path, discover(), recorded=True)  # whatever axes the scheme is mapped to
    with pytest.raises(labcrane.ProtocolError) as refused:
        chosen.check_installed()
    name = part.split()[1].strip("{},")
    assert f"{path}:{at}:{lines[at - 1].index(part) + 7}: " in str(refused.value)
    assert f"{name!r} needs {module}, which is not installed: pip install" in str(refused.value)
    assert "'labcrane[lab]'" in str(refused.value)


def test_every_module_of_a_laboratory_is_asked_for_by_the_offer_that_imports_it() -> None:
    """What a bundled plugin imports, and the lean installation has not, stands in ``needs``."""
    lean = {"numpy", "pydantic", "scipy", "pandas", "pyarrow", "h5py", "typer", "rich", "ruamel"}
    offers = discover()
    for role, found in offers.offers.items():
        for name, offer in found.items():
            plugin = offer.build.__module__.partition(".")[0]
            folder = ROOT / "plugins" / plugin
            used = {
                module
                for path in folder.rglob("*.py")
                for module in ("pygame", "mujoco", "pybullet", "pyo", "panda3d", "cantools")
                if f"import {module}" in path.read_text(encoding="utf-8")
                or f"from {module}" in path.read_text(encoding="utf-8")
            }
            declared = {m for each in found.values() for m in each.needs} - lean
            every = {
                module
                for others in offers.offers.values()
                for each in others.values()
                if each.build.__module__.partition(".")[0] == plugin
                for module in each.needs
            }
            if plugin == "labcrane_dmd":  # a command of it asks before it begins, see its tests
                used -= {"cantools"}
            assert used <= every, (role, name, declared)


@pytest.fixture(scope="module")
def lean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the Python of an environment with ``pip install .`` and nothing else."""
    folder = tmp_path_factory.mktemp("lean")
    made = run(sys.executable, "-m", "venv", folder / "venv")
    assert made.returncode == 0, made.stderr
    python = folder / "venv" / "bin" / "python"
    done = run(python, "-m", "pip", "install", "-q", ROOT)
    assert done.returncode == 0, done.stderr
    return python


@pytest.mark.long
def test_a_lean_installation_does_its_part_and_names_the_extra_for_the_rest(
    lean: Path, tmp_path: Path
) -> None:
    def labcrane_command(*arguments: object) -> "subprocess.CompletedProcess[str]":
        return run(lean, "-m", "labcrane", *arguments, cwd=tmp_path)

    kinematic = study(tmp_path)
    fine = labcrane_command("check", kinematic, "--simulated")
    assert fine.returncode == 0, fine.stderr
    who = ("--participant", "P001", "--data", tmp_path / "data")
    done = labcrane_command("run", kinematic, "--simulate", "--fast", *who)
    assert done.returncode == 0, done.stderr
    recording = tmp_path / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5"
    counted = (
        "import labcrane, sys; print(len(labcrane.open_recording(sys.argv[1]).session(1).trials))"
    )
    assert run(lean, "-c", counted, recording).stdout == "3\n"
    for to in ("tables", "psychds", "matlab", "xdf"):
        out = tmp_path / to
        exported = labcrane_command(
            "export", tmp_path / "data", "--to", to, "--include", "simulated", "--out", out
        )
        assert exported.returncode == 0, exported.stderr
        assert any(out.iterdir())
    again = labcrane_command("replay", recording)
    assert again.stdout == "454 ticks replayed, every number the same bit for bit\n"

    extra = "pip install 'labcrane[lab]'"
    refused = labcrane_command("check", kinematic)
    assert refused.returncode == 2
    assert f"'dual_joystick' needs pygame, which is not installed: {extra}" in refused.stderr
    refused = labcrane_command("check", AIMING)
    for module in ("pygame", "mujoco", "pyo", "panda3d"):
        assert f"needs {module}, which is not installed: {extra}" in refused.stderr
    refused = labcrane_command("run", kinematic, "--participant", "P002")
    assert f"needs pygame, which is not installed: {extra}" in refused.stderr
    refused = labcrane_command("report", tmp_path / "data", "--include", "simulated")
    assert f"which is not installed: {extra}" in refused.stderr
    assert "Traceback" not in refused.stderr


def test_a_camera_without_its_library_is_named_with_its_line_and_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    path = study(tmp_path)
    lines = path.read_text(encoding="utf-8").splitlines()
    lines.append("recordings: {face: {use: camera, device: /dev/video0, consent: we film}}")
    path.write_text("\n".join(lines), encoding="utf-8")
    chosen = load(path, discover(), recorded=True)
    with pytest.raises(labcrane.ProtocolError) as refused:
        chosen.check_installed(simulated=True)
    at = f"{path}:{len(lines)}:"
    assert str(refused.value).startswith(at)
    assert str(refused.value).endswith(
        "capture 'camera' needs av, which is not installed: pip install 'labcrane[video]'"
    )
    chosen.check_installed(simulated=True, feedback=False)  # nothing is filmed as fast as it goes
