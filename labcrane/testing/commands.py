"""The contract test of commands, which a plugin's tests subclass."""

import inspect

import typer
from typer.testing import CliRunner

from labcrane.registry.offers import CommandOffer


class CommandContract:
    """What every command of a plugin must do. Provide the fixture ``command``."""

    def test_words_are_a_group_and_a_name_in_lower_case(self, command: CommandOffer) -> None:
        words = [word for word in command.words if word.isalpha() and word.islower()]
        assert len(words) == len(command.words) == 2, (
            f"the command is called {command.words}; give two words of small letters, a group and "
            "a name, such as ('data', 'count')"
        )

    def test_help_tells_what_it_does_and_what_every_option_means(
        self, command: CommandOffer
    ) -> None:
        app = typer.Typer()
        app.command()(command.run)
        shown = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "200", "NO_COLOR": "1"})
        assert shown.exit_code == 0, (
            f"{command.words} cannot show its help; annotate what it takes as typer needs it: "
            f"{shown.output}"
        )
        said = inspect.getdoc(command.run) or ""
        assert said, f"{command.words} has no docstring, which is its help; write what it does"
        first = said.split("\n")[0].rstrip(".")
        assert first[:40] in shown.output, (
            f"the help of {command.words} does not have its docstring's first line {first!r}; "
            "leave out what a terminal would show otherwise, such as [square brackets]"
        )
