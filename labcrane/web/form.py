"""A questionnaire on a page: every answer is sent the moment it is given."""

import json
from collections.abc import Callable, Mapping, Sequence

from nicegui import ui

from labcrane.core.items import Item, in_order
from labcrane.core.records import Value
from labcrane.session.commands import Order
from labcrane.web.page import PageContext
from labcrane.web.server.access import PARTICIPANT

HEADING = "role=heading aria-level=2"
MOST_TICKS = 21
"""A scale with more steps is a field to write into."""

FEW_TICKS = 11
"""A scale with more of them has no room for its numbers on a narrow screen."""


class Form:
    """Shows the questionnaire that is asked, and what the record has of its answers.

    What is marked is what came back as an event: an answer that is not in the record is not shown
    as given, also after a reload.
    """

    def __init__(self, context: PageContext, page: str) -> None:
        self._context = context
        self._page = page
        self._words = context.words(page)
        self._refreshers: list[Callable[[], object]] = []
        self._fields: list[Callable[[], None]] = []
        self._shown: tuple[int, bool] = (-1, False)
        self._at = 0
        one = context.study.protocol.page.one_at_a_time
        self._one_at_a_time = one and page == PARTICIPANT

    def build(self) -> None:
        """Build it where the page stands, and keep it up to date."""
        self._area = ui.element("div").classes("form")
        ui.timer(0.1, self.update)

    def update(self) -> None:
        """Follow the record."""
        session = self._context.session
        shown = session.form_version, session.over
        if shown != self._shown:
            self._shown = shown
            self._at = 0
            self._area.clear()
            self._refreshers.clear()
            self._fields.clear()
            with self._area:
                self._rebuild(session.form, over=shown[1])
        for refresh in self._refreshers:
            refresh()

    def _rebuild(self, name: str | None, *, over: bool) -> None:
        session = self._context.session
        if name is None or over:
            ended = "data-over" if over and self._page == PARTICIPANT else ""
            with ui.element("div").classes("form-calm").props(ended):
                if not over:
                    ui.element("span").classes("form-breath").props("aria-hidden=true")
                said = ui.label().props('id="wait" role=status')
            calm = self._words.thanks if over else self._words.wait
            self._refreshers.append(lambda: said.set_text("" if session.consent else calm))
            return
        questionnaire = self._context.study.questionnaires[name]
        items = list(in_order(questionnaire.items(), session.order, session.turned))
        ui.label(questionnaire.title).classes("form-title").props(HEADING)
        self._progress(items)
        cards = [self._item(name, item) for item in items]
        refusal = ui.label().classes("text-red-900 text-lg").props('role=alert id="refusal"')
        self._refreshers.append(lambda: refusal.set_text(self._refusal()))
        with ui.element("div").classes("form-nav"):
            hand_in = ui.button(self._words.hand_in, on_click=self._hand_in)
            hand_in.props('size=lg no-caps color=primary id="submit"')
            if self._one_at_a_time and len(cards) > 1:
                self._one_by_one(cards, hand_in)

    def _hand_in(self) -> None:
        for save in self._fields:  # also what was put back after a reload, and never left since
            save()
        self._context.give(self._page, Order.SUBMIT)

    def _progress(self, items: "Sequence[Item]") -> None:
        with ui.element("div").classes("form-progress"):
            bar = ui.element("progress").props(f"value=0 max={max(1, len(items))}")
            line = ui.label().props('id="answered" role=status')
        names = [item.name for item in items]

        def refresh() -> None:
            done = sum(name in self._context.session.answers for name in names)
            said = self._words.progress.format(done=done, total=len(names))
            if line.text != said:
                line.set_text(said)
                bar.props["value"] = done
                bar.props["aria-label"] = said
                bar.update()

        self._refreshers.append(refresh)

    def _one_by_one(self, cards: "Sequence[ui.element]", hand_in: "ui.button") -> None:
        """Show one item per screen; the whole questionnaire is submitted together."""

        def go(step: int) -> None:
            self._at = min(max(self._at + step, 0), len(cards) - 1)

        back = ui.button(self._words.back, on_click=lambda: go(-1))
        back.props('size=lg outline no-caps color=primary id="back"')
        on = ui.button(self._words.on, on_click=lambda: go(1))
        on.props('size=lg no-caps color=primary id="next"')

        def refresh() -> None:
            last = self._at == len(cards) - 1
            for at, card in enumerate(cards):
                card.set_visibility(at == self._at)
            back.set_visibility(self._at > 0)
            on.set_visibility(not last)
            hand_in.set_visibility(last)

        self._refreshers.append(refresh)

    def _item(self, name: str, item: Item) -> "ui.element":
        card = ui.element("div").classes("form-item")
        card.props(f'role=group id="item-{item.name}" aria-labelledby="asked-{item.name}"')
        with card:
            with ui.element("p").props(f'id="asked-{item.name}"'):
                ui.label(item.text)
            if item.left or item.right:
                with ui.element("div").classes("form-ends"):
                    ui.label(item.left)
                    ui.label(item.right)
            if item.kind == "choice":
                self._choices(
                    name, item, dict(zip(item.choices, item.labels or item.choices, strict=True))
                )
            elif item.kind == "scale" and item.step and item.steps < MOST_TICKS:
                values = map(item.at_step, range(item.steps + 1))
                self._choices(name, item, {value: _label(item, value) for value in values})
            else:
                if item.words:
                    self._choices(name, item, {at: _label(item, at) for at in item.worded})
                self._field(name, item)
            with ui.element("div").classes("form-below"):
                ui.button(
                    self._words.no_answer, on_click=lambda: self._answer(name, item, None)
                ).props(f'flat no-caps color=grey-9 id="decline-{item.name}"')
                status = ui.label()
                status.props(f'id="status-{item.name}" role=status')
            self._refreshers.append(lambda: self._tell(status, item))
        return card

    def _choices(
        self, name: str, item: Item, values: "Mapping[float, str] | Mapping[str, str]"
    ) -> None:
        fine = " form-fine" if len(values) > FEW_TICKS else ""
        scale = f"form-scale{fine}" if item.kind == "scale" else "form-choices"
        if item.words:
            scale = "form-steps"
        with ui.element("div").classes(scale):
            for value, label in values.items():
                button = ui.button(
                    label, on_click=lambda value=value: self._answer(name, item, value)
                )
                button.props("outline no-caps color=primary aria-pressed=false")
                ident = value if isinstance(value, str) else f"{value:g}"
                button.props(f'id="{item.name}-{ident}"')
                if not label:
                    button.props(f'aria-label="{ident}"')
                self._refreshers.append(self._marking(button, item, value))

    def _marking(self, button: "ui.button", item: Item, value: Value) -> Callable[[], None]:
        marked = [False]

        def refresh() -> None:
            given = self._context.session.answers.get(item.name) == value
            if given != marked[0]:
                marked[0] = given
                button.props("unelevated aria-pressed=true", remove="outline") if given else (
                    button.props("outline aria-pressed=false", remove="unelevated")
                )

        return refresh

    def _field(self, name: str, item: Item) -> None:
        held = self._context.session.answers.get(item.name)
        hint = "" if item.kind == "text" else self._words.takes(item)
        shown = "" if held is None else f"{held:g}" if isinstance(held, float) else str(held)
        field = ui.input(hint, value=shown).classes("w-full")
        field.props(f'outlined for="{item.name}-field"')
        field.props["aria-label"] = f"{item.text} {hint}".strip()

        sent = [shown]

        def save() -> None:
            # A field that is left after Enter, or because the form goes, says nothing new.
            text = str(field.value or "").strip()
            if text and text != sent[0]:
                sent[0] = text
                self._answer(name, item, text if item.kind == "text" else _number(text))

        field.on("blur", save)
        field.on("keydown.enter", save)
        self._fields.append(save)
        self._refreshers.append(self._drafting(field, name, item))

    def _drafting(self, field: "ui.input", name: str, item: Item) -> Callable[[], None]:
        """Name the field's draft for ``drafts.js``, and return what says what the record holds."""
        session, context = self._context.session, self._context
        visit = f"{context.participant} {context.plan.number}"
        field.props["data-draft"] = f"{visit} {session.form_version} {name} {item.name}"

        def held() -> str:
            given = item.name in session.answers
            return json.dumps(session.answers[item.name], ensure_ascii=False) if given else ""

        field.props["data-held"] = held()

        def refresh() -> None:
            if field.props["data-held"] != held():
                field.props["data-held"] = held()
                field.update()

        return refresh

    def _answer(self, name: str, item: Item, value: object) -> None:
        given = {"questionnaire": name, "item": item.name, "value": value}
        self._context.give(self._page, Order.ANSWER, json.dumps(given, ensure_ascii=False))

    def _tell(self, status: "ui.label", item: Item) -> None:
        """State what the record has of an item; only what it has accepted is green."""
        session, words = self._context.session, self._words
        refused = bool(session.refusal) and session.refused_item == item.name
        status.classes(replace="text-red-900" if refused else "text-green-900")
        if refused:
            status.set_text(f"{words.not_taken}: {words.refused(item)}")
        elif item.name not in session.answers:
            status.set_text("")
        else:
            declined = session.answers[item.name] is None
            status.set_text(words.declined if declined else words.saved)

    def _refusal(self) -> str:
        """Return why the last answer or submission was not accepted."""
        session = self._context.session
        if not (session.refusal and session.form):
            return ""
        items = {
            item.name: item for item in self._context.study.questionnaires[session.form].items()
        }
        return self._words.refused(items.get(session.refused_item))


