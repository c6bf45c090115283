"""Cleaner of texts for a problem report: only words that labcrane's own source uses stay.

Everything else is replaced by its kind: a quoted value, a path, an address, a pseudonym, a word.
Numbers stay, but for those that may be pseudonyms.
"""

import builtins
import errno
import getpass
import os
import platform
import re
import socket
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from labcrane.participants.mentions import LETTER, spellings
from labcrane.registry.entry_points import entry_points_of
from labcrane.registry.hookspecs import PROJECT

_UNITS = frozenset(
    [
        "ns", "µs", "us", "ms", "s", "min", "h", "Hz", "kHz", "MHz", "kB", "MB", "GB", "TB",
        "KiB", "MiB", "GiB", "B", "bytes", "mm", "cm", "m", "rad", "deg", "N", "V", "mV", "uV",
        "µV", "°", "%", "px", "fps", "dB", "K", "bit",
    ]
)  # fmt: skip
_SYSTEMS = frozenset(
    [
        "Linux", "Windows", "Darwin", "macOS", "Debian", "Ubuntu", "Fedora", "GNU", "GCC",
        "Clang", "MSC", "Release", "Debug", "SHARED", "LTS", "CPython", "PyPy", "generic",
        "cloud", "amd64", "x86_64", "aarch64", "arm64", "AMD64", "bookworm", "trixie", "noble",
        "jammy", "refs", "with", "Python", "Traceback", "EEG", "ECG", "EMG", "Gaze", "Markers",
        "MoCap", "Audio", "Video", "WARN", "PASS", "FAIL", "ppm", "h5py", "panda3d", "LSLAPICFG",
        "p50", "p99", "SIMULATED", "PILOT",
    ]
)  # fmt: skip
"""Words of versions, systems and kinds of streams, which no source of labcrane needs to use."""

_UNREAD = frozenset(["translations.py"])
"""Modules whose words are not those of messages: other languages, and people's names in them."""

_WORD = re.compile(r"\w+")
_CAPITAL = re.compile(r"(\w+)[^\w\n]{1,3}(?=(\w+))")

_SUFFIXES = "h5|xdf|json|jsonl|ya?ml|py|csv|txt|zip|cfg|parquet|npz|html"
_QUOTED = (
    r"(?<!\w)'.*?'(?!\w)|(?<!\w)\"[^\"\n]*\"|`[^`\n]*`"
    r"|[\u2018\u201a\u201c\u201e\u00ab].*?[\u2018\u2019\u201c\u201d\u00bb]"
)
_URL = r"\b[A-Za-z][A-Za-z0-9+.-]*://[^\s\"'<>]+"
_MAIL = r"[^\s@]{1,64}@[^\s@]+\.\w\w\S*"
_PART = r"[^/\\\n\"'<>|:;,()\[\]{}]+"  # a folder may have spaces, where a slash follows
_LAST = r"[^\s/\\\"'<>|:;,()\[\]{}]*"
_DEVICE = r"/dev/(?:tty[A-Z]{2,4}\d+|tty\d+|parport\d+|snd|null|shm)(?![\w/])"
_PATH = (
    r"(?<![\w.)\]°/\\…])(?:~[\w.-]*|[A-Za-z]:|\\(?=\\))?[/\\]+(?=[^\s/\\])"
    rf"(?:{_PART}[/\\]+)*{_LAST}"
)
_ADDRESS = (
    r"(?<![\w.-])\d{1,3}(?:\.\d{1,3}){3}(?![\w-]|\.\d)"  # Linux-5.15.167.4-generic has none
    r"|\b(?:[0-9a-fA-F]{2}-){5}[0-9a-fA-F]{2}\b"
    r"|(?<![\w:])(?:[0-9a-fA-F]{1,4}:){3,}[0-9a-fA-F:]*"
    r"|(?<![\w:])(?:[0-9a-fA-F]{1,4})?::[0-9a-fA-F][0-9a-fA-F:]*"
)
_MOMENT = (
    r"(?<![\w.-])\d{4}-\d\d-\d\d"
    r"(?:[T ]\d\d:\d\d(?::\d\d(?:\.\d+)?)?(?:Z|[+-]\d\d:?\d\d)?)?(?![\w-])"
    r"|(?<![\w:])\d{1,2}:\d\d(?::\d\d(?:\.\d+)?)?(?![\w:])"
)
_UNIT = "|".join(map(re.escape, sorted(_UNITS, key=len, reverse=True)))
_NUMBER = rf"(?<!\w)\d+(?:[.,]\d+)*(?:e[+-]?\d+)?(?P<unit>\s?(?:{_UNIT})(?!\w))?(?!\w)"
_VERSION = r"(?<![A-Za-z0-9])v?\d+(?:\.\w+)+(?!\w)|\b[0-9a-f]{7,40}\b|\bglibc\d[\d.]*"
_FRAME = re.compile(r'^  File "(?P<path>.+)", line (?P<line>\d+), in (?P<name>.+)$')


