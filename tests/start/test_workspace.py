"""What the start page may ask for, over its door: paths, findings, commands, and a kill."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from rehearsal import loaded

from labcrane import ProtocolError
from labcrane.cli.offered import OFFERED, offered
from labcrane.cli.shipped import new_study
from labcrane.errors import StorageError
from labcrane.start.jobs import Option
from labcrane.start.service import Workspace


@pytest.fixture(autouse=True)
def _own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "state"))


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    lab, scratch = tmp_path / "lab", tmp_path / "scratch"
    lab.mkdir()
    scratch.mkdir()
    new_study("aiming", lab / "mine")
    return Workspace(lab, ["aiming"], list(offered()), scratch)


def ended(workspace: Workspace, number: int) -> dict[str, Any]:
    for _ in range(1200):
        if (told := workspace.job(number))["status"] is not None:
            return told
        time.sleep(0.1)
    raise AssertionError("the command does not end")


def test_only_studies_below_the_folder_or_opened_before_are_opened(
    workspace: Workspace, tmp_path: Path
) -> None:
    assert workspace.studies()["here"] == ["mine/protocol.yaml"]
    outside = new_study("crossover", tmp_path / "elsewhere")
    for path in (str(outside), "../elsewhere/protocol.yaml"):
        with pytest.raises(ProtocolError, match="is outside"):
            workspace.open(path)
    (workspace.root / "link").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ProtocolError, match="is outside"):
        workspace.open("link/protocol.yaml")
    Workspace(tmp_path / "elsewhere", [], [], tmp_path).open("protocol.yaml")
    assert workspace.open(str(outside))["path"] == str(outside), "opened before"
    assert workspace.studies()["recent"] == [str(outside)]


def test_a_study_that_another_start_page_has_open_is_refused_with_its_address(
    workspace: Workspace, tmp_path: Path
) -> None:
    """They shared a draft: each wrote over what the other had taken in."""
    new_study("crossover", workspace.root / "other")
    at = "http://127.0.0.1:1/start"
    first = Workspace(workspace.root, [], [], tmp_path, at)
    first.open("mine/protocol.yaml")
    workspace.open("other/protocol.yaml")
    with pytest.raises(
        StorageError,
        match=f"mine is open in another labcrane start, {at}; .*one \\(process {os.getpid()} holds",
    ):
        workspace.open("mine/protocol.yaml")
    assert workspace.document.study.parent.name == "other", "which stays open"
    first.open("mine/protocol.yaml")
    first.close()
    workspace.open("mine/protocol.yaml")
    workspace.close()
    assert not list(workspace.root.glob("*/.labcrane-start"))


def test_a_folder_that_is_open_is_held_with_the_folders_in_it(
    workspace: Workspace, tmp_path: Path
) -> None:
    new_study("crossover", workspace.root / "mine" / "sub")
    other = Workspace(workspace.root, [], [], tmp_path)
    for held, refused in (("mine", "mine/sub"), ("mine/sub", "mine")):
        workspace.open(f"{held}/protocol.yaml")
        with pytest.raises(StorageError, match=f"{held} is open in another labcrane start"):
            other.open(f"{refused}/protocol.yaml")
        assert not (workspace.root / refused / ".labcrane-start").exists()
        workspace.close()
        workspace = Workspace(workspace.root, [], [], tmp_path)
    workspace.open("mine/protocol.yaml")
    workspace.file("sub/protocol.yaml")
    workspace.open("mine/protocol.yaml")
    workspace.close()
    other.open("mine/sub/protocol.yaml")
    other.open("mine/protocol.yaml")
    other.close()


def test_a_study_whose_folder_is_removed_can_be_left_for_another(workspace: Workspace) -> None:
    workspace.open("mine/protocol.yaml")
    new_study("crossover", workspace.root / "other")
    shutil.rmtree(workspace.root / "mine")
    assert workspace.studies()["here"] == ["other/protocol.yaml"]
    assert workspace.open("other/protocol.yaml")["data"]


def test_nothing_runs_before_every_file_of_the_study_is_saved(workspace: Workspace) -> None:
    told = workspace.open("mine/protocol.yaml")
    workspace.edit(told["revision"], "set", ["participants", "planned"], 48)
    file = workspace.root / "mine" / "instructions.md"
    told = workspace.file("instructions.md")
    assert (told["unsaved"], told["others"]) == (False, ["protocol.yaml"])
    with pytest.raises(ProtocolError, match=r"not saved: protocol\.yaml"):
        workspace.run(told["revision"], "plan", {"protocol": "protocol.yaml"})
    told = workspace.splice(told["revision"], 0, 0, "Read this.\n")
    workspace.close()
    again = Workspace(workspace.root, [], [], workspace.scratch)
    told = again.open("mine/protocol.yaml")
    assert (told["unsaved"], told["others"]) == (True, ["instructions.md"]), "left by the first"
    file.with_name("protocol.lock.json").write_text("{}", encoding="utf-8")
    assert again.save(told["revision"], every=True)["ask"] == "approved"
    before = file.read_bytes()
    file.write_text("by another program", encoding="utf-8")
    with pytest.raises(ProtocolError, match=r"instructions\.md was changed by another program"):
        again.save(told["revision"], over_approved=True, every=True)
    file.write_bytes(before)
    told = again.save(told["revision"], over_approved=True, every=True)
    assert (told["unsaved"], told["others"]) == (False, [])
    assert file.read_text(encoding="utf-8").startswith("Read this.\n")
    assert "planned: 48" in file.with_name("protocol.yaml").read_text(encoding="utf-8")
    again.close()


def test_text_files_are_kept_and_saved_as_the_protocol_is(workspace: Workspace) -> None:
    protocol = workspace.open("mine/protocol.yaml")
    edit = ("set", ["participants", "planned"], 48)
    protocol = workspace.edit(protocol["revision"], *edit)
    told = workspace.file("instructions.md")
    assert (told["name"], told["study"], told["data"]) == ("instructions.md", "protocol.yaml", None)
    told = workspace.splice(told["revision"], 0, 0, "Read this 🏗.\n")
    file = workspace.root / "mine" / "instructions.md"
    file.write_text("by another program", encoding="utf-8")
    assert workspace.save(told["revision"])["ask"] == "newer"
    assert workspace.file("protocol.yaml")["data"]["participants"]["planned"] == 48
    told = workspace.file("instructions.md")
    workspace.save(told["revision"], over_newer=True)
    assert file.read_text(encoding="utf-8").startswith("Read this 🏗.\n")
    assert workspace.file("tlx.yaml", new=True)["text"] == ""
    for name, why in (
        ("../x.md", "cannot name"), (".x.md", "cannot name"), ("data.h5", "cannot name"),
        ("tlx.yaml", "exists already"),
    ):  # fmt: skip
        with pytest.raises(ProtocolError, match=why):
            workspace.file(name, new=True)


@pytest.mark.slow
def test_the_plan_is_that_of_the_text_as_it_is_typed(workspace: Workspace) -> None:
    told = workspace.open("mine/protocol.yaml")
    workspace.edit(told["revision"], "set", ["participants", "planned"], 8)
    told = workspace.plan()
    assert [each["participant"] for each in told["sessions"]] == [f"P00{n}" for n in range(1, 9)]
    assert told["balance"] == [
        "balanced: groups of equal size: none 2, visual 2, auditory 2, both 2"
    ]
    assert told["line"] == "labcrane plan protocol.yaml"


@pytest.mark.slow
def test_a_report_is_opened_as_a_file_and_only_below_the_study(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    workspace.open("mine/protocol.yaml")
    report = workspace.root / "mine" / "report.html"
    for path in (report, workspace.root / "other.html"):
        path.write_text("<p>", encoding="utf-8")
    workspace.run(0, "plan", {"protocol": "protocol.yaml"})
    ended(workspace, 0)
    workspace.look(0, "report.html")
    for path in ("../other.html", "protocol.yaml", "none.html"):
        with pytest.raises(ProtocolError, match="no report"):
            workspace.look(0, path)
    assert opened == [report.as_uri()]


@pytest.mark.slow
def test_pictures_are_only_those_below_the_study(workspace: Workspace) -> None:
    workspace.open("mine/protocol.yaml")
    folder = workspace.root / "mine"
    (folder / "seen").mkdir()
    for path in (folder / "seen" / "a.png", workspace.root / "b.png"):
        path.write_bytes(b"png")
    workspace.run(0, "plan", {"protocol": "protocol.yaml"})
    ended(workspace, 0)
    assert workspace.picture(1, "seen/a.png") is None, "of no command"
    assert workspace.picture(0, "seen/a.png") == folder / "seen" / "a.png"
    for path in ("../b.png", "protocol.yaml", "seen/c.png", "/etc/hostname"):
        assert workspace.picture(0, path) is None


@pytest.mark.slow
def test_the_text_is_checked_as_it_is_typed_and_the_finding_has_its_place(
    workspace: Workspace,
) -> None:
    told = workspace.open("mine/protocol.yaml")
    assert workspace.check() == {"revision": 0, "fine": True, "findings": []}
    at = told["text"].index("use: sphere")
    told = workspace.splice(0, at, at + len("use: sphere"), "use: spere")
    [finding] = workspace.check()["findings"]
    assert "did you mean 'sphere'" in finding["message"]
    lines = told["text"].splitlines()
    assert "use: spere" in lines[finding["line"] - 1]
    assert (["feedback", "ball", "use"], finding["line"]) in [each[:2] for each in told["places"]]
    assert "spere" not in (workspace.root / "mine" / "protocol.yaml").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_saved_study_is_the_same_study_but_for_its_field(workspace: Workspace) -> None:
    path = workspace.root / "mine" / "protocol.yaml"
    before = loaded(path).protocol.model_dump()
    workspace.open("mine/protocol.yaml")
    workspace.edit(0, "set", ["participants", "planned"], 48)
    workspace.save(1)
    after = loaded(path).protocol.model_dump()
    assert after == before | {"participants": before["participants"] | {"planned": 48}}


@pytest.mark.slow
def test_a_copy_is_made_by_the_command_and_a_taken_name_is_refused(workspace: Workspace) -> None:
    made = workspace.copy("aiming", "second")
    assert made["path"] == str(workspace.root / "second" / "protocol.yaml")
    assert made["data"]["study"] == "second"
    assert made["line"] == "labcrane new-study aiming second"
    with pytest.raises(ProtocolError, match="exists already"):
        workspace.copy("aiming", "second")
    for name in ("../out", ".hidden", "a/b"):
        with pytest.raises(ProtocolError, match="cannot name a folder"):
            workspace.copy("aiming", name)


def test_the_options_of_commands_are_those_that_their_help_lists(
    capsys: pytest.CaptureFixture[str],
) -> None:
    from labcrane.testing import main

    found = {each.name: each for each in offered()}
    assert tuple(found) == OFFERED
    for name in ("run", "export", "simulate"):
        main([name, "--help"])
        told = capsys.readouterr().out
        for option in found[name].options:
            assert option.flag in told, (name, option)
    assert [each.flag for each in found["export"].options if each.required] == ["--to", "--out"]


def test_values_become_words_of_a_command_line_and_never_other_options() -> None:
    found = {each.name: each for each in offered()}
    run = found["run"]
    assert run.words({"protocol": "p.yaml", "participant": "P001", "page": False}) == [
        "run", "--participant=P001", "--no-page", "p.yaml",
    ]  # fmt: skip
    assert run.words({"protocol": "--help", "participant": "--fast"}) == [
        "run", "--participant=--fast", "--", "--help",
    ]  # fmt: skip
    given = {"to": "zip", "folder": "o", "include": "pilot simulated"}
    assert found["export"].words(given)[1:] == [
        "--to=zip", "--out=o", "--include=pilot", "--include=simulated",
    ]  # fmt: skip
    with pytest.raises(ProtocolError, match="needs --participant"):
        run.words({})
    with pytest.raises(ProtocolError, match="no option 'shell'"):
        run.words({"participant": "P001", "shell": "x"})
    assert isinstance(run.options[0], Option)


@pytest.mark.slow
def test_a_command_prints_its_line_and_its_output(workspace: Workspace) -> None:
    workspace.open("mine/protocol.yaml")
    workspace.run(
        workspace.document.revision, "plan", {"protocol": "protocol.yaml", "participants": "2"}
    )
    told = ended(workspace, 0)
    assert (told["status"], told["line"]) == (0, "labcrane plan --participants=2 protocol.yaml")
    assert "P002: slot 2" in told["output"]
    with pytest.raises(ProtocolError, match="does not offer"):
        workspace.run(0, "erase", {})


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows stops by another signal")
def test_stopping_is_stopping_the_command(workspace: Workspace) -> None:
    workspace.open("mine/protocol.yaml")
    workspace.run(
        workspace.document.revision,
        "simulate",
        {"protocol": "protocol.yaml", "folder": "sim", "participants": "500"},
    )
    for _ in range(600):
        if (workspace.root / "mine" / "sim").exists():
            break
        time.sleep(0.1)
    workspace.stop(0)
    assert ended(workspace, 0)["status"] not in (0, None)
    assert workspace.still_running() == []


@contextmanager
def served(lab: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    words = [sys.executable, "-m", "labcrane", "start", str(lab), "--no-browser"]
    server = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=os.environ)
    try:
        yield server, next(x for x in server.stdout if x.startswith("start: ")).split()[1]
    finally:
        server.kill()
        server.wait(60)
        server.stdout.close()


class Browser:
    """As much of a browser as the door asks for."""

    def __init__(self, link: str) -> None:
        self.place = urlsplit(link)
        status, headers, _ = self.get(f"/start?{self.place.query}")
        assert status == 303
        self.cookie = headers["set-cookie"].split(";")[0]

    def get(self, path: str, method: str = "GET", body: str = "", **headers: str) -> Any:
        connection = HTTPConnection(self.place.hostname, self.place.port, timeout=120)
        if hasattr(self, "cookie"):
            headers.setdefault("Cookie", self.cookie)
        connection.request(method, path, body, headers)
        answer = connection.getresponse()
        told = answer.status, dict(answer.headers), answer.read().decode()
        connection.close()
        return told

    def ask(self, name: str, **given: Any) -> Any:
        status, _, told = self.get(f"/ask/{name}", "POST", json.dumps(given))
        assert status == 200, told
        return json.loads(told)


@pytest.mark.slow
def test_the_door_lets_in_one_browser_of_this_computer_and_no_other_page(
    workspace: Workspace, tmp_path: Path
) -> None:
    with served(workspace.root) as (_, link):
        browser = Browser(link)
        assert browser.get("/start")[0] == 200
        assert "set-cookie" not in browser.get(f"/start?{browser.place.query}", Cookie="")[1]
        for path in ("/start", "/ask/studies", "/asset/start.js", "/picture/a.png"):
            assert browser.get(path, Cookie="")[0] == 403, path
        assert browser.get("/start", Host="evil.example")[0] == 421
        assert browser.get("/ask/studies", "POST", "{}", Origin="http://evil.example")[0] == 403
        assert browser.get("/ask/studies", "GET")[0] == 405
        assert browser.get("/asset/service.py")[0] == 404
        assert browser.get("/ask/open", "POST", '{"path": "../../x.yaml"}')[0] == 409
        browser.ask("open", path="mine/protocol.yaml")
        pasted = {"revision": 0, "begin": 0, "end": 0, "text": f"# {'x' * 200_000}\n"}
        assert len(browser.ask("splice", **pasted)["text"]) > 200_000
        status, _, why = browser.get("/ask/splice", "POST", json.dumps({"text": "x" * 256_000}))
        assert (status, why) == (413, "labcrane: more than 256000 bytes")
        for name, body in (("nix", "{}"), ("open", "{}"), ("open", "[1]"), ("open", "{")):
            assert browser.get(f"/ask/{name}", "POST", body)[0] == 400, (name, body)


@pytest.mark.slow
def test_a_server_that_is_killed_has_lost_nothing_that_was_sent(workspace: Workspace) -> None:
    file = workspace.root / "mine" / "protocol.yaml"
    before = file.read_text(encoding="utf-8")
    with served(workspace.root) as (server, link):
        browser = Browser(link)
        browser.ask("open", path="mine/protocol.yaml")
        browser.ask("edit", revision=0, how="set", place=["participants", "planned"], value=48)
        server.send_signal(signal.SIGTERM if sys.platform == "win32" else signal.SIGKILL)
        server.wait(60)
    file.write_text("# by another program\n" + before, encoding="utf-8")
    with served(workspace.root) as (_, link):
        browser = Browser(link)
        told = browser.ask("open", path="mine/protocol.yaml")
        assert (told["data"]["participants"]["planned"], told["restored"]) == (48, True)
        assert told["newer"]
        assert browser.ask("save", revision=0)["ask"] == "newer"
        assert file.read_text(encoding="utf-8").startswith("# by another program")
        told = browser.ask("save", revision=0, over_newer=True)
        assert not told["unsaved"]
    assert file.read_text(encoding="utf-8") == before.replace("planned: 36", "planned: 48")


def test_a_page_of_another_study_changes_and_runs_nothing(workspace: Workspace) -> None:
    """What was typed in a tab of study A went into study B, which another tab had opened."""
    other = new_study("crossover", workspace.root / "other")
    first = workspace.open("mine/protocol.yaml")["revision"]
    workspace.open("other/protocol.yaml")
    before = other.read_bytes()
    refused = (
        lambda: workspace.splice(first, 0, 0, "# typed for the other\n"),
        lambda: workspace.edit(first, "set", ["title"], "A"),
        lambda: workspace.save(first),
        lambda: workspace.run(first, "check", {"protocol": "protocol.yaml"}),
    )
    for each in refused:
        with pytest.raises(ProtocolError, match="another window"):
            each()
    assert other.read_bytes() == before
    assert not workspace.document.unsaved


@pytest.mark.parametrize("end", ["zz: {x}", "? b", "a: .nan", "b: 1e999", "a: &x {b: *x}"])
def test_a_text_half_written_is_shown_and_can_be_mended(workspace: Workspace, end: str) -> None:
    """Every answer was an error, also after a restart: the draft brought the text back."""
    shown = workspace.open("mine/protocol.yaml")
    at = len(shown["text"])
    shown = workspace.splice(shown["revision"], at, at, f"{end}\n")
    assert workspace.show()["text"].endswith(f"{end}\n")
    mended = workspace.splice(shown["revision"], at, at + len(end) + 1, "")
    assert mended["data"]["study"]


def test_a_module_in_the_studys_folder_is_not_imported(workspace: Workspace) -> None:
    (workspace.root / "mine" / "random.py").write_text("raise SystemExit(3)")
    workspace.open("mine/protocol.yaml")
    assert workspace.check()["fine"]
