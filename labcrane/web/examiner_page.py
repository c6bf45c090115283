"""The supervisor's page: what happens, and what can be done about it."""

import json
from collections.abc import Callable, Mapping

from labcrane.core.records import Event
from labcrane.design.counts import TrialCounts
from labcrane.protocol.questions import about, questions
from labcrane.session.commands import Order
from labcrane.web.door.access import SUPERVISOR
from labcrane.web.form import ConsentCard, Form
from labcrane.web.page import PRIMARY, PageContext
from labcrane.web.panels import Cameras, Loads, PerformancePanel, Reports
from labcrane.web.scene import Scene

BUTTONS: Mapping[str, tuple[Order, str, str]] = {
    "Start / go on": (Order.START, "", "green-10"),
    "Pause": (Order.PAUSE, "", "brown-8"),
    "Repeat trial": (Order.REPEAT, "", "blue-10"),
    "Skip": (Order.SKIP, "", "blue-10"),
    "Override end": (Order.OVERRIDE, "", "blue-10"),
    "Completed": (Order.COMPLETION, "1", "blue-10"),
    "Not completed": (Order.COMPLETION, "0", "blue-10"),
}
LINES = 12
AXIS = {"axisLine": {"onZero": False}, "axisLabel": {"color": "#333"}}
RATE_S = 0.25


def supervisor_page(context: PageContext) -> None:
    """Build the page."""
    from nicegui import ui  # noqa: PLC0415 - loads for a second

    ui.page_title(f"labcrane: {context.participant}")
    ui.colors(primary=PRIMARY)
    with ui.column().classes("w-full max-w-7xl mx-auto p-3 gap-3"):
        _status(context)
        build_questions(context)
        ConsentCard(context, SUPERVISOR).build()
        _orders(context)
        Reports(context, SUPERVISOR).build()
        PerformancePanel(context).build()
        with ui.element("div").classes("grid grid-cols-1 lg:grid-cols-2 gap-3 w-full"):
            with ui.card().classes("w-full"):
                Scene(context).build()
                Loads(context).build()
            with ui.card().classes("w-full"):
                _chart(context)
            Cameras(context).build()
            with ui.card().classes("w-full"):
                _log(context)
            with ui.card().classes("w-full"):
                _streams(context)
            with ui.card().classes("w-full lg:col-span-2"):
                Form(context, SUPERVISOR).build()


def _status(context: PageContext) -> None:
    from nicegui import ui  # noqa: PLC0415

    title = f"{context.study.protocol.title}: {context.participant}, session {context.plan.number}"
    ui.label(title).classes("text-xl font-medium").props("role=heading")
    line = ui.label().classes("text-lg").props('id="stage" role=status')
    facts = ui.label().props('id="facts"')
    alarm = ui.label().classes("text-lg font-bold text-red-900").props('id="alarm" role=alert')

    def update() -> None:
        session = context.session
        held = f" · HELD by {', '.join(sorted(session.holds))}" if session.holds else ""
        line.set_text(session.stage + held)
        facts.set_text(" · ".join(_facts(context)))
        alarm.set_text(session.alarm)

    ui.timer(RATE_S, update)


def build_questions(context: PageContext) -> None:
    """Show what ``labcrane check`` asks of the protocol, and nobody has answered in it."""
    from nicegui import ui  # noqa: PLC0415

    for question in questions(context.study):
        said = about(context.study, question)
        line = f"line {said['line']} of {context.study.path.name}: {said['message']}"
        ui.label(line).props(f'id="question-{question.key}"').classes("text-amber-900")


def _facts(context: PageContext) -> list[str]:
    session, live = context.session, context.live
    trials = context.plan.trials
    left = sum(trial.planned.expected_s for trial in trials[session.trials_done :])
    found = [f"trials {session.trials_done} of {len(trials)}", f"about {left / 60:.0f} min left"]
    if session.trial:
        found.append(f"{_called(context)}, attempt {session.trial['attempt']}")
    found += [f"{name} {count}" for name, count in sorted(session.counts.items())]
    if "worst_lateness" in session.last_trial:
        worst = float(str(session.last_trial["worst_lateness"]))
        found.append(f"worst lateness of last trial {1000 * worst:.1f} ms")
    if live.lateness_s is not None:
        found.append(f"loop at most {1000 * live.lateness_s:.1f} ms late")
    if live.age_s is not None:
        found.append(f"newest frame {1000 * live.age_s:.0f} ms old")
    return found


