"""The contract test of commands, which a plugin's tests subclass."""

import inspect

import typer
from typer.testing import CliRunner

from labcrane.registry.offers import CommandOffer


class CommandContract:
    """What every command of a plugin must do. Provide the fixture ``command``."""

    def test_words_are_a_group_and_a_name_in_lower_case(self, command: CommandOffer) -> None:
        assert len(command.words) == 2, command.words
        assert all(word.isalpha() and word.islower() for word in command.words), command.words

    def test_help_tells_what_it_does_and_what_every_option_means(
        self, command: CommandOffer
    ) -> None:
        app = typer.Typer()
        app.command()(command.run)
        shown = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "200", "NO_COLOR": "1"})
        assert shown.exit_code == 0, shown.output
        said = inspect.getdoc(command.run) or ""
        assert said, f"{command.words} has no docstring, which is its help"
        assert said.split("\n")[0].rstrip(".")[:40] in shown.output
