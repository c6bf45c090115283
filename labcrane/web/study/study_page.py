"""Study's page in HTML: the whole study at a glance, and a link to everything behind it."""

from collections.abc import Iterator
from datetime import date, timedelta
from pathlib import Path

from labcrane.files.html import rendered
from labcrane.participants.register import Deviation
from labcrane.web.study.overview import Due, Overview, Person

PAGE = Path(__file__).with_name("study.html")
MARKS = {"ok": "✓", "warn": "!", "bad": "✕"}
WORDS = {"ok": "in order", "warn": "review", "bad": "not usable"}
DUE = {"overdue": "bad", "due": "ok", "later": "faint"}
"""How the page colours what is due."""

FEW = 10
"""Sessions that the disk must have room for, or it is said to be full."""


def page_of(overview: Overview, today: date, made: str) -> str:
    """Return the page.

    Parameters
    ----------
    made
        When it was made, as readers see it.
    """
    folder = overview.folder.absolute()
    reports = overview.report / "participants" if overview.report is not None else None

    def has_report(person: Person) -> bool:
        return reports is not None and (reports / f"{person.name}.html").is_file()

    return rendered(
        PAGE,
        overview=overview,
        where=f"{folder.parent.name}/{folder.name}",
        made=made,
        figures=list(_figures(overview)),
        most=max([1, *(held for held, _ in overview.groups.values())]),
        deviations=[
            (person.name, _in_words(each))
            for person in overview.people
            for each in person.deviations
        ],
        left=lambda due: _left(due, today),
        is_over=lambda due: due.last is not None and due.last < today,
        has_report=has_report,
        size=size,
        due_class=DUE,
        marks=MARKS,
        words=WORDS,
    )


def _figures(overview: Overview) -> Iterator[tuple[str, str, str, str]]:
    """Yield the figures: name, number, additional text and level."""
    real = [one for one in overview.people if one.real]
    complete = sum(one.status == "complete" for one in real)
    sessions = sum(len(one.sat) for one in real)
    doubtful = sum(sat.level != "ok" for one in real for sat in one.sat)
    overdue = sum(due.state == "overdue" for _, due in overview.due)
    lasts = "" if overview.lasts is None else f", enough for {overview.lasts:,} sessions like these"
    full = overview.lasts is not None and overview.lasts < FEW
    others = len(overview.people) - len(real)
    beside = f"; {others} simulated or pilot, not counted" if others else ""
    done = "ok" if complete else ""
    yield "complete", f"{complete} of {len(real)}", f"participants{beside}", done
    yield "due", str(len(overview.due)), f"{overdue} overdue", "warn" if overdue else ""
    yield "sessions", str(sessions), f"{doubtful} to review", "warn" if doubtful else ""
    yield "disk", size(overview.used), f"{size(overview.free)} free{lasts}", "bad" if full else ""


def size(count: int) -> str:
    """Return bytes as people read them."""
    value = float(count)
    for unit in ("B", "kB", "MB", "GB"):
        if value < 1000.0:  # noqa: PLR2004 - the next unit
            return f"{value:.0f} {unit}" if unit == "B" else f"{value:.1f} {unit}"
        value /= 1000.0
    return f"{value:.1f} TB"


def _left(due: Due, today: date) -> str:
    """Return how many days are left; nothing without a window."""
    if due.last is None:
        return ""
    if due.first is not None and today < due.first:
        return f" · in {_days(due.first - today)}"
    if today <= due.last:
        return f" · {_days(due.last - today)} left"
    return f" · since {_days(today - due.last)}"


def _days(span: timedelta) -> str:
    return "1 day" if span.days == 1 else f"{span.days} days"


def _in_words(one: Deviation) -> str:
    session = f"session {one.session}" if one.session else ""
    trial = f"trial {one.trial}" if one.trial else ""
    where = ", ".join(filter(None, (session, trial)))
    detail = f": {one.detail}" if one.detail else ""
    return f"{where} {one.what}{detail}".strip()
