"""What was installed when a study was approved is part of the approval."""

import sys
from importlib.metadata import distributions
from pathlib import Path

import pytest
from governed import GOVERNED, TODAY, Lab, edit

from labcrane import ProtocolError
from labcrane.approval.decision import amend
from labcrane.approval.environment import _environment, changes, environment, fingerprint_of
from labcrane.approval.lock import read_lock
from labcrane.registry.entry_points import one_name
from labcrane.session.eligibility import check_eligibility


def package(folder: Path, version: str, content: str = "1") -> str:
    """Write an installed package as pip leaves it; return where it can be imported from."""
    about = folder / f"winch-{version}.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: winch\nVersion: {version}\n")
    (about / "RECORD").write_text(
        f"winch/__init__.py,sha256={content},3\nwinch-{version}.dist-info/INSTALLER,sha256=z,4\n"
        f"winch-{version}.dist-info/RECORD,,\n"
    )
    return str(folder)


def see(monkeypatch: pytest.MonkeyPatch, folder: str) -> None:
    """Let what is installed in a folder be seen before all else."""
    # Not syspath_prepend: it calls what Python 3.11 for Windows cannot.
    monkeypatch.setattr(sys, "path", [folder, *sys.path])


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Lab:
    """Return a study that was approved while version 1.0 of a package was installed."""
    see(monkeypatch, package(tmp_path / "one", "1.0"))
    lab = Lab(tmp_path, GOVERNED.replace("rate_hz", "environment: refuse\nrate_hz"))
    lab.approve()
    lab.consent("P001")
    return lab


def test_everything_that_is_installed_is_in_the_lock_by_version_and_files(lab: Lab) -> None:
    locked = read_lock(lab.protocol).content["environment"]
    assert locked["packages"]["winch"]["version"] == "1.0"
    assert {"numpy", "h5py", "pandas", "pydantic"} <= locked["packages"].keys()
    assert len(locked["packages"]["numpy"]["sha256"]) == 64
    assert check_eligibility(lab.visit("P001")).otherwise_installed == ()


def test_names_and_versions_are_those_that_the_standard_library_reads(tmp_path: Path) -> None:
    for number, text in enumerate((
        "metadata-version: 2.1\nVERSION:  1.0rc1 \nNAME: Wire.Rope_2\n\nName: other\nVersion: 9\n",
        "Metadata-Version: 2.1\nName: hook\nVersion: 1\nName: second\nVersion: 2\n",
        "Metadata-Version: 2.1\nSummary: no name\n\nName: sheave\nVersion: 3\n",
    )):  # fmt: skip
        about = tmp_path / f"p{number}-1.dist-info"
        about.mkdir()
        (about / "METADATA").write_text(text, encoding="utf-8")
    path = [str(tmp_path), *sys.path]
    expected: dict[str, str] = {}
    for each in distributions(path=path):
        if each.metadata.get("Name"):
            expected.setdefault(one_name(each.metadata["Name"]), each.metadata["Version"])
    found = _environment(tuple(path))["packages"]
    assert {name: one["version"] for name, one in found.items()} == expected
    assert expected["wire-rope-2"] == "1.0rc1 "
    assert "sheave" not in found


def test_what_an_interrupted_installer_left_behind_is_no_package_and_stops_nobody(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = lab.folder / "left"
    for name in ("~inch-0.9.dist-info", "hoist-2.0.dist-info", "winch-2.0.egg-info"):
        (left / name).mkdir(parents=True)
    (left / "hoist-2.0.dist-info" / "METADATA").write_bytes(b"")
    see(monkeypatch, str(left))
    assert check_eligibility(lab.visit("P001")).otherwise_installed == ()
    assert environment() == read_lock(lab.protocol).content["environment"]


def test_another_version_of_a_package_is_refused_by_its_name(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    see(monkeypatch, package(lab.folder / "two", "2.0"))
    with pytest.raises(ProtocolError) as refused:
        check_eligibility(lab.visit("P001"))
    first, difference, todo = str(refused.value).splitlines()
    assert first.endswith("with other packages, and specifies environment: refuse:")
    assert difference == "  winch was 1.0, is 2.0"
    assert todo == (
        "install the approved packages; record the change with labcrane amend; or use --pilot"
    )


def test_the_same_version_with_other_files_is_refused(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    see(monkeypatch, package(lab.folder / "again", "1.0", content="2"))
    with pytest.raises(
        ProtocolError, match=r"winch 1\.0 has other files than when the study was approved"
    ):
        check_eligibility(lab.visit("P001"))


@pytest.mark.slow
def test_a_difference_is_in_the_record_where_the_protocol_does_not_refuse_it(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    edit(lab.protocol, "environment: refuse\n", "")
    amend(lab.study, lab.registry, lab.grant(), "any package will do", TODAY)
    see(monkeypatch, package(lab.folder / "two", "2.0"))
    admission = check_eligibility(lab.visit("P001"))
    assert admission.otherwise_installed == ("winch was 1.0, is 2.0",)
    assert admission.context["otherwise_installed"] == ["winch was 1.0, is 2.0"]


@pytest.mark.slow
def test_an_amendment_takes_what_is_installed_now(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    see(monkeypatch, package(lab.folder / "two", "2.0"))
    lock = amend(lab.study, lab.registry, lab.grant(), "a mended winch", TODAY)
    assert lock.amendments[-1]["changes"] == ["environment: winch was 1.0, is 2.0"]
    assert check_eligibility(lab.visit("P001")).otherwise_installed == ()


def test_a_lock_that_says_nothing_of_packages_is_still_good(lab: Lab) -> None:
    lock = read_lock(lab.protocol)
    del lock.content["environment"]
    lock.write()
    assert check_eligibility(lab.visit("P001")).otherwise_installed == ()


def test_on_another_system_versions_are_compared_and_files_are_not() -> None:
    here = environment()
    there = {
        "system": "another-system",
        "python": here["python"],
        "packages": {
            name: {"version": each["version"], "sha256": "0"}
            for name, each in here["packages"].items()
            if name != "numpy"
        },
    }
    version = here["packages"]["numpy"]["version"]
    assert changes(here, there) == [
        f"the system was {here['system']}, is another-system",
        f"numpy {version} is not installed",
    ]
    assert changes(there, here)[1:] == [f"numpy {version} is new"]


def test_how_a_package_came_here_is_no_difference() -> None:
    by_pip = (
        "a/b.py,sha256=1,2\na/__pycache__/b.cpython-311.pyc,,\n../../../bin/a,sha256=9,9\n"
        "a-1.dist-info/INSTALLER,sha256=4,4\na-1.dist-info/REQUESTED,sha256=5,0\n"
        "a-1.dist-info/RECORD,,\n"
    )
    in_the_wheel = "a-1.dist-info/RECORD,,\na/b.py,sha256=1,2\n"
    assert fingerprint_of(by_pip) == fingerprint_of(in_the_wheel)
    assert fingerprint_of(by_pip) != fingerprint_of(
        by_pip.replace("b.py,sha256=1", "b.py,sha256=7")
    )
