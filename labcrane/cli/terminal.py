"""A session in the terminal: it prints events, and keys give actions.

Both run in threads of their own, so that a slow terminal never makes the loop wait.
"""

import math
import re
import threading
from collections.abc import Callable, Mapping

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from labcrane.cli.questionnaire import Sheet, Sheets
from labcrane.cli.typed import from_terminal, lines, next_key, single_keys
from labcrane.core.items import AnswerError
from labcrane.core.records import Event, is_done
from labcrane.core.roles import Questionnaire
from labcrane.design.counts import TrialCounts
from labcrane.session.commands import Command, Order, QueueConsole
from labcrane.session.standing import SessionStage, Standing
from labcrane.web.control_room.sentences import sentence
from labcrane.web.translations import ENGLISH, Words

KEYS: Mapping[str, Order] = {
    " ": Order.START,
    "p": Order.PAUSE,
    "r": Order.REPEAT,
    "s": Order.SKIP,
    "e": Order.END,
    "n": Order.NOTE,
    "o": Order.OVERRIDE,
    "c": Order.COMPLETION,
    "h": Order.HINT,
    "f": Order.SETTING,
    "t": Order.TAKE,
    "v": Order.AGAIN,
    "g": Order.WITHOUT,
}
PEOPLES = (*KEYS.values(), Order.ANSWER, Order.SUBMIT)
"""The actions of the experimenter."""

PROMPTS: Mapping[Order, str] = {
    Order.NOTE: "note: ",
    Order.HINT: "hint: ",
    Order.COMPLETION: "completed? 1 or 0: ",
    Order.SETTING: "setting, such as tone.far=3: ",
    Order.TAKE: "take which stream, such as eeg or eeg=amplifier-1: ",
    Order.AGAIN: "start which view or sound again: ",
    Order.WITHOUT: "go on without which view or sound: ",
}
"""Prompts of actions that need words."""

AWAITING = {SessionStage.WAITING, SessionStage.JUDGEMENT, SessionStage.QUESTIONNAIRE}
"""Stages in which a session waits for an order."""

LOOK_S = 0.1
PATIENCE_S = 2.0
"""How long a session waits without any way to give orders."""

HELP = (
    "space start/continue · p pause · r repeat · s skip · e end · n note · o override · "
    "c completion · h hint · f feedback setting · t take a stream · v start a view again · "
    "g go on without a view · q fill in the questionnaire"
)