def _label(item: Item, value: float) -> str:
    """Return the label of a step of a scale: its number and words, or nothing."""
    said = item.worded.get(value, "")
    return f"{value:g}  {said}".strip() if item.numbered else said


def _number(text: str) -> float | str:
    """Return the number that was written, or what was written, for the item to refuse."""
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return text


SIGNED = "The participant has signed this text"
"""What the experimenter confirms."""


class ConsentCard:
    """Shows the approved text and its version for as long as a consent to it is missing."""

    def __init__(self, context: PageContext, page: str) -> None:
        self._context = context
        self._page = page
        self._shown = ""

    def build(self) -> None:
        """Build it where the page stands, and keep it up to date."""
        self._area = ui.column().classes("w-full")
        ui.timer(0.1, self._update)

    def _update(self) -> None:
        version = str(self._context.session.consent.get("version", ""))
        if version != self._shown:
            self._shown = version
            self._area.clear()
            if version:
                with self._area:
                    self._rebuild(version)

    def _rebuild(self, version: str) -> None:
        asked, words = self._context.session.consent, self._context.words(self._page)
        with ui.card().classes("w-full").props('id="consent"'):
            ui.label(words.consent).classes("text-2xl font-medium").props(
                "role=heading aria-level=2"
            )
            ui.label(f"{asked['file']}, {words.version} {version}").props('id="consent-version"')
            if asked["text"]:
                ui.label(str(asked["text"])).classes("whitespace-pre-wrap text-lg")
            ui.link(f"{words.open_file} {asked['file']}", "/consent", new_tab=True).classes(
                "text-blue-10"
            )
            ui.button(
                words.take_part if self._page == PARTICIPANT else SIGNED,
                on_click=lambda: self._context.give(self._page, Order.CONSENT, version),
            ).props('no-caps size=lg color=primary id="order-consent"')
