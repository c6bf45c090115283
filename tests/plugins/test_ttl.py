"""Pulses: over a pseudo-terminal that answers, and a parallel port that is a list."""

import errno
import os
import random
import select
import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from needs import needs
from rehearsal import SHORT, ScriptedConsole, a_study

import labcrane
from labcrane import DeviceError, PluginError, ProtocolError, Tick, Trigger
from labcrane.core import Echo, Event
from labcrane.core.events import CODES, PULSES
from labcrane.protocol.questions import questions
from labcrane.streams.triggers import Triggers
from labcrane.testing import (
    TriggerContract,
    Visit,
    ch8,
    discover,
    make_frame,
    make_run,
    opened,
    run,
)
from labcrane_ttl.parallel_port import CLAIM, WRITE, ParallelTrigger
from labcrane_ttl.serial_port import KEPT, SerialTrigger, as_byte
from labcrane_ttl.settings import BoxSettings, ParallelSettings, SerialSettings

pytestmark = needs("terminals")

DELAY_S = 0.02


class Device:
    """A trigger box at the other end of a pseudo-terminal.

    Attributes
    ----------
    heard
        All that was written to it.
    """

    def __init__(self, delay_s: float | None = None) -> None:
        self._mine, self._theirs = os.openpty()
        self.port = os.ttyname(self._theirs)
        self.heard = b""
        self._delay_s = delay_s
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._answer)
        if delay_s is not None:
            self._thread.start()

    def _answer(self) -> None:
        while not self._over.is_set():
            if select.select([self._mine], [], [], 0.05)[0]:
                came = os.read(self._mine, 100)
                self.heard += came
                time.sleep(self._delay_s or 0.0)
                os.write(self._mine, came)

    def read(self, count: int) -> bytes:
        """Return the next bytes that were written to it."""
        found = b""
        while len(found) < count and select.select([self._mine], [], [], 10.0)[0]:
            found += os.read(self._mine, count - len(found))
        return found

    def flood(self, content: bytes) -> int:
        """Send bytes that nobody asked for, as fast as they are taken."""
        sent = 0
        while sent < len(content):
            sent += os.write(self._mine, content[sent:])
        return sent

    def drain(self) -> None:
        """Read whatever has come."""
        while select.select([self._mine], [], [], 0.1)[0]:
            os.read(self._mine, 10_000)

    def close(self) -> None:
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()
        os.close(self._mine)
        os.close(self._theirs)


@pytest.fixture
def device() -> Iterator[Device]:
    made = Device()
    yield made
    made.close()


@pytest.fixture
def answering() -> Iterator[Device]:
    made = Device(DELAY_S)
    yield made
    made.close()


class TestSerial(TriggerContract):
    @pytest.fixture
    def trigger(self, device: Device) -> Trigger:
        return SerialTrigger(SerialSettings(port=device.port), as_byte, b"\0")


class TestAnswering(TriggerContract):
    @pytest.fixture
    def trigger(self, answering: Device) -> Trigger:
        return SerialTrigger(SerialSettings(port=answering.port, echo=True), as_byte, b"\0")


class TestBox(TriggerContract):
    @pytest.fixture
    def trigger(self, device: Device) -> Trigger:
        box = discover().find(Trigger, "box_ttl")
        return box.build(BoxSettings(port=device.port), ch8())


class TestParallel(TriggerContract):  # what offers "parallel_ttl" is given no real port
    @pytest.fixture
    def trigger(self) -> Trigger:
        settings = ParallelSettings(port=Path("/dev/null"), codes={"trial.start": 3})
        return ParallelTrigger(settings, lambda file, request, data: None)


def test_codes_go_out_at_once_and_the_line_is_cleared_when_the_pulse_is_over(
    device: Device,
) -> None:
    trigger = SerialTrigger(SerialSettings(port=device.port, pulse_s=0.01), as_byte, b"\0")
    with opened(trigger, make_run(ch8())):
        trigger.send([30, 40], 5.0)
        assert device.read(2) == bytes([30, 40])
        trigger.send([], 5.009)
        trigger.send([31], 5.0095)  # a new code makes a new pulse
        trigger.send([], 5.011)
        trigger.send([], 5.02)
        trigger.send([], 5.03)
        assert device.read(2) == bytes([31, 0])
        assert not select.select([device._mine], [], [], 0.0)[0]


