"""XML of a robot's description, checked before a robot is built from it.

URDF and MJCF come from elsewhere: a few of their lines may expand to millions of bodies, and name
files anywhere on the disk.
"""

import io
import math
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from labcrane.errors import ProtocolError
from labcrane.files.names import outside
from labcrane.limits import LIMITS, LimitError, check_size
from labcrane.machines.descriptions.chain import ChainError

MOST_ELEMENTS = 20_000
"""Elements of a description with all that it includes, each as often as it is repeated."""

MOST_FILES = 50
"""Files that a description includes."""

MOST_VALUES = 10_000_000
"""Heights or colours that one element asks for."""

FOLDERS = {"mesh": "meshdir", "skin": "meshdir", "hfield": "assetdir", "texture": "texturedir"}
"""Which key of ``compiler`` says where the files of a kind of element lie."""


def check_robot(path: Path, folder: Path) -> ElementTree.Element:
    """Return the root of a description, if it can be built here.

    Parameters
    ----------
    folder
        The study's: whatever the description names has to lie in it.

    Raises
    ------
    ChainError
        It is not XML, too large once its repetitions are expanded, or refers to a file elsewhere.
    """
    return _Look(path, folder).root


class _Look:
    def __init__(self, path: Path, folder: Path) -> None:
        self._main, self._folder = path, folder
        self._elements = 0.0
        self._files: set[Path] = set()
        self._places: dict[str, str] = {}
        self._roots: list[ElementTree.Element] = []
        self.root = self._read(path, 1.0)
        for root in self._roots:
            for kind, name in _named(root):
                self._check_inside(self._place(kind, name), name)

    def _read(self, path: Path, times: float) -> ElementTree.Element:
        """Read one file, and those that it includes."""
        if path.resolve() in self._files:
            raise ChainError(f"it includes {path.name} twice, or itself")
        self._files.add(path.resolve())
        if len(self._files) > MOST_FILES:
            raise ChainError(f"it includes more than {MOST_FILES} files; put them into one")
        root = _parsed(path)
        self._roots.append(root)
        self._walk(root, times)
        return root

    def _walk(self, root: ElementTree.Element, times: float) -> None:
        """Count elements, each as often as it is repeated, without recursion."""
        waiting = [(root, times)]
        while waiting:
            element, often = waiting.pop()
            self._elements += often
            if self._elements > MOST_ELEMENTS:
                raise ChainError(
                    f"it has more than {MOST_ELEMENTS} elements, with what it repeats; leave out "
                    "what does not move"
                )
            _check_values(element)
            if element.tag == "compiler":
                self._places |= dict(element.attrib)
            if element.tag == "include":
                name = element.get("file", "")
                included = self._main.parent / name
                self._check_inside(included, name)
                self._read(included, often)
            if element.tag in REPEATED:
                often *= _product(element.get("count"))
                waiting.append((ElementTree.Element("one"), often))  # what it makes by itself
            waiting += [(each, often) for each in element]

    def _place(self, kind: str, name: str) -> Path:
        places = self._places
        within = places.get(FOLDERS.get(kind, ""), "") or places.get("assetdir", "")
        return self._main.parent / within / name

    def _check_inside(self, path: Path, name: str) -> None:
        if "://" in name:
            return  # a package's, which only those resolve who know the packages
        if why := outside(path, self._folder):
            raise ChainError(f"it names {name!r}, and {why}")


REPEATED = ("replicate", "composite", "flexcomp")
"""Elements of MJCF that expand to many."""

FILES = ("file", "content_type_file", *(f"file{side}" for side in ("right", "left", "up", "down")))
"""Attributes of MJCF that name a file."""


def _named(root: ElementTree.Element) -> Iterator[tuple[str, str]]:
    for element in root.iter():
        for key in FILES:
            if element.tag != "include" and (name := element.get(key)) is not None:
                yield element.tag, name


def _parsed(path: Path) -> ElementTree.Element:
    """Return the root of one file: small, flat, and without a document type and its entities."""
    root: ElementTree.Element | None = None
    depth = count = 0
    try:
        check_size(path.stat().st_size, "robot description", f"{path.name}")
        content = path.read_bytes()
        if b"<!DOCTYPE" in content or b"<!ENTITY" in content or b"\x00" in content:
            raise ChainError("it has a document type, or is not UTF-8; remove <!DOCTYPE ...>")
        # A file with a document type, and so with entities, never comes this far.
        parsed = ElementTree.iterparse(io.BytesIO(content), ("start", "end"))  # noqa: S314
        for event, element in parsed:
            root = element if root is None else root
            depth += 1 if event == "start" else -1
            count += event == "start"
            if depth > LIMITS["robot description"].depth or count > MOST_ELEMENTS:
                raise ChainError(
                    f"it is nested deeper than {LIMITS['robot description'].depth} elements, or "
                    f"has more than {MOST_ELEMENTS}; leave out what does not move"
                )
    except LimitError as error:
        raise ChainError(str(error)) from error
    except (ElementTree.ParseError, OSError, ValueError, ProtocolError) as error:
        raise ChainError(f"it cannot be read: {error}") from error
    if root is None:
        raise ChainError("it cannot be read: there is no element in it")
    return root


def _check_values(element: ElementTree.Element) -> None:
    for names in (("nrow", "ncol"), ("width", "height")):
        asked = math.prod(_product(element.get(name)) for name in names)
        if asked > MOST_VALUES:
            raise ChainError(
                f"<{element.tag}> asks for {asked:.3g} values by {names[0]} and {names[1]}; the "
                f"maximum is {MOST_VALUES}"
            )


def _product(text: str | None) -> float:
    """Return the product of the numbers in an attribute; 1 where it has none."""
    try:
        return max(1.0, math.prod(abs(float(each)) for each in (text or "1").split()))
    except ValueError:
        return 1.0  # which its reader says
