"""Study's page in HTML: the whole study at a glance, and a link to everything behind it."""

from collections.abc import Iterable
from datetime import date
from html import escape
from pathlib import Path
from urllib.parse import urlencode

from labcrane.participants.register import Deviation
from labcrane.web.study.overview import Overview, Person, Sat

STYLE = (Path(__file__).with_name("study.css")).read_text(encoding="utf-8")
MARKS = {"ok": "✓", "warn": "!", "bad": "✕"}
WORDS = {"ok": "in order", "warn": "look", "bad": "not usable as it is"}


def page_of(overview: Overview, today: date, made: str) -> str:
    """Return the page.

    Parameters
    ----------
    made
        When it was made, for whoever reads it.
    """
    folder = overview.folder.absolute()
    where = f"{folder.parent.name}/{folder.name}"
    parts = [
        f"<header><h1>{escape(overview.study)}</h1>"
        f"<p class=faint>{escape(overview.approval)} · {escape(where)} · as of "
        f"{escape(made)} · <a href=/study>look again</a></p></header>",
        _figures(overview),
        _due(overview, today),
        _groups(overview),
        _people(overview),
        _deviations(overview),
    ]
    title = f"{overview.study} · labcrane"
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" '
        f'content="width=device-width, initial-scale=1"><title>{escape(title)}</title>'
        f"<style>{STYLE}</style><body><main>{''.join(parts)}</main></body></html>"
    )


def _figures(overview: Overview) -> str:
    real = [one for one in overview.people if one.status not in {"simulated", "pilot"}]
    complete = sum(one.status == "complete" for one in real)
    sessions = sum(len(one.sat) for one in real)
    doubtful = sum(sat.level != "ok" for one in real for sat in one.sat)
    overdue = sum(due.state == "overdue" for _, due in overview.due)
    lasts = "" if overview.lasts is None else f", enough for {overview.lasts:,} sessions like these"
    shown = [
        ("complete", f"{complete} of {len(real)}", "participants", ""),
        ("due", str(len(overview.due)), f"{overdue} overdue", "warn" if overdue else ""),
        ("sessions", str(sessions), f"{doubtful} to look at", "warn" if doubtful else ""),
        ("disk", size(overview.used), f"{size(overview.free)} free{lasts}",
         "bad" if overview.lasts is not None and overview.lasts < FEW else ""),
    ]  # fmt: skip
    cards = "".join(
        f'<div class="card {level}" id="figure-{name}"><strong>{escape(large)}</strong>'
        f"<span>{escape(name)}</span><small>{escape(small)}</small></div>"
        for name, large, small, level in shown
    )
    report = (
        "<p><a class=button href=/report/report.html>The study's report</a></p>"
        if overview.report
        else "<p class=faint>No report has been made yet: <code>labcrane report "
        f"{escape(str(overview.folder))}</code> makes one.</p>"
    )
    return f"<section class=figures aria-label='The study in figures'>{cards}</section>{report}"


FEW = 10
"""Sessions that the disk must have room for, or it is said to be full."""


def size(count: int) -> str:
    """Return bytes as people read them."""
    value = float(count)
    for unit in ("B", "kB", "MB", "GB"):
        if value < 1000.0:  # noqa: PLR2004 - the next unit
            return f"{value:.0f} {unit}" if unit == "B" else f"{value:.1f} {unit}"
        value /= 1000.0
    return f"{value:.1f} TB"


def _due(overview: Overview, today: date) -> str:
    rows = []
    for person, due in overview.due:
        left = "" if due.last is None else _left(due.first, due.last, today)
        rows.append(
            f"<li class={ {'overdue': 'bad', 'due': 'ok', 'later': 'faint'}[due.state] }>"
            f"<strong>{escape(person.name)}</strong> {escape(due.said)}{left}</li>"
        )
    listed = f"<ul>{''.join(rows)}</ul>" if rows else "<p class=faint>Nobody is due.</p>"
    return f"<section id=due><h2>Who is due</h2>{listed}</section>"


def _left(first: date | None, last: date, today: date) -> str:
    if first is not None and today < first:
        return f" · in {(first - today).days} days"
    return f" · {(last - today).days} days left" if today <= last else (
        f" · since {(today - last).days} days; <code>labcrane waive</code> lets it be run"
    )  # fmt: skip


