"""Generator of the pages that are read off the program: every key, every plugin, all decisions.

mkdocs calls :func:`on_files` while it builds the site, so these pages are never out of date there.
In the repository they stand as ``python docs/generate.py docs`` wrote them; a test compares.
"""

import argparse
import ast
import re
import tomllib
from collections.abc import Iterator, Mapping
from inspect import cleandoc
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from labcrane import Settings
from labcrane.core.roles import Component, Feedback, Questionnaire, Task
from labcrane.core.signals import Signal
from labcrane.errors import LabcraneError
from labcrane.machines.library import load_machine
from labcrane.machines.machine import Machine
from labcrane.protocol.protocol import protocol_model
from labcrane.protocol.steps import Block, Break, Fixation
from labcrane.protocol.study import load
from labcrane.registry.hookspecs import ROLES
from labcrane.registry.offers import Offer
from labcrane.registry.registry import Registry, discover

HERE = Path(__file__).parent
PROTOCOLS = HERE.parent / "protocols"
Schema = Mapping[str, Any]


def pages() -> dict[str, str]:
    """Return the generated pages, by path below ``docs/``."""
    return {
        "reference/protocol.md": protocol_page(),
        **{f"reference/{name}.md": text for name, text in plugin_pages()},
        "decisions/index.md": decisions_page(),
    }


def protocol_page() -> str:
    """Return every key of a protocol with its type, default and meaning."""
    schema = protocol_model().model_json_schema()
    parts = {name: part for name, part in schema["$defs"].items() if name not in OWN_WORDS}
    parts |= {"Block": Block.model_json_schema(), "Break": Break.model_json_schema()}
    parts["Fixation"] = Fixation.model_json_schema()
    lines = [
        "# Every key of a protocol",
        "",
        "For authors of protocols. The tables list every key with its type, default and meaning; "
        "keys of a component beside `use:` are on the page of its role. `labcrane check` names "
        "each wrong key with its line and what is possible.",
        "",
        *keys(schema),
    ]
    for name, part in sorted(parts.items()):
        lines += ["", f"## {name}", "", *summary(part), "", *keys(part)]
    return "\n".join([*lines, "", *STEPS])


STEPS = (
    "## Steps of a session",
    "",
    "| step | value |",
    "|---|---|",
    "| `consent` | none: `- consent`. The examiner confirms it |",
    "| `instructions` | a text file beside the protocol |",
    "| `questionnaire` | a name, or a list of names |",
    "| `fixation` | a [check of the eye tracker](#fixation); `{}` for five points |",
    "| `practice` | a [block](#block) whose trials do not count; may have `until` |",
    "| `reference` | a [block](#block) that later ones are compared with |",
    "| `block` | a [block](#block) |",
    "| `break` | a [break](#break) |",
)


def keys(schema: Schema) -> Iterator[str]:
    """Yield a table of a model's keys; a key that says nothing itself means what its model does."""
    models = schema.get("$defs", {})
    yield "| key | takes | default | means |"
    yield "|---|---|---|---|"
    ways = (schema, *schema.get("anyOf", ()))  # what can be left out when another key is given
    needed = {name for way in ways for name in way.get("required", ())}
    for name, part in schema.get("properties", {}).items():
        wanted = name in needed and "default" not in part
        default = "needed" if wanted else shown(part.get("default", {}))
        model = models.get(part.get("$ref", "").rsplit("/", 1)[-1], {})
        means = cell(part.get("description") or model.get("description", ""))
        yield f"| `{name}` | {takes(part)} | {default} | {means} |"


def summary(schema: Schema) -> list[str]:
    """Return a model's description, without the markup of Python's own documentation."""
    return [plain(schema.get("description", ""))]


def takes(part: Schema) -> str:
    """Return in words what a key takes."""
    if "$ref" in part:
        name = part["$ref"].rsplit("/", 1)[-1]
        return OWN_WORDS.get(name, f"[{name}](#{name.lower()})")
    if "const" in part:
        return f"`{part['const']}`"
    if "enum" in part:
        return " or ".join(f"`{value}`" for value in part["enum"])
    if several := part.get("anyOf") or part.get("allOf") or part.get("oneOf"):
        return " or ".join(dict.fromkeys(takes(each) for each in several))
    if part.get("type") in ("array", "object"):
        return several_of(part)
    if part.get("type") in ("number", "integer"):
        return " ".join([part["type"].replace("integer", "whole number"), *limits(part)])
    if part.get("format") == "path":
        return "file"
    return PLAIN_WORDS.get(part.get("type", ""), "anything")


OWN_WORDS = {
    "Use": "a component: `{use: NAME}`",
    "WarnLimit": "[number, number]",
    "Step": "[step](#steps-of-a-session)",
}
PLAIN_WORDS = {"null": "`null`", "boolean": "`true` or `false`", "string": "text"}