def test_a_box_is_told_in_its_own_words(device: Device) -> None:
    settings = BoxSettings(port=device.port, command="SET {code};", rest="CLEAR;")
    trigger = SerialTrigger(settings, settings.written, settings.rest.encode())
    with opened(trigger, make_run(ch8())):
        trigger.send([30], 0.0)
        trigger.send([], 1.0)
        assert device.read(13) == b"SET 30;CLEAR;"


def test_a_device_that_does_not_read_makes_nobody_wait_and_is_told(device: Device) -> None:
    trigger = SerialTrigger(SerialSettings(port=device.port), as_byte, b"\0")
    with opened(trigger, make_run(ch8())):
        for _ in range(5000):
            trigger.send([7] * 100, 0.0)
            if trigger.fault:
                break
        assert trigger.fault == f"{device.port} takes no more: its device does not read"
        device.drain()
        trigger.send([7], 0.0)
        assert trigger.fault is None


def test_a_device_that_is_pulled_out_is_told_and_nothing_raises(answering: Device) -> None:
    gone = Device()
    trigger = SerialTrigger(SerialSettings(port=gone.port, echo=True), as_byte, b"\0")
    with opened(trigger, make_run(ch8())):
        gone.close()
        until = time.monotonic() + 240.0
        while trigger.fault is None and time.monotonic() < until:
            trigger.send([7], 0.0)
        assert trigger.fault is not None
        assert gone.port in trigger.fault


def test_a_parallel_port_is_claimed_set_and_cleared() -> None:
    calls: list[tuple[int, bytes]] = []

    def control(file: int, request: int, data: bytes) -> None:
        calls.append((request, data))
        if len(calls) == 5:
            raise OSError(errno.EIO, "pulled out")

    settings = ParallelSettings(port=Path("/dev/null"))
    trigger = ParallelTrigger(settings, control)
    with opened(trigger, make_run(ch8())):
        trigger.send([30, 255], 0.0)
        trigger.send([], 0.02)
        assert calls == [(CLAIM, b""), (WRITE, b"\x1e"), (WRITE, b"\xff"), (WRITE, b"\x00")]
        trigger.send([1], 1.0)
        assert trigger.fault == "/dev/null cannot be written: [Errno 5] pulled out"
        trigger.send([1], 1.0)
        assert trigger.fault is None


def test_ports_that_are_not_there_are_refused_in_words(tmp_path: Path) -> None:
    gone = str(tmp_path / "ttyS99")
    serial = SerialTrigger(SerialSettings(port=gone), as_byte, b"\0")
    with pytest.raises(DeviceError, match=r"serial port '.*ttyS99' cannot be opened: .* plug it"):
        serial.open(make_run(ch8()))
    parallel = ParallelTrigger(ParallelSettings(port=Path(gone)))
    with pytest.raises(DeviceError, match=r"parallel port .*ttyS99 cannot be opened: .* modprobe"):
        parallel.open(make_run(ch8()))


def test_wrong_settings_are_refused_with_their_line(tmp_path: Path) -> None:
    for written, said in (
        (
            "{use: serial_ttl, port: x, codes: {trial.begun: 3}}",
            r"study\.yaml:\d+:\d+: .*no such event",
        ),
        ("{use: serial_ttl, port: x, codes: {trial.start: 256}}", r"study\.yaml:\d+:.*255"),
        ("{use: box_ttl, port: x, command: 'WRITE'}", r"must have \{code\} in it once"),
    ):
        with pytest.raises(ProtocolError, match=said):
            a_study(tmp_path, SHORT + f"triggers: {{box: {written}}}\n")


class Fixed(Trigger):
    """Sends nothing, and answers what it is told to."""

    def __init__(self, **codes: int) -> None:
        self.codes = {name.replace("_", "."): code for name, code in codes.items()} or None
        self.sent: list[list[int]] = []
        self.answers: list[object] = []

    def send(self, codes, now):
        self.sent.append(list(codes))
        answers, self.answers = self.answers, []
        return answers


