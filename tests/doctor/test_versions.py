"""What a bug report needs: the lines of ``labcrane --version``."""

import subprocess
import sys
from pathlib import Path

import pylsl
import pytest
from programs import ran

from labcrane.doctor import versions

GIT = ("git", "-c", "user.name=a", "-c", "user.email=a@b", "-C")


def test_the_version_of_liblsl_is_that_of_the_library_and_not_of_pylsl() -> None:
    number = pylsl.library_version()
    said = versions.liblsl()
    assert said.startswith(f"liblsl {number // 100}.{number % 100} (git:")
    assert any(said in line for line in versions.versions())


@pytest.mark.parametrize(
    ("pylsl_py", "said"),
    [
        ("raise ModuleNotFoundError('No module named pylsl')", "liblsl: not installed"),
        ("raise RuntimeError('no liblsl.so')", "liblsl: cannot be loaded (no liblsl.so)"),
    ],
)
def test_an_installation_without_liblsl_says_so(pylsl_py: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "pylsl.py").write_text(pylsl_py)
    program = (
        "import sys; sys.path.insert(0, '.'); from labcrane.doctor.versions import versions; "
        "print(*versions())"
    )
    done = ran([sys.executable, "-c", program], cwd=tmp_path, check=True)
    assert said in done.stdout


def test_the_configuration_of_lsl_that_is_in_force_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = tmp_path / "lsl_api.cfg"
    monkeypatch.setenv("LSLAPICFG", str(config))
    assert versions.configuration() == f"LSLAPICFG is {config}, which does not exist"
    config.touch()
    assert versions.configuration() == f"LSLAPICFG is {config}"
    monkeypatch.delenv("LSLAPICFG")
    assert versions.configuration().startswith("LSLAPICFG is not set")


def test_a_clone_names_its_commit_and_whether_it_was_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert versions.commit(tmp_path) == "", "what is installed is no clone"
    (tmp_path / "loop.py").write_text("first")
    for words in (("init", "-q"), ("add", "."), ("commit", "-qm", "first"), ("tag", "v1")):
        subprocess.run([*GIT, str(tmp_path), *words], check=True)
    head = ran([*GIT, str(tmp_path), "rev-parse", "HEAD"], check=True).stdout
    assert versions.commit(tmp_path) == f", commit {head[:12]}"
    (tmp_path / "loop.py").write_text("second")
    assert versions.commit(tmp_path) == f", commit {head[:12]}-dirty"
    monkeypatch.setenv("PATH", "")
    assert (
        versions.commit(tmp_path) == ", a clone; its commit is unknown, since git is not installed"
    )


def test_a_clone_that_git_cannot_read_says_why(tmp_path: Path) -> None:
    (tmp_path / ".git").write_text("gitdir: /nowhere")
    assert "its commit is unknown (fatal: not a git repository" in versions.commit(tmp_path)
