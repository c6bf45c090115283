"""Commands that the start page offers, with the options and the help that they have."""

import inspect
from collections.abc import Iterator
from typing import Any, get_args, get_origin, get_type_hints

import typer

from labcrane.cli.help import SECTIONS
from labcrane.cli.plugin_groups import first_line
from labcrane.start.jobs import OfferedCommand, Option

OFFERED = (
    "check", "plan", "pages", "feedback preview", "doctor", "simulate", "power", "methods",
    "approve", "amend", "consent", "run", "resume", "study", "view", "report", "score", "export",
    "participants",
)  # fmt: skip
"""Commands with a button on the page, in the order of a study."""


def offered() -> Iterator[OfferedCommand]:
    """Yield the commands with a button, with the options and the help that they have."""
    from labcrane.cli.app import FEEDBACK, MODULES, function_of

    modules = {name: module for module, names in MODULES.items() for name in names}
    for name in OFFERED:
        group, _, own = name.partition(" ")
        run = function_of(FEEDBACK if own else modules[group], own or group)
        section = next(title for title, names in SECTIONS.items() if group in names)
        yield OfferedCommand(name, section, first_line(run), list(_options(run)))


def _options(run: Any) -> Iterator[Option]:
    hints = get_type_hints(run, include_extras=True)
    for name, parameter in inspect.signature(run).parameters.items():
        kind, about = get_args(hints[name])[:2]
        flag, off = "", ""
        if isinstance(about, typer.models.OptionInfo):
            decls = (about.default, *(about.param_decls or ()), f"--{name.replace('_', '-')}")
            given = next(one for one in decls if isinstance(one, str) and one.startswith("--"))
            flag, _, off = given.partition("/")
        types = {kind, *get_args(kind)}
        many = get_origin(kind) is list or any(get_origin(one) is list for one in types)
        needed = parameter.default is inspect.Parameter.empty and about.default_factory is None
        yield Option(
            name, flag, off, "flag" if bool in types else "many" if many else "text",
            about.help or "", needed,
        )  # fmt: skip
