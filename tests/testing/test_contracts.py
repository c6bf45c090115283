"""Contract tests take what the documentation allows, and answer in words."""

import ast
import types
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import labcrane.testing
from labcrane import Cue, Frame, Run, Settings, Signal, offer
from labcrane.core import Finding, Shape, SignalChannel, SignalFault, SignalStream, Sphere, Verdict
from labcrane.testing import (
    CueContract,
    ExaminationContract,
    ExporterContract,
    PluginContract,
    SignalMonitorContract,
    check_signals,
)


class Trail(Cue):
    """A cue of speed: a ball at the tip, the larger the faster; at rest there is none."""

    def open(self, run: Run) -> None:
        self._tip = run.state.find("tip.position")
        self._speed = run.state.find("tip.velocity")
        self._target = run.task.find("target.position")

    def draw(self, frame: Frame) -> Sequence[Shape]:
        speed = float(np.linalg.norm(frame.state[self._speed]))
        if speed == 0.0 or np.isnan(frame.task[self._target]).any():
            return ()
        return (Sphere("trail", tuple(frame.state[self._tip].tolist()), speed, (1, 1, 0, 1)),)


class Nothing(Trail):
    """A cue that forgets to draw."""

    def draw(self, frame: Frame) -> Sequence[Shape]:
        return ()


def said(check: Callable[[], None]) -> str:
    with pytest.raises(AssertionError) as raised:
        check()
    return str(raised.value)


def test_a_cue_of_speed_fulfils_its_contract() -> None:
    contract = CueContract()
    for name in dir(CueContract):
        if name.startswith("test_"):
            getattr(contract, name)(Trail())


def test_a_cue_that_draws_nothing_is_told_so() -> None:
    text = said(lambda: CueContract().test_cue_draws_shapes_with_names_of_their_own(Nothing()))
    assert "draw() returned no shape for a frame with a target" in text


class Bare(Settings):
    length: float = 1.0
    """In metres."""


def test_settings_without_a_docstring_are_told_what_to_write() -> None:
    Bare.__doc__ = None
    plugin = types.ModuleType("bare")
    plugin.labcrane_cues = lambda: [offer("bare", Bare, lambda settings, machine: Trail())]
    text = said(lambda: PluginContract().test_every_setting_says_what_it_means(plugin))
    assert text.startswith("Bare needs a docstring: write what 'bare' is, in a sentence, below ")
    assert "<class" not in text


@pytest.mark.parametrize(
    "module",
    sorted(Path(labcrane.testing.__file__).parent.glob("*.py")),
    ids=lambda path: path.stem,
)
def test_every_check_of_a_contract_answers_in_words(module: Path) -> None:
    tree = ast.parse(module.read_text(encoding="utf-8"))
    mute = [
        f"line {each.lineno}: {ast.unparse(each.test)}"
        for each in ast.walk(tree)
        if isinstance(each, ast.Assert) and (each.msg is None or isinstance(each.msg, FEW_WORDS))
    ]
    assert mute == []


FEW_WORDS = (ast.Name, ast.Attribute)
"""What is not a sentence: a name's value alone."""


class Silent:
    """An exporter that writes nothing."""

    def export(self, participants: Any, folder: Path) -> None:
        list(participants)


class Greedy(Silent):
    """An exporter that goes through the participants twice, and spoils what it reads."""

    def export(self, participants: Any, folder: Path) -> None:
        for person in (*participants, *participants):
            person.path.write_bytes(b"")


class Deaf:
    """A monitor that knows everything and finds a fault in it."""

    def __init__(self, *faults: object) -> None:
        self._faults = faults

    def knows(self, stream: SignalStream) -> bool:
        return True

    def begin(self, stream: SignalStream) -> None:
        """Nothing to forget."""

    def look(self, times: object, samples: object) -> Sequence[Any]:
        return self._faults


def test_an_exporter_is_told_what_it_left_out(tmp_path: Path) -> None:
    contract = ExporterContract()
    for number, (exporter, check, words) in enumerate(
        (
            (Silent(), contract.test_an_export_has_files_of_every_participant, "nothing of P001,"),
            (Silent(), contract.test_recordings_are_not_touched, "wrote nothing into the folder"),
            (Greedy(), contract.test_recordings_are_not_touched, "changed the recording P001.h5;"),
        )
    ):
        folder = tmp_path / str(number)
        folder.mkdir()
        text = said(lambda check=check, exporter=exporter, folder=folder: check(exporter, folder))
        assert words in text


def test_a_monitor_is_told_what_it_found_where_there_was_nothing() -> None:
    contract, clean = SignalMonitorContract(), np.ones((10, 1))
    stream = SignalStream("EEG", "EEG", 100.0, (SignalChannel("Cz", "EEG", "uV"),))
    fault = SignalFault("Cz", "flat line", "it is flat; look at the cable")
    check = contract.test_monitor_finds_nothing_in_a_living_signal
    assert "find nothing in a living signal" in said(lambda: check(Deaf(fault), stream, clean))
    check_empty = contract.test_monitor_knows_no_stream_without_channels_or_rate
    assert "knows() is true of a stream" in said(lambda: check_empty(Deaf()))
    check_split = contract.test_verdict_does_not_depend_on_how_samples_come
    for wrong, words in (
        (7, "look() returned 7; return SignalFault(channel, kind, message)"),
        (SignalFault("Pz", "a", "b"), "channel 'Pz', which the stream does not have; it has"),
        (SignalFault("Cz", "", "b"), "without a kind"),
        (SignalFault("Cz", "a", ""), "without a message"),
    ):
        text = said(lambda wrong=wrong: check_split(Deaf(wrong), stream, clean))
        assert words in text


@pytest.mark.parametrize(
    ("found", "words"),
    [
        ((), "found nothing; yield one Finding at least"),
        ((7,), "yielded 7; yield Finding(verdict, text, advice)"),
        ((Finding(Verdict.PASS, ""),), "without a text; write what was looked at"),
        ((Finding(Verdict.FAIL, "no stick"),), "without advice on what to do about it; give the"),
        ((Finding(Verdict.FAIL, "no stick", "Plug it in."),), "whose advice ends with a full stop"),
    ],
)
def test_an_examination_is_told_what_its_findings_lack(found: Any, words: str) -> None:
    class Mine(Settings):
        """Nothing."""

    offered = offer("mine", Mine, lambda settings, machine: Trail(), lambda settings, ask: found)
    check = ExaminationContract().test_every_finding_says_how_it_is_and_what_to_do
    text = said(lambda: check(offered, Mine()))
    assert text.startswith("the examination of 'mine' ")
    assert words in text


@pytest.mark.parametrize(
    ("signals", "words"),
    [
        ((Signal("a", "1"), Signal("a", "1")), "Trail.signals have a column more than once: a;"),
        ((Signal("Tip.x", "m"),), "Trail.signals have a column 'Tip.x'; write words of small"),
    ],
)
def test_signals_are_told_which_column_is_wrong(signals: tuple[Signal, ...], words: str) -> None:
    cue = Trail()
    cue.signals = signals
    assert words in said(lambda: check_signals(cue))
