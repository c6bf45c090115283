"""A new plugin: a folder that installs, passes its contract tests, and can be changed."""

import keyword
import re
from pathlib import Path

from labcrane.errors import PluginError, suggestion
from labcrane.files.atomic import SHARED_FILE, write_text
from labcrane.registry.commands import plugin_commands
from labcrane.registry.hookspecs import ROLES, RoleEntry, role_called
from labcrane.registry.registry import Registry

TEMPLATES = Path(__file__).parent / "templates"
ANY = "any"
"""The folder of what every plugin needs, beside one for each role."""

COMMAND = "command"
"""Another kind of plugin, which fills no role."""

PRESENTED = ("cue", "feedback")
"""Kinds that run in a process of views and sounds, which a simulated session starts if asked to."""

STANDS_IN = "# with --simulate; simulated_operator once a real device is read"
"""Why an input is its own operator at first: a simulated session reads no other input."""

GROUP = """
# And this one names the group of its commands, which `labcrane --help` lists.
[project.entry-points."labcrane.commands"]
my_part = "my_module"
"""


def kinds() -> dict[str, str]:
    """Return the kinds of plugins with their descriptions: every role, and commands."""
    roles = {entry.word: entry.about for entry in ROLES.values()}
    return {**roles, COMMAND: "a command of the command line"}


def write_plugin(role: str, name: str, into: Path, registry: Registry) -> Path:
    """Write the folder of a new plugin below ``into``; return its path.

    Raises
    ------
    PluginError
        There is no such role, the name cannot be used, or the folder exists.
    """
    kind = _kind(role)
    _check_name(kind, name, registry)
    folder = into / f"labcrane-{name.replace('_', '-')}"
    if folder.exists():
        raise PluginError(
            f"{folder} exists already, and nothing is overwritten; give another name, or another "
            "place with --into"
        )
    folder.mkdir(parents=True)
    for template, text in _templates(kind).items():
        path = folder / _filled(template, kind, name)
        write_text(path, _filled(text, kind, name), SHARED_FILE)
    return folder


def _kind(name: str) -> str:
    if name in {COMMAND, "commands"}:
        return COMMAND
    if role := role_called(name):
        return ROLES[role].word
    raise PluginError(f"there is no role {name!r}; {suggestion(name, kinds())}")


def _templates(kind: str) -> dict[str, str]:
    """Return the files of a new plugin, with what is to be filled in, by name."""
    role = role_called(kind)
    found = {
        path.name: path.read_text(encoding="utf-8")
        for folder in (ANY, kind)
        for path in sorted((TEMPLATES / folder).iterdir())
        if path.is_file()
    }
    if role is None:
        found["pyproject.toml"] += GROUP
    else:
        found["protocol.yaml"] = _using(ROLES[role], found["protocol.yaml"])
        if kind in PRESENTED:
            found["README.md"] = found["README.md"].replace("--simulate", "--simulate --feedback")
    return found


def _using(entry: RoleEntry, protocol: str) -> str:
    """Return the protocol with the plugin in it, in place of what it uses of its role."""
    if not entry.keys:
        return protocol
    key, own = entry.keys[0], "use: my_part"
    if entry.word == "capture":
        own += ", consent: we write lines"
    if entry.word == "estimate":
        own += ", stream: grip, fallback: {mean: 0}"
    written = re.search(rf"^{key}:.*\n(?:  .*\n)*", protocol, re.MULTILINE)
    if entry.several:
        named = re.search(r"^  (\w+):", written[0], re.MULTILINE) if written else None
        used = f"{key}:\n  {named[1] if named else 'my_part'}: {{{own}}}\n"
    else:
        used = f"{key}: {{use: my_part}}\n"
    if entry.word == "input":
        operator = f"operator: {{use: my_part}}  {STANDS_IN}"
        protocol = re.sub(r"^operator:.*$", operator, protocol, flags=re.MULTILINE)
    if entry.word == "estimate":
        used += "streams:\n  grip: {name: Grip, required: false}\n"
    if entry.word == "cue":  # which views draw
        used += "views:\n  window: {use: view}\n"
    protocol = protocol.replace(written[0] if written else "sessions:\n", used, 1) + (
        f"      - {entry.step}: my_part\n" if entry.step else ""
    )
    return protocol if written else protocol.replace(used, f"{used}sessions:\n", 1)


def _check_name(kind: str, name: str, registry: Registry) -> None:
    if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name) or keyword.iskeyword(name):
        raise PluginError(
            f"{name!r} cannot name a plugin; give a lower-case word of letters, digits and single "
            "underscores, such as my_arrow"
        )
    if kind == COMMAND and not name.isalpha():
        raise PluginError(f"{name!r} cannot name a command; give one word of letters")
    for offers in registry.plugins.values():
        if name in offers:
            raise PluginError(
                f"plugin {offers[name]!r} offers {name!r} already; choose another name"
            )
    if kind == COMMAND and name in {group for group, _ in plugin_commands()}:
        raise PluginError(f"there are commands {name!r} already; choose another name")


def _filled(text: str, kind: str, name: str) -> str:
    camel = "".join(word.capitalize() for word in name.split("_"))
    for placeholder, word in (
        ("my_module", f"labcrane_{name}"),
        ("my_part", name),
        ("my-project", f"labcrane-{name.replace('_', '-')}"),
        ("MyPart", camel),
        ("a_role", kinds()[kind]),
    ):
        text = text.replace(placeholder, word)
    return text