_SITES = re.compile(f"(?:{_URL})|(?:{_MAIL})|(?P<device>{_DEVICE})|(?P<path>{_PATH})")


def _kinds(*, versions: bool) -> re.Pattern[str]:
    """Return what finds each part of a text that is judged, by its kind."""
    kinds = {
        "url": _URL,
        "mail": _MAIL,
        "quoted": _QUOTED,
        "device": _DEVICE,
        "path": _PATH,
        "address": _ADDRESS,
        "moment": _MOMENT,
        **({"version": _VERSION} if versions else {}),
        "number": _NUMBER,
        "word": r"\w+",
    }
    return re.compile("|".join(f"(?P<{kind}>{found})" for kind, found in kinds.items()))


_KINDS = (
    "url", "mail", "quoted", "device", "path", "address", "moment", "version", "number", "word",
)  # fmt: skip
_TEXTS, _VERSIONS = _kinds(versions=False), _kinds(versions=True)


class Cleaner:
    """Replaces in texts what could lead to people or to their computers.

    A word stays if labcrane's source uses it; one with a capital only beside the same neighbour,
    since names are words too. Each other word becomes ``word-1`` and so on, the same one each time.

    Parameters
    ----------
    people
        Pseudonyms; each becomes ``participant-1`` and so on, in the order of their names.
    computers
        Names of computers beside this one's.
    folders
        Folders whose names are replaced wherever they are: of the study and of the data.
    patterns
        Regular expressions of pseudonyms; every text that fits one is replaced.
    """

    def __init__(
        self,
        people: Iterable[str],
        computers: Iterable[str],
        folders: Iterable[Path],
        patterns: Iterable[str] = (),
    ) -> None:
        known = [*folders, Path.home(), Path.cwd()]
        places = {str(each) for folder in known for each in (folder.absolute(), folder.resolve())}
        names = dict.fromkeys(_parts(places), "folder")
        names |= dict.fromkeys(_of_hosts(computers), "computer") | dict.fromkeys(_users(), "user")
        # Folders and users with a common name, such as data or home, lead to nobody.
        self._names = {
            name.lower(): word
            for name, word in names.items()
            if re.search(r"[^\W\d_]", name) and name.lower() not in _ORDINARY
        }
        self._people = {
            spelled.lower(): f"participant-{number}"
            for number, person in enumerate(sorted(set(people)), start=1)
            for spelled in spellings(person)
            if spelled
        }
        self._places = _any_of(
            (each for each in places if len(Path(each).parts) > 1), end=r"(?![\w.-])"
        )
        self._called = _any_of(filter(_lettered, [*self._people, *self._names]), whole=True)
        self._patterns = [found for each in patterns if (found := _compiled(each)) is not None]
        self._within = [_inside(each.pattern) for each in self._patterns]
        self._known = _vocabulary()
        self._replaced: dict[tuple[str, str], str] = {}

    def text(self, text: str, *, versions: bool = False) -> str:
        """Return a text without people, users, computers, folders, addresses and unknown words.

        With ``versions``, what looks like a version or the sum of a commit stays too.
        """
        if text in {"", "…"}:
            return text
        spans = sorted(self._spans(text, versions=versions))
        parts, at = list[str](), 0
        for start, stop, word in spans:
            if start >= at:
                parts += [*self._cleaned(text, at, start, versions=versions), word]
                at = stop
        return "".join([*parts, *self._cleaned(text, at, len(text), versions=versions)])

    def name(self, text: str, kind: str = "word") -> str:
        """Return what replaces a name that a person chose, the same one each time."""
        if text.lower() in self._people:
            return self._people[text.lower()]
        numbered = sum(1 for of, _ in self._replaced if of == kind)
        return self._replaced.setdefault((kind, text.lower()), f"{kind}-{numbered + 1}")

    def data(self, value: Any) -> Any:
        """Return plain data with every text in it cleaned; names of fields too."""
        if isinstance(value, str):
            return self.text(value)
        if isinstance(value, Mapping):
            return {self.text(str(key)): self.data(each) for key, each in value.items()}
        if isinstance(value, list | tuple):
            return [self.data(each) for each in value]
        return value

    def traceback(self, text: str) -> str:
        """Return a traceback's frames without lines of source, and its error cleaned."""
        kept = []
        for line in text.splitlines():
            if (frame := _FRAME.match(line)) is not None:
                inside, place = _installed(frame["path"])
                called = frame["name"] if inside else self.text(frame["name"])
                kept.append(f"  {place}, line {frame['line']}, in {called}")
            elif not line.startswith("    "):
                kept.append(self.text(line))
        return "\n".join(kept)

    def _spans(self, text: str, *, versions: bool) -> Iterator[tuple[int, int, str]]:
        """Yield where people and names of the computer are, and what replaces each."""
        for found in self._places.finditer(text):
            rest = re.match(r"[/\\][^\s\"'<>|:;,()\[\]{}]*", text[found.end() :])
            whole = found[0] + (rest[0] if rest else "")
            yield found.start(), found.start() + len(whole), self._place(whole)
        for found in _SITES.finditer(text):
            place = self._place(found[0]) if found["path"] else "(an address)"
            yield *found.span(), found["device"] or place
        for found in self._called.finditer(text):
            word = found[0].lower()
            yield *found.span(), self._people.get(word) or self._names[word]
        for pattern in self._within if not versions else ():
            for found in pattern.finditer(text):
                if _lettered(found[0]):
                    yield *found.span(), self.name(found[0], "pseudonym")

    def _cleaned(self, text: str, at: int, stop: int, *, versions: bool) -> Iterator[str]:
        """Yield a text from one place to another, with known words and numbers alone."""
        before = ""
        for found in (_VERSIONS if versions else _TEXTS).finditer(text, at, stop):
            yield text[at : found.start()]
            at = found.end()
            kind = next(name for name in _KINDS if found.groupdict().get(name) is not None)
            after = _WORD.search(text, at, stop)
            yield self._judged(found, kind, (before, after[0] if after else ""), versions=versions)
            before = found[0] if kind == "word" else ""
        yield text[at:stop]

    def _judged(
        self, found: re.Match[str], kind: str, beside: tuple[str, str], *, versions: bool
    ) -> str:
        """Return what is left of a part of a text."""
        word = found[0]
        if kind == "word":
            return word if self._is_known(word, *beside) else self.name(word)
        if kind == "number":
            return "(a number)" if self._may_be_person(found, versions=versions) else word
        if kind in {"device", "moment", "version"}:
            return word
        if kind == "path":
            return self._place(word)
        return self._quoted(word) if kind == "quoted" else "(an address)"

    def _is_known(self, word: str, before: str, after: str) -> bool:
        words, pairs = self._known
        if word in words:
            return True
        return (before, word) in pairs or (word, after) in pairs

    def _may_be_person(self, found: re.Match[str], *, versions: bool) -> bool:
        """Whether a number without a unit, a decimal or a date may be a pseudonym."""
        word = found[0]
        if versions or found["unit"] or not word.isdigit():
            return False
        around = found.string[: found.start()][-5:] + "|" + found.string[found.end() :][:1]
        if around.startswith(("line ",)) or re.search(r"[.:]\|", around):
            return False
        return word in self._people or any(each.fullmatch(word) for each in self._patterns)

    def _quoted(self, text: str) -> str:
        inside = text[1:-1]
        if inside.lower() in self._people:
            return self._people[inside.lower()]
        if "_" in inside and inside in self._known[0]:  # a key or a name of the program
            return text
        if re.match(rf"(?:{_PATH})\Z", inside):
            return self._place(inside)
        with suppress(ValueError):
            float(inside)
            return "(a number)"
        return "(a text)"

    def _place(self, path: str) -> str:
        """Return a path as its place in an installation, or else as the kind of its file."""
        inside, place = _installed(path)
        if inside:
            return place
        kind = re.search(rf"\.(?:{_SUFFIXES})\Z", path.rstrip("./\\"), re.IGNORECASE)
        return f"(a path){kind[0].lower() if kind else ''}"


