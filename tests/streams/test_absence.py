"""A stream that is waited for in vain: the cause is named, with what to do."""

import time
from pathlib import Path

import pylsl
import pytest

from labcrane.streams.network import VARIABLE, Network
from labcrane.streams.recorder import absence
from labcrane.streams.recorder import recorder as recorder_module
from labcrane.streams.recorder.absence import MOST_NAMED, FreePorts, cause, missed
from labcrane.streams.recorder.recorder import Recorder
from labcrane.streams.request import StreamRequest

HERE, LAB = Network(Path("here.cfg"), loopback=True), Network(None, loopback=False)
PORTS = range(16572, 16604)


def stream(name: str) -> pylsl.StreamInfo:
    return pylsl.StreamInfo(name, "Gaze", 2, 60.0, "float32", f"of {name}")


OURS, NEON = stream("labcrane.frame"), stream("Neon Gaze")


@pytest.mark.parametrize(
    ("seen", "network", "free", "said"),
    [
        ((NEON,), LAB, 0, ("none of LSL's 32 ports, 16572 to 16603, is free", "PortRange = 128")),
        ((NEON,), LAB, 9, ("the network has 'Neon Gaze' (Gaze, source_id 'of Neon Gaze')",
                           "correct the protocol if", "labcrane doctor --peer")),
        ((OURS,), HERE, 9, ("no stream is, and LSL reaches this computer only, as here.cfg says",
                            "drop --local")),
        ((OURS,), LAB, 9, ("no stream of another program is", "a firewall", "16572 to 16603")),
    ],
)  # fmt: skip
def test_the_cause_is_named_with_what_to_do(
    seen: tuple[pylsl.StreamInfo, ...], network: Network, free: int, said: tuple[str, ...]
) -> None:
    text = cause(seen, network, free, PORTS)
    for part in said:
        assert part in text


def test_a_crowded_network_is_not_listed_as_a_whole() -> None:
    crowd = [stream(f"device {at}") for at in range(MOST_NAMED + 3)]
    assert " and 3 more; " in cause(crowd, LAB, 9, PORTS)


def test_a_configuration_that_cannot_be_read_is_the_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "gone.cfg")
    text = missed(StreamRequest("eeg", name="Amplifier"), (), FreePorts())
    assert "eeg (name 'Amplifier') is not on the network after 15 s: " in text
    assert "gone.cfg, which cannot be read" in text


def test_ports_are_counted_seldom_for_who_counts_takes_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counted, now = [], [100.0]
    monkeypatch.setattr(absence, "free_ports", lambda: len(counted.append(now[0]) or counted))
    monkeypatch.setattr(absence.time, "monotonic", lambda: now[0])
    free = FreePorts()
    assert [free() for _ in range(20)] == [1] * 20
    now[0] += absence.PATIENCE_S
    assert free() == 2


def test_a_recorder_says_at_first_to_start_it_and_later_what_there_is_instead(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = pylsl.StreamOutlet(stream("Absent Gaze"))
    recorder = Recorder(tmp_path / "streams.xdf", [StreamRequest("eyes", name="Absent_Gaze")])
    try:
        deadline = time.monotonic() + 240.0
        while "Absent Gaze" not in {one.name() for one in recorder._search.results()}:
            assert time.monotonic() < deadline
            recorder.look()
        (at_first,) = recorder.health()[0].warnings
        assert at_first.endswith("is not on the network: start it, and check that LSL is enabled")
        monkeypatch.setattr(recorder_module, "PATIENCE_S", 0.0)
        (later,) = recorder.health()[0].warnings
        assert later.startswith("eyes (name 'Absent_Gaze') is not on the network after 15 s: the ")
        assert "'Absent Gaze' (Gaze, source_id 'of Absent Gaze')" in later
    finally:
        recorder.close()
        del other
