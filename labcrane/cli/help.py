"""Help of commands in plain words: grouped by purpose, and without notation of types."""

import re
from collections.abc import Iterable

from typer import Context
from typer.core import TyperCommand, TyperGroup

SECTIONS = {
    "Prepare a study": (
        "start", "new-study", "check", "plan", "pages", "doctor", "report-problem", "feedback",
        "simulate", "power", "approve", "amend", "methods", "plugins",
        "new-plugin", "schema",
    ),
    "Run": ("demo", "run", "resume", "consent", "streams", "record"),
    "Analyse": ("view", "report", "score", "export", "replay"),
    "Manage participants and data": (
        "study", "participants", "where", "note", "exclude", "waive", "deviations", "recover",
        "resync", "erase", "relabel", "transfer", "merge",
    ),
}  # fmt: skip
"""Commands by purpose, in the order of a study."""

OF_PLUGINS = "Commands from plugins"

WORDS = {
    "str": "TEXT",
    "int": "NUMBER",
    "int range": "NUMBER",
    "float": "NUMBER",
    "float range": "NUMBER",
    "path": "PATH",
    "list[str]": "TEXT",
    "list[path]": "PATH",
}
"""The word shown for a type; a choice is written out."""

ARGUMENT = re.compile(r"^  (?P<name>[A-Za-z_]+)(?P<type>(?: <[^>]+>)?(?:\.\.\.)?)", re.MULTILINE)
PLACE = re.compile(r"\{(?P<name>[A-Za-z_]+)\}")
TYPE = re.compile(r"<(?P<type>[a-z][^<>]*)>")


class Plain(TyperCommand):
    """A command with help for people who do not program."""

    def get_help(self, ctx: Context) -> str:  # type: ignore[override]  # the same class, vendored
        return plain(super().get_help(ctx))

    def get_usage(self, ctx: Context) -> str:  # type: ignore[override]  # as above
        return plain(super().get_usage(ctx))


class Sections(TyperGroup):
    """The list of all commands, by purpose."""

    def format_commands(self, ctx, formatter) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001 - typer's own, by version
        """Write a section for each purpose, and one for plugins."""
        names = self.list_commands(ctx)
        for title, chosen in sections(names):
            rows = [(name, self.get_command(ctx, name)) for name in chosen]
            width = formatter.width - 6 - max(map(len, names))
            with formatter.section(title):
                formatter.write_dl(
                    [(name, one.get_short_help_str(width)) for name, one in rows if one], col_max=14
                )


def sections(names: Iterable[str]) -> list[tuple[str, list[str]]]:
    """Return titles and the commands below each; what no section names comes from plugins."""
    there = list(names)
    found = [(title, [n for n in chosen if n in there]) for title, chosen in SECTIONS.items()]
    known = {name for chosen in SECTIONS.values() for name in chosen}
    found.append((OF_PLUGINS, [name for name in there if name not in known]))
    return [(title, chosen) for title, chosen in found if chosen]


def plain(text: str) -> str:
    """Return a help text with arguments in capitals and types in words, its columns as they were.

    ``{PROTOCOL}`` becomes ``PROTOCOL``, and ``--wait <float range>`` becomes ``--wait NUMBER``.
    """
    text = text.replace("[STUDY]...", "[STUDY]")  # declared so, to stand before what must be given
    text = PLACE.sub(lambda found: found["name"].upper(), text)
    before, title, rest = text.partition("Arguments:\n")
    if title:
        own, gap, others = rest.partition("\n\n")
        text = before + title + ARGUMENT.sub(_argument, own) + gap + others
    return TYPE.sub(_type, text)


def _argument(found: re.Match[str]) -> str:
    return f"  {found['name'].upper()}".ljust(len(found[0]))


def _type(found: re.Match[str]) -> str:
    word = WORDS.get(found["type"], found["type"] if "|" in found["type"] else "VALUE")
    following = found.string[found.end() : found.end() + 2]
    return word.ljust(len(found[0])) if following == "  " else word