def test_what_a_line_with_a_fault_was_to_send_is_not_noted_as_sent() -> None:
    notes, told, line = [], [], Fixed(trial_start=5, trial_end=6)
    triggers = Triggers({"box": line}, lambda event, tick: notes.append(event), told.append)

    def tick(name: str, fault: str | None) -> None:
        due = time.perf_counter()
        frame = make_frame(make_run(ch8()))
        frame.tick, frame.events = Tick(1, due, due), (Event(name, due),)
        line.fault = fault
        triggers(frame)

    tick("trial.start", "unplugged")
    tick("trial.end", None)  # its code goes out after a tick of rest
    tick("session.end", None)
    line.answers = [Echo(5, time.perf_counter()), Echo(6, time.perf_counter())]
    tick("session.end", None)
    assert [event.name for event in notes] == [
        "trigger.unsent", "trigger.lost", "trigger.back", "trigger.sent", *["trigger.echo"] * 2,
    ]  # fmt: skip
    assert notes[0].data == {"trigger": "box", "codes": "5", "why": "unplugged"}
    assert notes[4].data["delay_s"] is None, "nobody waits for what was not sent"
    assert notes[5].data["delay_s"] is not None


def test_a_device_that_floods_leaves_the_record_small_and_its_true_echoes_in_it() -> None:
    """3,000 codes a tick at 240 Hz for two seconds: a loose line, or somebody else's device."""
    notes, told, line = [], [], Fixed(trial_start=5)
    triggers = Triggers({"box": line}, lambda event, tick: notes.append(event), told.append)
    frame = make_frame(make_run(ch8()))
    begin, ticks, each = 1000.0, 480, 3000
    for number in range(ticks):
        due, odd = begin + number / 240.0, number % 2
        frame.tick, frame.events = Tick(number, due, due), (Event("trial.start", due),) * odd
        line.answers = [*[Echo(5, due)] * odd, *[Echo(77, due)] * (each - odd)]
        triggers(frame)
    triggers.finish()
    echoes = [event for event in notes if event.name == "trigger.echo"]
    floods = [event for event in notes if event.name == "trigger.flood"]
    ours = [event for event in echoes if event.data["code"] == 5]
    assert len(ours) == ticks // 2
    assert len(echoes) - len(ours) == 20 * 2 == 40, "of what nobody sent, 20 a second"
    counted = sum(int(str(event.data["why"]).split()[2]) for event in floods)
    assert counted == ticks * each - len(echoes), "whatever is left out is counted"
    assert len(floods) <= 3
    assert [event for event in told if event.name == "trigger.flood"] == floods
    assert floods[0].data["why"].startswith("box sent ")


def test_a_flooding_port_is_read_in_pieces_and_keeps_the_newest_echoes(device: Device) -> None:
    settings = SerialSettings(port=device.port, echo=True)
    trigger = SerialTrigger(settings, as_byte, rest=bytes(1))
    with opened(trigger, make_run(ch8())):
        written = 0
        for _ in range(40):
            written += device.flood(b"\x07" * 4000)
        written += device.flood(b"\x09")
        found, until = [], time.perf_counter() + 30.0
        while not (found and found[-1].code == 9) and time.perf_counter() < until:
            came = trigger.send((), time.perf_counter())
            assert len(came) <= KEPT
            found += came
    assert written == 160_001
    assert found[-1].code == 9
    assert all(one.time <= other.time for one, other in pairwise(found))