def _called(context: PageContext) -> str:
    """Return what the running trial is called."""
    return TrialCounts.of(context.plan).name(int(str(context.session.trial["trial"])))


def _orders(context: PageContext) -> None:
    from nicegui import ui  # noqa: PLC0415

    def give(order: Order, text: str = "") -> Callable[[], object]:
        return lambda: context.give(SUPERVISOR, order, text)

    with ui.row().classes("gap-2 items-center w-full"):
        for label, (order, text, colour) in BUTTONS.items():
            ident = f"{order.value}{text}"
            ui.button(label, on_click=give(order, text)).props(
                f'no-caps color={colour} id="order-{ident}"'
            )
        with ui.dialog() as sure, ui.card():
            ui.label("End the session now? What is recorded is kept.")
            with ui.row():
                ui.button("End it", on_click=give(Order.END)).on_click(sure.close).props(
                    'no-caps color=red-10 id="order-end-sure"'
                )
                ui.button("Go on", on_click=sure.close).props("no-caps color=blue-10")
        ui.button("End session", on_click=sure.open).props('no-caps color=red-10 id="order-end"')
    with ui.row().classes("gap-3 items-center w-full"):
        for order, label in ((Order.NOTE, "Note"), (Order.HINT, "Hint to the operator")):
            with ui.row().classes("gap-2 items-center no-wrap"):
                _words(context, order, label)


def _words(context: PageContext, order: Order, label: str) -> None:
    from nicegui import ui  # noqa: PLC0415

    field = ui.input(label).props(f'outlined dense for="{order.value}-field"').classes("w-72")

    def send() -> None:
        context.give(SUPERVISOR, order, str(field.value or "").strip())
        field.set_value("")

    field.on("keydown.enter", send)
    ui.button("Send", on_click=send).props(f'no-caps color=blue-10 id="order-{order.value}"')


def _chart(context: PageContext) -> None:
    from nicegui import ui  # noqa: PLC0415

    choice = ui.select([], label="Signal").classes("w-full").props('id="signal"')
    chart = ui.echart(
        {
            "animation": False,
            "grid": {"left": 50, "right": 15, "top": 15, "bottom": 30},
            "xAxis": {"type": "value", "min": -20, "max": 0, "name": "s", **AXIS},
            "yAxis": {"type": "value", "scale": True, **AXIS},
            "series": [{"type": "line", "showSymbol": False, "data": []}],
        }
    ).classes("w-full h-60")

    def update() -> None:
        signals = sorted(name for name in context.live.newest if "." in name)  # of machine and task
        if signals and choice.options != signals:
            tip = [name for name in signals if name.startswith("state.tip.position")]
            choice.set_options(signals, value=choice.value or (tip or signals)[0])
        if choice.value:
            chart.options["series"][0]["data"] = context.live.history(choice.value)
            chart.update()

    ui.timer(RATE_S, update)


def _log(context: PageContext) -> None:
    from nicegui import ui  # noqa: PLC0415

    ui.label("Events").classes("font-medium")
    text = ui.label().classes("whitespace-pre-wrap font-mono text-sm break-words w-full")
    text.props('id="events"')
    ui.timer(
        RATE_S,
        lambda: text.set_text(
            "\n".join(_line(e) for e in [*context.session.events][: -LINES - 1 : -1])
        ),
    )


def _line(event: Event) -> str:
    data = {key: value for key, value in event.data.items() if value not in {None, ""}}
    return f"{event.time:.1f}  {event.name}  {json.dumps(data, ensure_ascii=False)[:160]}"


def _streams(context: PageContext) -> None:
    from nicegui import ui  # noqa: PLC0415

    ui.label("Streams and clocks").classes("font-medium")
    text = ui.label().classes("whitespace-pre-wrap font-mono text-sm").props('id="streams"')
    ui.timer(RATE_S, lambda: text.set_text("\n".join(_health(context))))


def _health(context: PageContext) -> list[str]:
    session = context.session
    if session.sync_report:
        return session.sync_report
    streams = session.streams.get("streams", ())
    if not streams:
        return ["the study records no streams of others"]
    return [
        f"{stream['label']}: {stream['condition']}"
        + "".join(f"; {warning}" for warning in stream["warnings"])
        + "".join(
            f"\n  {fault['channel'] or 'all'}: {fault['kind']}: {fault['message']}"
            for fault in stream["signals"]
        )
        for stream in streams
    ]