_ORDINARY = frozenset(
    [
        "data", "desktop", "documents", "home", "lab", "labcrane", "media", "mnt", "opt", "private",
        "protocols", "studies", "study", "tmp", "users", "usr", "var", "work",
    ]
)  # fmt: skip
"""Names of folders, users and computers that identify no person."""


@cache
def _vocabulary() -> tuple[frozenset[str], frozenset[tuple[str, str]]]:
    """Return words of labcrane's source, and pairs of words of which one has a capital."""
    words, pairs = {*_UNITS, *_SYSTEMS}, set[tuple[str, str]]()
    words |= {name for name, each in vars(builtins).items() if isinstance(each, type)}
    sources = [*Path(__file__).parents[1].rglob("*.py")]
    for name in {each.value.partition(":")[0] for each in entry_points_of(PROJECT) if _ours(each)}:
        spec = find_spec(name)
        for folder in (spec.submodule_search_locations or ()) if spec else ():
            sources += Path(folder).rglob("*.py")
    texts = [path.read_text(encoding="utf-8") for path in sources if path.name not in _UNREAD]
    for text in [*texts, *map(os.strerror, errno.errorcode)]:
        for word in set(_WORD.findall(text)):
            plain = word == word.lower() and not re.search(r"\d", word)
            camel = re.fullmatch(r"(?:[A-Z][a-z]+){2,}|[A-Z]+(?:_[A-Z]+)+", word)
            if plain or camel:
                words.add(word)
        pairs |= {
            (found[1], found[2])
            for found in _CAPITAL.finditer(text)
            if any(word[:1].isupper() and word.isalpha() for word in found.groups())
        }
    return frozenset(words), frozenset(pairs)