def _groups(overview: Overview) -> str:
    if not overview.groups:
        return ""
    most = max(1, *(held for held, _ in overview.groups.values()))
    rows = "".join(
        f"<tr><th scope=row>{escape(name)}</th><td>{held}</td><td>{complete}</td>"
        f'<td><span class=bar style="width:{8.0 * held / most:.2f}rem"></span></td></tr>'
        for name, (held, complete) in overview.groups.items()
    )
    said = "balanced" if overview.balanced else "not balanced: the next participants even it out"
    return (
        f"<section id=groups><h2>Groups: {said}</h2><div class=wide tabindex=0 role=group "
        "aria-label=Groups><table><thead><tr><th scope=col>group</th><th scope=col>hold a slot</th>"
        "<th scope=col>complete</th><td></td></tr>"
        f"</thead><tbody>{rows}</tbody></table></div></section>"
    )


def _people(overview: Overview) -> str:
    rows = "".join(_row(person, overview) for person in overview.people)
    erased = "".join(f"<li>{escape(line)}</li>" for line in overview.erased)
    gone = f"<h3>Erased</h3><ul>{erased}</ul>" if erased else ""
    heads = ("participant", "group", "sessions", "consent", "deviations", "disk")
    head = "".join(f"<th scope=col>{name}</th>" for name in heads)
    table = (
        "<div class=wide tabindex=0 role=group aria-label=Participants><table>"
        f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
        if rows
        else "<p class=faint>Nobody has been enrolled yet.</p>"
    )
    return f"<section id=people><h2>Participants</h2>{table}{gone}</section>"


def _row(person: Person, overview: Overview) -> str:
    notes = "".join(f"<small>note: {escape(text)}</small>" for text in person.notes)
    sat = "".join(_sat(person, each) for each in person.sat) or "<span class=faint>none</span>"
    report = ""
    page = Path("participants") / f"{person.name}.html"
    if overview.report is not None and (overview.report / page).is_file():
        report = f'<a class=look href="/report/{escape(page.as_posix())}">report</a>'
    return (
        f'<tr id="person-{escape(person.name)}"><th scope=row>{escape(person.name)}'
        f"<small>{escape(person.status)}: {escape(person.why)}</small>{notes}{report}</th>"
        f"<td>{escape(person.group) or '-'}</td><td>{sat}</td>"
        f"<td class={person.consent_level}>{escape(person.consent) or '-'}</td>"
        f"<td>{len(person.deviations) or '-'}</td><td class=number>{size(person.bytes)}</td></tr>"
    )


def _sat(person: Person, sat: Sat) -> str:
    said = "".join(f"<small>{escape(line)}</small>" for line in sat.said)
    look = ""
    if sat.number:
        where = urlencode({"person": person.name, "session": sat.number})
        named = escape(f"look at it: session {sat.number} of {person.name}")
        look = f'<a class=look href="/viewer?{escape(where)}" aria-label="{named}">look at it</a>'
    named = f"session {sat.number}" if sat.number else "recording"
    return (
        f'<details class="sat {sat.level}"><summary><span aria-hidden=true>{MARKS[sat.level]}'
        f"</span> {named}: {WORDS[sat.level]} {escape(sat.day)}</summary>{said}</details>{look}"
    )


def _deviations(overview: Overview) -> str:
    found = [(person.name, each) for person in overview.people for each in person.deviations]
    listed = f"<ul>{_each(found)}</ul>" if found else "<p class=faint>None.</p>"
    return f"<section id=deviations><h2>Deviations: {len(found)}</h2>{listed}</section>"


def _each(found: Iterable[tuple[str, Deviation]]) -> str:
    rows = []
    for name, one in found:
        session = f"session {one.session}" if one.session else ""
        trial = f"trial {one.trial}" if one.trial else ""
        where = ", ".join(filter(None, (session, trial)))
        detail = f": {one.detail}" if one.detail else ""
        said = f"{where} {one.what}{detail}".strip()
        rows.append(f"<li><strong>{escape(name)}</strong> {escape(said)}</li>")
    return "".join(rows)
