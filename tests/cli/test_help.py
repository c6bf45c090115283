"""Help of the command line: grouped, in plain words, at 80 columns."""

import re

import pytest

from labcrane.cli.app import MODULES
from labcrane.cli.help import SECTIONS, plain, sections
from labcrane.testing import main


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    main(words)
    return capsys.readouterr().out


COMMANDS = [name.replace("_", "-") for names in MODULES.values() for name in names]


def test_every_command_stands_in_one_section() -> None:
    listed = [name for chosen in SECTIONS.values() for name in chosen]
    assert sorted(listed) == sorted([*COMMANDS, "feedback", "plugins"])
    assert dict(sections([*listed, "of-a-plugin"]))["Commands from plugins"] == ["of-a-plugin"]


def test_the_list_of_commands_is_in_sections_and_fits_the_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    text = said(capsys, "--help")
    places = [text.index(f"{title}:") for title in [*SECTIONS, "Commands from plugins"]]
    assert places == sorted(places)
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize("command", COMMANDS)
def test_help_shows_arguments_in_capitals_and_no_notation_of_types(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    text = said(capsys, command, "--help")
    assert not re.search(r"[{}<>](?!=)", text), text
    usage = text.splitlines()[0].split()[3:]
    assert all(word.isupper() for word in usage), usage


def test_types_are_words_and_columns_stay_where_they_were() -> None:
    options = "  --wait <float range>  seconds\n  --local               stay\n"
    assert plain(options) == "  --wait NUMBER         seconds\n  --local               stay\n"
    assert plain("Usage: labcrane score [OPTIONS] {folder}") == (
        "Usage: labcrane score [OPTIONS] FOLDER"
    )
    assert plain("  --key <a|b>  which") == "  --key a|b    which"


def test_the_version_tells_what_a_bug_report_needs(capsys: pytest.CaptureFixture[str]) -> None:
    text = said(capsys, "--version")
    assert re.search(r"^labcrane \d+\.\d+\.\d+ in (/|[A-Z]:\\)", text)
    for word in (
        "Python 3.",
        "computer: ",
        "numpy ",
        "pylsl ",
        "panda3d ",
        "third-party plugins: ",
    ):
        assert word in text
