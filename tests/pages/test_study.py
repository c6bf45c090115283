"""The study's page: who is due, how good every session is, and the way to viewer and report."""

import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from datetime import date, timedelta
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from faults.sessions import wait_for
from governed import GROUPED, TODAY, Lab
from pages.looks import check
from pages.room import text
from selenium import webdriver
from selenium.common.exceptions import WebDriverException
from selenium.webdriver.common.by import By

from labcrane import ProtocolError, RecordingError
from labcrane.participants.enrolment import exclude, note
from labcrane.participants.register import Sitting, changed, read
from labcrane.participants.session_windows import check_visit
from labcrane.testing import Command, Order, discover, load, main
from labcrane.web.study.overview import Overview, Reader
from labcrane.web.study.study_page import page_of, size

SECOND = "  - name: later\n    after_days: [7, 9]\n    steps:\n      - block: {{task: aiming}}\n"
TWICE = GROUPED + SECOND.replace("{{", "{").replace("}}", "}")


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    """Three have been, one of them ended early and one left, a fourth is enrolled; a report."""
    lab = Lab(tmp_path_factory.mktemp("study"), TWICE)
    lab.protocol = lab.protocol.rename(lab.folder / "protocol.yaml")
    lab.approve()
    lab.run("P001")
    lab.run("P002", orders={900: [Command(Order.END)]})
    lab.run("P003")
    lab.consent("P004")
    exclude(lab.places, "P003", "moved away", TODAY)
    note(lab.places, "P002", "felt <b>unwell</b>")
    report = ["report", str(lab.places.root), "--out", str(lab.folder / "report")]
    assert main([*report, "--include", "half-finished"]) == 0
    return lab


def sat_on(lab: Lab, day: date) -> None:
    """Let everybody's first session have been on a day, as the register has it."""
    with changed(lab.places) as register:
        for entry in register.participants.values():
            entry.sessions = [
                Sitting.model_validate(one.model_dump() | {"date": day.isoformat()})
                for one in entry.sessions
            ]


def overview(lab: Lab, today: date = TODAY) -> Overview:
    return Reader.of(lab.folder).overview(today)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("days", "state"), [(0, "later"), (6, "later"), (7, "due"), (9, "due"), (10, "overdue")]
)
def test_a_session_is_due_in_the_window_that_the_protocol_gives(
    lab: Lab, days: int, state: str
) -> None:
    sat_on(lab, TODAY)
    found = {p.name: due for p, due in overview(lab, TODAY + timedelta(days)).due}
    assert set(found) == {"P001", "P002", "P004"}, "who was excluded is not waited for"
    assert (found["P001"].session, found["P001"].state) == (2, state)
    assert (found["P001"].first, found["P001"].last) == (
        TODAY + timedelta(7), TODAY + timedelta(9)
    )  # fmt: skip
    assert (found["P004"].session, found["P004"].state) == (1, "due")


@pytest.mark.slow
@pytest.mark.parametrize("waivers", [{}, {"2": "travels"}, {"3": "of another session"}])
def test_the_page_and_the_session_agree_on_the_days_that_are_allowed(
    lab: Lab, waivers: dict[str, str]
) -> None:
    sat_on(lab, TODAY)
    with changed(lab.places) as register:
        register.participants["P001"].waivers = waivers
    study = load(lab.protocol, discover(study=lab.protocol))
    for day in (TODAY + timedelta(days) for days in range(14)):
        [due] = [due for person, due in overview(lab, day).due if person.name == "P001"]
        try:
            check_visit(read(lab.places), study, "P001", 2, day)
        except ProtocolError:
            assert due.state in {"later", "overdue"}
        else:
            assert due.state == "due"
    with changed(lab.places) as register:
        register.participants["P001"].waivers = {}


@pytest.mark.slow
def test_every_session_has_its_quality_and_every_person_consent_and_deviations(lab: Lab) -> None:
    people = {person.name: person for person in overview(lab).people}
    assert [person.sat[0].level for name, person in people.items() if person.sat] == [
        "ok", "warn", "ok",
    ]  # fmt: skip
    assert any("ended" in line for line in people["P002"].sat[0].said)
    assert any("none late" in line for line in people["P001"].sat[0].said)
    assert [one.what for one in people["P002"].deviations] == ["session ended early"]
    assert people["P003"].status == "excluded"
    assert "moved away" in people["P003"].why
    assert all(person.consent_level == "ok" for person in people.values())
    assert people["P004"].sat == ()
    assert people["P001"].sat[0].day == TODAY.isoformat(), "as the register has it"
    for name, person in people.items():
        folder = lab.places.root / name
        assert person.bytes == sum(f.stat().st_size for f in folder.rglob("*") if f.is_file())


@pytest.mark.slow
def test_consent_to_an_earlier_text_and_none_at_all_stand_out(lab: Lab, tmp_path: Path) -> None:
    copy = Lab(tmp_path, TWICE + "participants: {pattern: 'VP-[0-9]{3}'}\n")
    copy.protocol = copy.protocol.rename(copy.folder / "protocol.yaml")
    copy.approve()
    for name in ("VP-001", "VP-002", "VP-003"):
        copy.run(name)
    with changed(copy.places) as register:
        register.participants["VP-001"].consent[0].version = "0123456789ab"
        register.participants["VP-002"].consent = []
        del register.participants["VP-003"]
    levels = {person.name: person.consent_level for person in overview(copy).people}
    assert levels == {"VP-001": "warn", "VP-002": "bad", "VP-003": "bad"}