def test_every_event_that_has_a_code_is_sent_and_noted_the_first_of_a_tick_at_once() -> None:
    made, notes, told = make_run(ch8()), [], []
    all_codes, own = Fixed(), Fixed(trial_start=5)
    triggers = Triggers(
        {"all": all_codes, "own": own}, lambda event, tick: notes.append((event, tick)), told.append
    )
    due = time.perf_counter()
    frame = make_frame(made)
    frame.tick = Tick(7, due, due)
    frame.events = (
        Event("drop", due), Event("somebody.else", due), Event("movement.onset", due - 8.0),
        Event("trial.start", due),
    )  # fmt: skip
    triggers(frame)
    frame.events = ()
    for number in (8, 9):
        frame.tick = Tick(number, due, due)
        triggers(frame)
    assert all_codes.sent == [[CODES["drop"]], [], [CODES["trial.start"]]]
    assert own.sent == [[5], [], []]
    (first, tick), (second, _), (third, later) = notes
    assert (first.name, tick, first.time) == ("trigger.sent", 7, due)
    assert (first.data["trigger"], first.data["codes"]) == ("all", "48")
    assert (second.data["trigger"], second.data["codes"]) == ("own", "5")
    assert (third.data["codes"], later) == ("30", 9)
    assert 0.0 <= first.data["delay_s"] <= second.data["delay_s"] <= third.data["delay_s"]
    del notes[2]
    came = due + 10.0
    all_codes.answers = [Echo(30, came), Echo(48, came)]  # that of 48 was lost, and comes no more
    all_codes.fault = "unplugged"
    frame.events = ()
    triggers(frame)
    echo, stray, lost = (event for event, _ in notes[2:])
    assert echo.data["code"] == 30
    # From before the code was handed over, which is when its note says at the latest.
    assert came - due - third.data["delay_s"] <= echo.data["delay_s"] <= came - due
    assert stray.data["delay_s"] is None
    assert (lost.name, lost.data["why"]) == ("trigger.lost", "all: unplugged")
    triggers(frame)
    all_codes.fault = None
    triggers(frame)
    assert [event.name for event in told] == ["trigger.lost", "trigger.back"]
    with pytest.raises(PluginError, match=r"trigger 'x' has the code 0 for 'drop'; a code is 1 to"):
        Triggers({"x": Fixed(drop=0)}, lambda event, tick: None, told.append)