class Terminal:
    """Prints a session's events and turns keys, or lines of a pipe, into actions.

    With a terminal, single keys; otherwise each line of the standard input is an action and its
    words: ``note participant coughs``.

    Parameters
    ----------
    counts
        Names and number of the session's trials.
    keys
        Whether to listen at all; a simulated session needs no person.
    words
        Wording of questionnaires, in the language of the participant's page.
    alone
        Whether only the terminal gives orders, as there is no page.
    """

    def __init__(
        self,
        console: QueueConsole,
        out: Console,
        counts: TrialCounts,
        *,
        keys: bool,
        questionnaires: Mapping[str, Questionnaire] | None = None,
        words: Words = ENGLISH,
        alone: bool = False,
    ) -> None:
        self._standing = Standing()
        self._alone = alone
        self._sheets = Sheets(questionnaires or {})
        self._sheet: Sheet | None = None
        self._words = words
        self._console = console
        self._out = out
        self._counts = counts
        self._keys = keys
        self._over = threading.Event()
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=out,
        )
        self._bar = self._progress.add_task("trials", total=counts.total)
        self._printer = threading.Thread(target=self._print, name="terminal-out")
        self._listener = threading.Thread(target=self._listen, name="terminal-in", daemon=True)

    def __enter__(self) -> "Terminal":
        self._progress.start()
        self._printer.start()
        if self._keys:
            self._out.print(HELP, style="dim")
            self._listener.start()
        return self

    def __exit__(self, *raised: object) -> None:
        self._over.set()
        self._console.events.put(None)
        self._printer.join()
        if self._keys:
            self._listener.join()
        self._progress.stop()

    def say(self, text: str) -> None:
        """Print a line that is not from the session."""
        self._progress.print(text, markup=False, highlight=False)

    def _print(self) -> None:
        while (event := self._console.events.get()) is not None:
            self._sheet = self._sheets(event, self._sheet)
            self._standing = self._standing.after(event.name, event.data)
            if event.name == "trial.end" and event.data["counted"]:
                if is_done(event.data):
                    self._progress.advance(self._bar)
                ended = _trial_line(event.data, self._counts)
                self._progress.print(ended, markup=False, highlight=False)
            elif event.name == "session.standing":
                self._progress.update(self._bar, completed=int(str(event.data["done"])))
            elif line := event_line(event, self._counts.name):
                self._progress.print(line, markup=False, highlight=False)

    def _listen(self) -> None:
        if not from_terminal():
            for line in lines(self._over):
                self._line(line)
        else:
            with single_keys():
                while key := next_key(self._over):
                    self._key(key.lower())
        if self._alone:
            self._end_where_it_waits()

    def _end_where_it_waits(self) -> None:
        """End the session once it waits for an order, as who gave them is gone.

        Trials that run are run to their end, and an order that came last is given time to be done.
        """
        waited = 0.0
        while waited < PATIENCE_S:
            if self._over.wait(LOOK_S):
                return
            standing = self._standing
            waits = standing.paused or standing.stage in AWAITING
            waited = waited + LOOK_S if waits else 0.0
        self.say(
            "the standard input has ended and there is no page, so no action can be given: "
            "the session ends"
        )
        self._console.give(Command(Order.END))

    def _line(self, line: str) -> None:
        word, _, text = line.partition(" ")
        if word in {order.value for order in PEOPLES}:
            self._console.give(Command(Order(word), text.strip()))
        elif word:
            known = ", ".join(order.value for order in PEOPLES)
            self._progress.print(f"{word!r} is not an action; there is {known}", markup=False)

    def _key(self, key: str) -> None:
        order = KEYS.get(key)
        if key == "q":
            self._fill_in()
        elif order is None:
            self._progress.print(HELP, style="dim")
        elif order in PROMPTS:
            self._console.give(Command(order, self._ask(PROMPTS[order])))
        else:
            self._console.give(Command(order))

    def _fill_in(self) -> None:
        """Ask the items one by one; repeat an item after a wrong answer.

        Each answer is passed on at once, so none can be lost here. An empty line, or the
        session's end, leaves the rest for later.
        """
        sheet = self._sheet
        if sheet is None:
            self._progress.print("no questionnaire is asked")
            return
        for item in sheet.items():
            while True:
                takes = self._words.takes(item)
                said = self._ask(f"{item.text} ({takes}; - declines, empty leaves): ")
                if not said:
                    self._progress.print("left; q begins again")
                    return
                try:
                    answer = item.check(sheet.read(item, said))
                except AnswerError:
                    self._progress.print(self._words.refused(item), markup=False)
                    continue
                self._console.give(Command(Order.ANSWER, sheet.answer(item, answer)))
                break
        self._console.give(Command(Order.SUBMIT))

    def _ask(self, prompt: str) -> str:
        """Read a line key by key, since the terminal is in single-key mode."""
        self._progress.print(prompt, end="")
        text = ""
        while (key := next_key(self._over)) not in {"\n", "\r", ""}:
            text = text[:-1] if key in {"\x7f", "\b"} else text + key
        self._progress.print(text, markup=False)
        return text.strip()


def _trial_line(data: Mapping[str, object], counts: TrialCounts) -> str:
    measures = [
        f"{name.replace('_', ' ')} {value:.3g} {unit}"
        for name, unit in (("movement_time", "s"), ("error", "m"))
        if isinstance(value := data.get(name), float) and math.isfinite(value)
    ]
    called = counts.name(int(str(data["trial"])))
    return f"{called}: {', '.join([str(data['outcome']), *measures])}"


FOLDERS = re.compile(r"(?<=\()/[^():]*/(?=[^/():]+:\d+\))")
"""The folders of a place in the code; the record has them, and they are too long for a line."""


def _short(why: str) -> str:
    return FOLDERS.sub("", why)


TOLD: Mapping[str, str] = {
    **dict.fromkeys(
        (
            "break.start", "block.start", "pause.start", "pause.end", "plugin.slow", "page.denied",
            "questionnaire.refused", "feedback.awaited", "input.lost", "input.back", "disk.lost",
            "disk.back", "stream.lost", "stream.back", "trigger.lost", "trigger.flood",
            "loop.stalled", "estimate.lost", "estimate.back", "stop_rule.unjudged",
        ),
        "",
    ),
    "waiting": "space to start",
    "judgement.awaited": "c completion, o override; space to continue",
    "questionnaire.start": "on the participant's page, or q here",
    "stop_rule.met": "space to continue, e to end",
}  # fmt: skip
"""Events whose sentence is printed, and the keys that they ask for."""


def event_line(event: Event, called: Callable[[int], str]) -> str | None:
    """Return the line to print for an event; None for none.

    ``called`` says what a trial of the plan is called.
    """
    if event.name == "instructions.shown":
        return str(event.data["text"])
    if event.name not in TOLD and not event.data.get("refused"):
        return None
    text, keys = _short(sentence(event, called).text), TOLD.get(event.name)
    return f"{text} ({keys})" if keys else text