@pytest.mark.slow
def test_groups_are_counted_by_their_slots(lab: Lab) -> None:
    found = overview(lab)
    assert sum(held for held, _ in found.groups.values()) == 3, "who left holds none"
    assert sum(complete for _, complete in found.groups.values()) == 0, "a second session is due"
    even = {"a": (1, 0), "b": (2, 0), "c": (1, 1)}
    assert replace(found, groups=even).balanced
    assert not replace(found, groups=even | {"b": (3, 0)}).balanced
    assert replace(found, groups={}).balanced


@pytest.mark.slow
def test_the_page_says_whom_it_does_not_count_and_how_many_days_are_left(lab: Lab) -> None:
    sat_on(lab, TODAY)
    for days, words in ((5, "in 2 days"), (6, "in 1 day"), (8, "1 day left"), (11, "since 2 days")):
        day = TODAY + timedelta(days)
        assert re.search(rf" · {words}\b", page_of(overview(lab, day), day, "now"))
    found = overview(lab)
    assert "not counted" not in page_of(found, TODAY, "now")
    people = tuple(replace(one, status="simulated") for one in found.people)
    page = page_of(replace(found, people=people), TODAY, "now")
    assert f"participants; {len(people)} simulated or pilot, not counted" in page


@pytest.mark.slow
def test_a_file_is_read_again_only_when_it_has_changed(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    from labcrane.web.study import overview as module

    read: list[str] = []
    measure = module.loop_quality
    monkeypatch.setattr(module, "loop_quality", lambda own: read.append(own.name) or measure(own))
    reader = Reader.of(lab.folder)
    first = reader.overview(TODAY)
    assert sorted(read) == ["P001", "P002", "P003"]
    assert reader.overview(TODAY).people == first.people
    assert len(read) == 3
    file = lab.places.root / "P001" / "P001.h5"
    file.write_bytes(file.read_bytes()[:2000])
    damaged = {person.name: person for person in reader.overview(TODAY).people}["P001"]
    assert damaged.status == "unreadable"
    assert [(sat.number, sat.level) for sat in damaged.sat] == [(0, "bad")]


@pytest.mark.slow
def test_what_people_wrote_is_text_on_the_page_and_no_markup(lab: Lab) -> None:
    page = page_of(overview(lab), TODAY, "now")
    assert "felt &lt;b&gt;unwell&lt;/b&gt;" in page
    assert "<b>unwell" not in page


def test_an_empty_folder_and_none_say_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    page = page_of(Reader.of(tmp_path).overview(TODAY), TODAY, "now")
    assert "No participants are enrolled yet." in page
    with pytest.raises(RecordingError, match="give the study's folder, its protocol or its data"):
        Reader.of(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("count", "said"), [(0, "0 B"), (999, "999 B"), (1500, "1.5 kB"), (2.5e9, "2.5 GB")]
)
def test_sizes_are_said_in_the_unit_that_fits(count: float, said: str) -> None:
    assert size(int(count)) == said


@pytest.fixture(scope="module")
def served(lab: Lab) -> Iterator[str]:
    words = [sys.executable, "-m", "labcrane", "study", str(lab.folder)]
    server = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        yield next(line for line in server.stdout if line.startswith("study: ")).split()[1]
    finally:
        server.terminate()
        server.wait(240)
        server.stdout.close()


def answer(link: str, path: str, **headers: str) -> int:
    place = urlsplit(link)
    connection = HTTPConnection(place.hostname, place.port, timeout=240)
    connection.request("GET", path, headers=headers)
    status = connection.getresponse().status
    connection.close()
    return status


@pytest.mark.long
def test_the_page_leads_to_every_viewer_and_report_and_lets_nobody_else_in(
    served: str, lab: Lab, browser: webdriver.Chrome
) -> None:
    def there() -> bool:
        try:
            browser.get(served)
        except WebDriverException:
            return False
        return bool(browser.find_elements(By.ID, "people"))

    wait_for(there)
    check(browser, "study")
    for summary in browser.find_elements(By.CSS_SELECTOR, "summary"):
        summary.click()
    check(browser, "study, with every session's quality")
    assert "overdue" not in text(browser, "due")
    cookie = "; ".join(f"{each['name']}={each['value']}" for each in browser.get_cookies())
    for path in ("/study", "/report/report.html", "/viewer?person=P002&session=1"):
        assert answer(served, path) == 403, "without the cookie"
        assert answer(served, path, Cookie=cookie, Host="evil.example") == 421
        assert answer(served, path, Cookie=cookie, Origin="http://evil.example") == 403
    assert answer(served, "/study?token=wrong", Cookie="") == 403
    assert answer(served, "/report/../../protocol.yaml", Cookie=cookie) == 404
    assert answer(served, "/report/%2e%2e/protocol.yaml", Cookie=cookie) == 404
    browser.find_element(By.LINK_TEXT, "The study's report").click()
    wait_for(
        lambda: browser.find_elements(By.TAG_NAME, "figure") or "Sample" in browser.page_source
    )
    browser.back()
    browser.find_element(
        By.CSS_SELECTOR, "a[aria-label='Open recording: session 1 of P002']"
    ).click()
    wait_for(lambda: browser.find_elements(By.ID, "scrub"))
    wait_for(lambda: "P002" in text(browser, "title"))