def several_of(part: Schema) -> str:
    """Return in words what a list or a mapping takes."""
    if "prefixItems" in part:
        return f"[{', '.join(takes(each) for each in part['prefixItems'])}]"
    if part["type"] == "array":
        return f"list of {takes(part.get('items', {}))}"
    named = part.get("additionalProperties")  # True where anything may be said
    return f"by name: {takes(named if isinstance(named, dict) else {})}"


def limits(part: Schema) -> Iterator[str]:
    """Yield the limits of a number."""
    signs = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    for key, sign in signs.items():
        if key in part:
            yield f"{sign} {part[key]:g}"


def shown(value: Any) -> str:
    """Return a default as a protocol would have it."""
    if isinstance(value, dict) and value != {}:
        return "see there"
    words = {True: "true", False: "false", None: "null"}
    text = words.get(value) if isinstance(value, bool | None) else None
    return f"`{cell(text if text is not None else str(value))}`"


def plain(text: str) -> str:
    """Return a docstring as Markdown."""
    text = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", cleandoc(text)).replace("``", "`")
    return re.split(r"\n\s*(?:Attributes|Parameters)\n\s*-{3,}", text)[0].strip()


def cell(text: str) -> str:
    """Return text that fits a cell of a table."""
    return " ".join(plain(text).split()).replace("|", "\\|")


def plugin_pages() -> Iterator[tuple[str, str]]:
    """Yield a page for every role: its components, their settings, and what they record."""
    registry = discover()
    used = used_settings(registry)
    machine = load_machine("ch8")
    for role, entry in ROLES.items():
        if not (offers := registry.offers[role]):
            continue
        lines = [
            f"# {entry.word.capitalize()}: what is installed",
            "",
            READERS,
            "",
            plain(role.__doc__ or ""),
        ]
        for name, offer in sorted(offers.items()):
            plugin = registry.plugins[role][name]
            component = build(offer, *used.get(name, (None, machine)))
            lines += ["", f"## {name}", "", *about(component, plugin)]
            lines += settings_of(offer.settings)
            lines += recorded(component)
        yield entry.word, "\n".join([*lines, ""])


READERS = (
    "For authors of protocols and plugins. The tables list every component of this role that comes "
    "with labcrane: its settings, and what it records."
)


def used_settings(registry: Registry) -> dict[str, tuple[Settings, Machine]]:
    """Return settings under which components that need some can be built, as our studies do."""
    found = {}
    for path in sorted(PROTOCOLS.glob("*/protocol.yaml")):
        study = load(path, registry)
        choices = [study.input, study.operator, study.scheme, study.dynamics]
        choices += [*study.task_choices.values(), *study.cues.values(), *study.sounds.values()]
        found |= {choice.name: (choice.settings, study.machine) for choice in choices}
    return found


def build(offer: Offer[Component], settings: Settings | None, machine: Machine) -> Component | None:
    """Return a component, not open; None when it cannot be built without settings of a study."""
    try:
        return offer.build(settings or offer.settings(), machine)
    except (LabcraneError, ValueError, OSError):
        return None


def about(component: Component | None, plugin: str) -> Iterator[str]:
    """Yield what a component is, and where it comes from."""
    if component is not None:
        yield plain(type(component).__doc__ or "")
        yield ""
    yield f"Plugin `{plugin}`."
    yield ""


def settings_of(model: type[BaseModel]) -> Iterator[str]:
    """Yield the settings of a component, and the parts that they are made of."""
    schema = model.model_json_schema()
    if not schema.get("properties"):
        yield "It has no settings."
        return
    # The parts of one component are headed by its own page, so links stay within it.
    yield from (unlinked(line) for line in keys(schema))
    for name, part in sorted(schema.get("$defs", {}).items()):
        if part.get("properties"):
            yield from ("", f"**{name}** {cell(part.get('description', ''))}", "")
            yield from (unlinked(line) for line in keys(part))


def unlinked(line: str) -> str:
    """Return a row whose parts are described right below it."""
    return re.sub(r"\[(\w+)\]\(#\w+\)", r"\1", line)


def recorded(component: Component | None) -> Iterator[str]:
    """Yield the signals that a component records."""
    if component is None:
        yield from ("", "What it records depends on its settings.")
        return
    groups = {"Records": component.signals}
    if isinstance(component, Task):
        groups["What is varied in trials"] = component.conditions
        groups["A trial is measured by"] = component.results
    if isinstance(component, Feedback):
        groups |= {f"Stream `{name}`": signals for name, signals in component.streams.items()}
    for title, signals in groups.items():
        if signals:
            defined = any(signal.definition for signal in signals)
            last = "definition" if defined else "components"
            yield from ("", f"{title}:", "", f"| signal | unit | {last} |", "|---|---|---|")
            yield from map(definition_row if defined else signal_row, signals)
    if isinstance(component, Questionnaire):
        rows = (
            f"| `{each.name}` | {each.lowest:g} to {each.highest:g} |" for each in component.scores
        )
        yield from ("", f"Words: {cell(component.rights)}", "")
        yield from ("| score | range |", "|---|---|", *rows) if component.scores else ()


def signal_row(signal: Signal) -> str:
    """Return a row of a table of signals."""
    parts = ", ".join(f"`{part}`" for part in signal.components) or "one number"
    return f"| `{signal.name}` | {signal.unit} | {parts} |"


def definition_row(signal: Signal) -> str:
    """Return a row of a table of results."""
    return f"| `{signal.name}` | {signal.unit} | {cell(signal.definition)} |"


def floors() -> str:
    """Return the contract of imports as a picture: a row for each layer, what each is for."""
    contract = tomllib.loads((HERE.parent / "pyproject.toml").read_text(encoding="utf-8"))
    (layers,) = contract["tool"]["importlinter"]["contracts"]
    lines = ["| floor | for |", "|---|---|"]
    for row in layers["layers"]:
        names = [name.strip() for name in re.split(r"[|:]", row)]
        lines.append(f"| {' · '.join(f'`{name}`' for name in names)} | {floor_of(names)} |")
    return "\n".join(lines)


def floor_of(names: list[str]) -> str:
    """Return the first sentence of each module's docstring."""
    said = []
    for name in names:
        package = HERE.parent / "labcrane" / name / "__init__.py"
        path = package if package.exists() else package.parent.with_suffix(".py")
        text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        said.append(cell(text.split("\n\n")[0]))
    if len(names) == 1:
        return said[0]
    return "<br>".join(f"`{name}`: {text}" for name, text in zip(names, said, strict=True))


FLOORS = re.compile(r"(<!-- floors -->\n).*?(<!-- /floors -->)", re.DOTALL)


def with_floors(page: str) -> str:
    """Return the page of the architecture with the picture of today."""
    return FLOORS.sub(lambda match: f"{match[1]}{floors()}\n{match[2]}", page)


TOPICS = (
    "clocks", "record", "processes", "streams", "feedback", "pages", "computer", "protocol",
    "people", "analysis", "simulation", "machines", "tests", "plugins",
)  # fmt: skip


def decisions_page() -> str:
    """Return the list of decisions by topic, with the numbers that each page includes."""
    found: dict[str, list[str]] = {topic: [] for topic in TOPICS}
    for path in sorted((HERE / "decisions").glob("[0-9]*.md")):
        head = path.read_text(encoding="utf-8").splitlines()[:5]
        title = head[0].removeprefix("# ")
        marks = dict(line.split(": ", 1) for line in head[1:] if ": " in line)
        also = f" (also {marks['Includes']})" if "Includes" in marks else ""
        found[marks["Topic"]].append(f"- [{title}]({path.name}){also}")
    lines = [
        "# Decisions",
        "",
        "For everyone who changes labcrane, or asks why it is as it is. Each page states what was "
        "decided, why, and what was rejected.",
        "A number that the code cites is that of a page, or one of those in brackets.",
    ]
    for topic, links in found.items():
        lines += ["", f"## {topic.capitalize()}", "", *links]
    return "\n".join([*lines, ""])


MENTION = re.compile(r"`docs/([\w/-]+)\.md`")


def on_files(files: Any, config: Any) -> Any:
    """Add the generated pages to those of the site; called by mkdocs."""
    from mkdocs.structure.files import File  # noqa: PLC0415 - a hook of mkdocs, and nothing else

    for path, text in pages().items():
        if (stand_in := files.get_file_from_path(path)) is not None:
            files.remove(stand_in)
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Turn the names of pages into links; called by mkdocs."""
    up = "../" * page.file.src_uri.count("/")
    return MENTION.sub(lambda match: f"[{match[1]}]({up}{match[1]}.md)", markdown)


def main() -> None:
    """Write the generated pages into a folder, or the floors into the page of the architecture."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("folder", type=Path, nargs="?", help="where the pages go, as docs")
    parser.add_argument("--architecture", action="store_true", help="the floors alone")
    asked = parser.parse_args()
    if asked.architecture:
        page = HERE / "architecture.md"
        page.write_text(with_floors(page.read_text(encoding="utf-8")), encoding="utf-8")
    elif asked.folder is None:
        parser.error("give the folder in which the pages are written, as docs")
    else:
        for name, text in pages().items():
            target = asked.folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
