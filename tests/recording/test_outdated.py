"""Recordings of protocols that would be refused today: read, replayed, exported, gone on with."""

import random
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from recording.test_before import BEFORE, labcrane_command

from labcrane import ProtocolError, open_recording
from labcrane.analysis.movements import machine_of
from labcrane.machines.library import find_machine
from labcrane.session.session import finish, record
from labcrane.testing import Command, Order, Study, Visit, discover, load

Dice = random.Random


def wide(text: str, dice: Dice) -> str:
    return text.replace("movements: 1", f"movements: 1, width: {dice.uniform(2.0, 3.0):.2f}")


def twice(text: str, dice: Dice) -> str:
    return text.replace("distances: [2]", f"distances: [{dice.choice(['2, 2', '2, 3, 2.0'])}]")


def two_of_a_name(text: str, dice: Dice) -> str:
    return f"{text}  - name: first\n    steps:\n      - break: {{seconds: {dice.randint(1, 9)}}}\n"


def device(text: str, dice: Dice) -> str:
    return text.replace("study: before", f"study: {dice.choice(['con', 'lpt1', 'a' * 50, 'a-'])}")


def stream_device(text: str, dice: Dice) -> str:
    return text + f"streams: {{{dice.choice(['nul', 'aux', 'a.b'])}: {{type: EEG}}}}\n"


def no_writing(text: str, dice: Dice) -> str:
    sign = dice.choice(["\\u202e", "\\u0007", "\\ufffe", "\\u0085"])
    return text.replace("title: What a", f'title: "What{sign} a').replace(
        "was before", 'was before"'
    )


def many(text: str, dice: Dice) -> str:
    return text.replace("movements: 1", f"movements: {dice.randint(1001, 9999)}")


def planned(text: str, dice: Dice) -> str:
    return text.replace("planned: 4", f"planned: {dice.randint(100_001, 10**9)}")


def rounds(text: str, dice: Dice) -> str:
    count, key = dice.randint(1001, 9999), dice.choice(["repeat", "until"])
    value = count if key == "repeat" else f"{{successes: 1, rounds: {count}}}"
    return text.replace("block: {task", f"block: {{{key}: {value}, task")


def anchors(text: str, dice: Dice) -> str:
    return text.replace("distances: [2]", "distances: &it [2]").replace(
        "name: first", f"name: &it {dice.choice(['first', 'one'])}"
    )


def no_view(text: str, dice: Dice) -> str:
    keys = "view: nowhere, axes: {stick: [w, s]}"
    return text.replace("{use: dual_joystick}", f"{{use: keyboard, {keys}}}")


def no_bus(text: str, dice: Dice) -> str:
    bus = dice.choice(["nobus", "socketcand:can0@host:port"])
    return text.replace("{use: dual_joystick}", f"{{use: can, bus: '{bus}', valves: {{slew: 1}}}}")


FAULTS: dict[str, Callable[[str, Dice], str]] = {
    each.__name__: each
    for each in (
        wide, twice, two_of_a_name, device, stream_device, no_writing, anchors, no_view, no_bus,
        many, planned, rounds,
    )
}  # fmt: skip


class Ended:
    """Nobody but a launcher that ends a session after some ticks."""

    busy = False

    def __init__(self, ticks: int) -> None:
        self._left = ticks

    def report(self, event) -> None:
        """Nobody listens."""

    def commands(self) -> list[Command]:
        self._left -= 1
        return [Command(Order.END)] if self._left == 0 else []


def faulty(folder: Path, dice: Dice, names: list[str]) -> Path:
    text = (BEFORE / "protocol.yaml").read_text()
    for name in names:
        text = FAULTS[name](text, dice)
    path = folder / "study.yaml"
    path.write_text(text)
    return path


def as_recorded(path: Path) -> Study:
    return load(path, discover(study=path), recorded=True)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_refused_today_and_no_reason_not_to_read_a_record(
    tmp_path: Path, name: str
) -> None:
    path = faulty(tmp_path, random.Random(name), [name])
    with pytest.raises(ProtocolError):
        load(path, discover(study=path))
    assert as_recorded(path).recorded


def some(seed: int) -> tuple[Dice, list[str]]:
    """Draw faults that go together: two may be in the same words."""
    dice = random.Random(seed)
    one = [dice.choice([wide, twice, anchors]), dice.choice([no_view, no_bus])]
    names = [each.__name__ for each in (*one, two_of_a_name, no_writing, stream_device)]
    return dice, names