def _ours(point: Any) -> bool:
    return point.dist is not None and point.dist.name == PROJECT


def _compiled(pattern: str) -> re.Pattern[str] | None:
    with suppress(re.error):
        return re.compile(pattern, re.IGNORECASE)
    return None


def _inside(pattern: str) -> re.Pattern[str]:
    """Return what finds a pseudonym within a text, from a pattern of the whole one."""
    plain = re.sub(r"\\[AZ]|(?<!\\)(?<!\[)\^|(?<!\\)\$", "", pattern)
    return _compiled(rf"(?<!{LETTER})(?:{plain})(?!{LETTER})") or re.compile(r"(?!)")


def _lettered(text: str) -> bool:
    return bool(re.search(r"[^\W\d_]", text))


def _any_of(words: Iterable[str], *, whole: bool = False, end: str = "") -> re.Pattern[str]:
    """Return what finds any of some words, the longest first."""
    listed = "|".join(re.escape(word) for word in sorted(words, key=len, reverse=True))
    if not listed:
        return re.compile(r"(?!)")
    found = rf"(?<!{LETTER})(?:{listed})(?!{LETTER})" if whole else f"(?:{listed}){end}"
    return re.compile(found, re.IGNORECASE)


def _installed(path: str) -> tuple[bool, str]:
    """Return whether a file is one of an installed package or of Python, and its place there."""
    package = Path(__file__).parents[1]
    for root in (package, package.parent / "plugins", Path(os.__file__).parent):
        with suppress(ValueError):
            inside = Path(path).relative_to(root)
            if inside.parts and ".." not in inside.parts and "site-packages" not in inside.parts:
                return True, f"…/{root.name}/{inside.as_posix()}"
    for root in (Path(each) for each in sys.path if each.endswith("site-packages")):
        with suppress(ValueError):
            inside = Path(path).relative_to(root)
            if inside.parts and inside.parts[0].partition(".")[0] in _libraries():
                return True, f"…/{inside.as_posix()}"
    return False, "(a path)" + (".py" if path.endswith(".py") else "")


@cache
def _libraries() -> frozenset[str]:
    """Return the packages that labcrane needs and whose paths lead to nobody."""
    return frozenset(
        ["labcrane", "numpy", "scipy", "pandas", "h5py", "pydantic", "pylsl", "mujoco", "panda3d",
         "direct", "pygame", "pyo", "can", "nicegui", "typer", "click", "ruamel", "pluggy", "loky"]
    )  # fmt: skip


def _parts(places: Iterable[str]) -> list[str]:
    """Return the names of folders, and of those that they are in."""
    return [part for place in places for part in Path(place).parts[1:]]


def _users() -> Iterator[str]:
    yield from (os.environ.get(name, "") for name in ("USER", "USERNAME", "LOGNAME"))
    yield Path.home().name
    with suppress(OSError, KeyError, ImportError):  # a process without an account
        yield getpass.getuser()


def _of_hosts(others: Iterable[str]) -> Iterator[str]:
    """Yield names of computers, each also without its domain."""
    for name in (
        platform.node(),
        socket.gethostname(),
        os.environ.get("COMPUTERNAME", ""),
        *others,
    ):
        yield name
        yield name.partition(".")[0]
