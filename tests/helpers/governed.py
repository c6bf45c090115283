"""An approved study of which sessions can be run with a person who is not there."""

from dataclasses import dataclass
from datetime import date
from pathlib import Path

from rehearsal import SHORT, ScriptedConsole

from labcrane.approval.decision import Grant, approve
from labcrane.approval.lock import Lock
from labcrane.participants.enrolment import confirm_consent
from labcrane.participants.folders import Places
from labcrane.testing import Registry, Study, Visit, discover, load, run

TODAY = date.today()
PERSON = "{use: stand_in}"
"""The simulated operator as controls that a person moves, by a plugin of the study."""

STAND_IN = """\
from labcrane import hookimpl, offer
from labcrane_operator.operator import SimulatedOperator
from labcrane_operator.settings import OperatorSettings

labcrane_api = 1


class StandInSettings(OperatorSettings):
    person = True


@hookimpl
def labcrane_inputs():
    return [offer("stand_in", StandInSettings, SimulatedOperator)]
"""

GOVERNED = SHORT.replace("{use: dual_joystick}", PERSON).replace(
    "distances: [2], movements: 2", "distances: [2], movements: 1"
)
GROUPED = GOVERNED.replace(
    "sessions:",
    "feedback: {sphere: {use: sphere}, tone: {use: sonification}}\n"
    "design:\n  groups: {none: [], visual: [sphere], sound: [tone]}\nsessions:",
)


def put_stand_in(folder: Path) -> None:
    """Write the plugin into the folder of a study."""
    (folder / "plugins").mkdir(exist_ok=True)
    (folder / "plugins" / "person.py").write_text(STAND_IN, encoding="utf-8")


@dataclass
class Lab:
    """A study's folder, approved."""

    folder: Path
    text: str = GOVERNED

    def __post_init__(self) -> None:
        self.protocol = self.folder / "study.yaml"
        self.protocol.write_text(self.text, encoding="utf-8")
        put_stand_in(self.folder)
        (self.folder / "consent_v2.txt").write_text(
            "I take part.\nI can stop at any time.\n", encoding="utf-8"
        )
        self.places = Places(self.folder / "data")

    @property
    def study(self) -> Study:
        return load(self.protocol, self.registry)

    @property
    def registry(self) -> Registry:
        return discover(study=self.protocol)

    def approve(self) -> Lock:
        return approve(self.study, self.registry, self.grant(), TODAY)

    def grant(self) -> Grant:
        last = TODAY.replace(year=TODAY.year + 1, day=1)
        return Grant("Ethics board", "KB-12/2026", last, self.folder / "consent_v2.txt")

    def consent(self, participant: str) -> None:
        from labcrane.approval.lock import read_lock

        version = read_lock(self.protocol).consent_version
        text = ("consent_v2.txt", version)
        confirm_consent(self.places, self.study, participant, text, TODAY)

    def visit(self, participant: str, session: int = 1, **stamps: bool) -> Visit:
        return Visit(self.study, participant, session, self.places.root, **stamps)

    def run(self, participant: str, orders=None) -> Path:
        """Run a session on the quick: no clock to wait for, no streams, START at every gate."""
        self.consent(participant)
        return run(self.visit(participant, fast=True), Willing(orders))


def edit(path: Path, old: str, new: str) -> None:
    """Change what a file says in one place."""
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


class Willing(ScriptedConsole):
    """Starts whatever waits, and gives the orders of a script."""

    def __init__(self, orders=None) -> None:
        super().__init__(orders)
        self._waits = False

    def report(self, event) -> None:
        super().report(event)
        self._waits = self._waits or event.name == "waiting"

    def commands(self):
        from labcrane.testing import Command, Order

        start = [Command(Order.START)] * self._waits
        self._waits = False
        return [*start, *super().commands()]