@pytest.fixture(params=[0, pytest.param(1, marks=pytest.mark.long)])
def recorded(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, Path]:
    """Return a protocol with faults, and a data folder with a session that ran with it."""
    dice, names = some(request.param)
    path = faulty(tmp_path, dice, names)
    visit = Visit(as_recorded(path), "P001", 1, tmp_path / "data", simulated=True, fast=True)
    record(visit, Ended(-1))
    finish(visit)
    return path, visit.data


@pytest.mark.slow
def test_a_record_with_faults_is_replayed_exported_and_reported(
    recorded: tuple[Path, Path], tmp_path: Path
) -> None:
    path, data = recorded
    with pytest.raises(AssertionError, match=r"study\.yaml"):
        labcrane_command("check", path)
    file = data / "P001-SIMULATED" / "P001-SIMULATED.h5"
    assert "every number the same bit for bit" in labcrane_command("replay", file)
    include = ("--include", "simulated", "--include", "half-finished")
    labcrane_command("export", data, "--to", "tables", "--out", tmp_path / "tables", *include)
    assert len((tmp_path / "tables" / "trials.csv").read_text().splitlines()) > 3
    labcrane_command("report", data, "--out", tmp_path / "report", *include)
    file.unlink()
    labcrane_command("recover", data)
    assert file.exists()


@pytest.mark.slow
def test_a_session_begun_with_faults_is_gone_on_with_as_it_was_begun(tmp_path: Path) -> None:
    path = faulty(tmp_path, *some(3))
    visit = Visit(as_recorded(path), "P001", 1, tmp_path / "data", simulated=True, fast=True)
    record(visit, Ended(60))
    arguments = ("--participant", "P001", "--simulate", "--data", visit.data)
    with pytest.raises(ProtocolError) as refused:
        load(path, discover(study=path))
    said = "".join(labcrane_command("resume", path, *arguments).split())  # it is in lines
    told = f"continued as it was begun; a new session would be refused:{refused.value}"
    assert "".join(told.split()) in said
    path.write_text(path.read_text() + "# another text\n")
    with pytest.raises(AssertionError, match=r"study\.yaml"):
        labcrane_command("resume", path, *arguments)


@pytest.mark.parametrize("name", ["Müller", "con", "register", "x" * 60])
def test_a_participant_whose_name_was_allowed_is_gone_on_with(tmp_path: Path, name: str) -> None:
    text = (BEFORE / "protocol.yaml").read_text()
    path = tmp_path / "study.yaml"
    path.write_text(text.replace(r"'P\d{3}'", "'.+'"))
    study = as_recorded(path)
    visit = Visit(study, name, 1, tmp_path / "data", simulated=True, fast=True)
    with pytest.raises(ProtocolError, match=repr(name)):
        replace(study, recorded=False).check_participant(name)
    study.check_participant(name)
    folder = visit.folder
    folder.path.mkdir(parents=True)
    folder.make()  # it is there, so it was made before


@pytest.mark.slow
def test_a_record_of_a_machine_whose_meshes_are_gone_is_read_as_before(tmp_path: Path) -> None:
    """Only those who draw it need them; who reads the record is on another computer."""
    lab = tmp_path / "lab"
    lab.mkdir()
    corners = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    (lab / "foot.stl").write_text(
        f"solid\nfacet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\nendsolid\n"
    )
    crane = find_machine("ch8").read_text().replace("joints:", "base_mesh: foot.stl\njoints:", 1)
    (lab / "crane.yaml").write_text(crane)
    path = lab / "study.yaml"
    path.write_text(
        (BEFORE / "protocol.yaml").read_text().replace("machine: ch8", "machine: crane.yaml")
    )
    study = load(path, discover(study=path))
    visit = Visit(study, "P001", 1, tmp_path / "data", simulated=True, fast=True)
    record(visit, Ended(-1))
    finish(visit)
    shutil.rmtree(lab)
    file = visit.folder.participant_file
    assert machine_of(open_recording(file).session(1)).names == study.machine.names
    assert "every number the same bit for bit" in labcrane_command("replay", file)
    out = tmp_path / "tables"
    words = ("--to", "tables", "--out", out, "--include", "simulated")
    labcrane_command("export", visit.data, *words)
    assert (out / "trials.csv").is_file()
