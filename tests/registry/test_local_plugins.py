"""Plugins in a study's own folder: found without being installed, and approved byte by byte."""

import os
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from faults.sessions import finished, unique
from faults.sessions import labcrane as command
from rehearsal import SHORT

from labcrane import Cue, PluginError, ProtocolError, open_recording
from labcrane.approval.decision import Grant, amend, approve, verify
from labcrane.testing import Registry, Study, discover, load, main

ARROW = """\
import os

import numpy as np

from labcrane import Cue, Feedback, Settings, Signal, hookimpl, offer
from labcrane.core import Sphere

labcrane_api = 1


class ArrowSettings(Settings):
    radius: float = 0.1
    \"\"\"Of its head, in metres.\"\"\"


class Arrow(Cue):
    def __init__(self, settings):
        self._radius = settings.radius

    def open(self, run):
        self._tip = run.state.find("tip.position")

    def draw(self, frame):
        return [Sphere("head", tuple(frame.state[self._tip]), self._radius, (1.0, 0.0, 0.0, 1.0))]


class Counter(Feedback):
    signals = (Signal("shapes", "1"), Signal("process", "1"))

    def present(self, frame):
        return np.array([float(len(frame.shapes)), float(os.getpid())])


@hookimpl
def labcrane_cues():
    return [offer("arrow", ArrowSettings, lambda settings, machine: Arrow(settings))]


@hookimpl
def labcrane_feedback():
    return [offer("counter", Settings, lambda settings, machine: Counter())]
"""

STUDY = (
    SHORT.replace("movements: 2", "movements: 1, limit_s: 4").replace(
        "    steps:\n", "    steps:\n      - break: {seconds: 8}\n"
    )
    + """\
feedback: {ball: {use: arrow, radius: 0.2}}
views: {count: {use: counter}}
"""
)


@pytest.fixture
def protocol(tmp_path: Path) -> Path:
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "arrow.py").write_text(ARROW, encoding="utf-8")
    path = tmp_path / "study.yaml"
    path.write_text(STUDY.replace("rehearsal", unique("own")), encoding="utf-8")
    return path


def loaded(protocol: Path) -> tuple[Study, Registry]:
    registry = discover(study=protocol)
    return load(protocol, registry), registry


def test_a_file_beside_the_protocol_is_a_plugin(protocol: Path) -> None:
    study, registry = loaded(protocol)
    assert registry.plugins[Cue]["arrow"] == "plugins/arrow.py"
    assert study.cues["ball"].settings.model_dump() == {"radius": 0.2}
    assert "arrow" not in discover().offers[Cue], "it is no plugin of other studies"
    assert main(["check", str(protocol)]) == 0


def test_what_is_in_the_file_is_what_runs(protocol: Path) -> None:
    # Same length, same second: a stale byte code cache would not notice.
    source = protocol.parent / "plugins" / "arrow.py"
    stamps = source.stat()
    for radius in (0.3, 0.7):
        source.write_text(ARROW.replace("0.1", str(radius)), encoding="utf-8")
        os.utime(source, ns=(stamps.st_atime_ns, stamps.st_mtime_ns))
        offer = discover(study=protocol).find(Cue, "arrow")
        assert offer.settings().model_dump() == {"radius": radius}
    assert not list(source.parent.glob("__pycache__/*"))


def test_two_studies_may_each_have_a_file_of_one_name(protocol: Path, tmp_path: Path) -> None:
    other = tmp_path / "other" / "study.yaml"
    (other.parent / "plugins").mkdir(parents=True)
    (other.parent / "plugins" / "arrow.py").write_text(
        ARROW.replace("0.1", "0.9"), encoding="utf-8"
    )
    first, second = discover(study=protocol), discover(study=other)
    radii = [each.find(Cue, "arrow").settings().model_dump()["radius"] for each in (first, second)]
    assert radii == [0.1, 0.9]


def test_a_file_that_fails_is_named_with_its_line_when_it_is_missed(
    protocol: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = protocol.parent / "plugins" / "arrow.py"
    source.write_text(ARROW.replace("labcrane_api = 1", "1 / 0"), encoding="utf-8")
    line = 1 + source.read_text(encoding="utf-8").splitlines().index("1 / 0")
    assert main(["check", str(protocol)]) == 2
    said = capsys.readouterr().err
    assert "'arrow' is not installed" in said
    assert (
        "plugin 'plugins/arrow.py' is broken: ZeroDivisionError: division by zero "
        f"({source}:{line})" in said
    )


def test_a_file_may_not_offer_what_is_installed(protocol: Path) -> None:
    source = protocol.parent / "plugins" / "arrow.py"
    source.write_text(ARROW.replace('offer("arrow"', 'offer("sphere"'), encoding="utf-8")
    with pytest.raises(PluginError, match=r"plugins 'sphere' and 'plugins/arrow.py' both offer"):
        discover(study=protocol)


def test_a_changed_file_is_not_what_was_approved(protocol: Path) -> None:
    today = date(2026, 3, 2)
    consent = protocol.parent / "consent.md"
    consent.write_text("I take part.\n", encoding="utf-8")
    grant = Grant("SessionView", "2026-1", date(2027, 3, 2), consent)
    approve(*loaded(protocol), grant, today)
    verify(*loaded(protocol), today)

    source = protocol.parent / "plugins" / "arrow.py"
    source.write_text(ARROW + "# harmless\n", encoding="utf-8")
    with pytest.raises(
        ProtocolError,
        match=r"plugin plugins/arrow.py: the source of plugins/arrow.py has changed",
    ):
        verify(*loaded(protocol), today)
    amend(*loaded(protocol), grant, "a comment", today)
    verify(*loaded(protocol), today)

    (source.parent / "second.py").write_text("", encoding="utf-8")
    with pytest.raises(ProtocolError, match=r"plugin plugins/second\.py is used now"):
        verify(*loaded(protocol), today)


@pytest.mark.long
def test_processes_of_a_session_find_it_and_its_source_is_recorded(protocol: Path) -> None:
    data = protocol.parent / "data"
    arguments = ("--participant", "P001", "--simulate", "--feedback", "--data", data)
    finished(command("run", protocol, *arguments))
    session = open_recording(data / "P001-SIMULATED" / "P001-SIMULATED.h5").session(1)
    assert session.context["components"]["feedback.ball"]["plugin"] == "plugins/arrow.py"
    assert session.context["own_plugins"] == {"plugins/arrow.py": ARROW}
    shown = session.streams["labcrane.feedback.count"].data
    assert shown["process"].iloc[0] not in {0.0, float(os.getpid())}
    assert np.max(shown["shapes"]) == 1.0