@pytest.mark.parametrize("seed", range(6))
def test_an_amplifier_at_500_hz_sees_every_code_though_ticks_are_late(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    draws, now = random.Random(seed), 100.0
    clock = SimpleNamespace(perf_counter=lambda: now, sleep=lambda s: None)
    monkeypatch.setattr("labcrane.streams.triggers.time", clock)
    levels: list[tuple[float, int]] = [(0.0, 0)]

    def control(file: int, request: int, data: bytes) -> None:
        if request == WRITE:
            levels.append((now, data[0]))

    codes = {f"event.{number}": draws.randint(1, 255) for number in range(4)}
    port = ParallelTrigger(ParallelSettings(port=Path("/dev/null"), codes=codes), control)
    notes: list[Event] = []
    triggers = Triggers({"port": port}, lambda event, tick: notes.append(event), notes.append)
    rate_hz, expected, firsts = draws.uniform(20.0, 1000.0), [], []
    frame = make_frame(make_run(ch8()))
    with opened(port, make_run(ch8())):
        for _ in range(12):
            due = now
            names = draws.choices(list(codes), k=draws.randint(1, 4))
            expected += [codes[name] for name in sorted(names, key=list(codes).index)]
            firsts.append(now)
            for tick in range(round(0.5 * rate_hz) + 10):
                frame.tick = Tick(tick, now, now)
                frame.events = tuple(Event(name, now) for name in names) if tick == 0 else ()
                triggers(frame)
                late_s = draws.uniform(0.0, 0.02) if draws.random() < 0.3 else 0.0
                due += 1.0 / rate_hz
                now = max(due + late_s, now + 1e-4)
    samples = np.arange(100.0, now, 1.0 / 500.0)  # what the amplifier sees
    when, level = np.array(levels).T
    line = level[np.searchsorted(when, samples, side="right") - 1]
    begins = np.flatnonzero((line != 0) & (np.diff(line, prepend=0) != 0))
    seen = line[begins].astype(int).tolist()
    times = samples[begins]
    assert seen == expected
    assert max(np.abs(times - first).min() for first in firsts) <= 1.0 / 500.0
    assert {event.name for event in notes} == {"trigger.sent"}


@pytest.mark.parametrize("seed", range(4))
def test_by_default_what_is_shown_or_done_does_not_wait_for_the_frame_of_it(seed: int) -> None:
    draws = random.Random(seed)
    frame, line, notes = make_frame(make_run(ch8())), Fixed(), []
    line.codes = None
    triggers = Triggers({"box": line}, lambda event, tick: notes.append(event), notes.append)
    done = draws.choice(["targets.shown", "target.entered", "command.onset", "drop"])
    names = [done, "session.start", "step.start", "block.start", "trial.start", "trial.end"]
    draws.shuffle(names)
    frame.events = tuple(Event(name, frame.tick.due) for name in names)
    triggers(frame)
    assert line.sent == [[CODES[done]]]
    assert {name: CODES[name] for name in PULSES} == dict(PULSES)


def test_codes_that_a_line_cannot_show_in_time_are_told_as_not_sent() -> None:
    notes, line = [], Fixed(trial_start=5)
    line.spacing_s = 1e9
    triggers = Triggers({"box": line}, lambda event, tick: notes.append(event), notes.append)
    frame = make_frame(make_run(ch8()))
    for number, due in enumerate((0.0, 0.5, 1.4, 1.6)):
        frame.tick, frame.events = Tick(number, due, due), (Event("trial.start", due),)
        triggers(frame)
    assert [event.name for event in notes] == ["trigger.sent", "trigger.unsent"]
    assert notes[1].time == 1.6
    assert notes[1].data["why"] == "more codes than the line can show one after another"
    triggers.finish()
    assert [event.name for event in notes[2:]] == ["trigger.unsent"] * 2


def test_events_that_are_learnt_late_are_asked_about_where_they_are_sent(tmp_path: Path) -> None:
    codes = "{trial.start: 1, movement.onset: 2, movement.offset: 3}"
    line = f"{{use: serial_ttl, port: x, codes: {codes}}}"
    asked = questions(
        a_study(tmp_path, SHORT + f"triggers: {{amp: {line}, b: {{use: parallel_ttl}}}}\n")
    )
    found = {each.key: each.text for each in asked if each.key.startswith("triggers.")}
    assert list(found) == [
        "triggers.amp.codes.movement.onset", "triggers.amp.codes.movement.offset",
    ]  # fmt: skip
    assert found["triggers.amp.codes.movement.onset"].startswith(
        "triggers.amp sends movement.onset as a pulse, and a session learns of it only when the "
        "movement is over, or the trial, which may be seconds later"
    )


@pytest.mark.long
def test_a_session_sends_its_codes_and_the_record_says_when_and_what_came_back(
    answering: Device, tmp_path: Path
) -> None:
    text = SHORT.replace("study: rehearsal", f"study: t{os.getpid()}")
    text = text.replace("movements: 2", "movements: 1, limit_s: 2")
    text += f"triggers: {{box: {{use: serial_ttl, port: {answering.port}, echo: true}}}}\n"
    visit = Visit(a_study(tmp_path, text), "P001", 1, tmp_path / "data", simulated=True)
    events = labcrane.open_recording(run(visit, ScriptedConsole())).session(1).events
    by_name = events.groupby("name")["data"].apply(list)
    sent = [int(code) for data in by_name["trigger.sent"] for code in data["codes"].split()]
    known = events[events["name"].isin(list(PULSES)) & (events["name"] != "session.start")]
    known = known.assign(code=known["name"].map(PULSES), rank=known["name"].map(list(PULSES).index))
    assert sent == known.sort_values(["tick", "rank"], kind="stable")["code"].tolist()
    assert bytes(byte for byte in answering.heard if byte) == bytes(sent)
    delays = [data["delay_s"] for data in by_name["trigger.echo"]]
    assert [data["code"] for data in by_name["trigger.echo"]] == sent
    assert min(delays) >= DELAY_S
    assert "trigger.lost" not in by_name
    context = labcrane.open_recording(visit.folder.participant_file).session(1).context
    assert context["components"]["triggers.box"]["use"] == "serial_ttl"
