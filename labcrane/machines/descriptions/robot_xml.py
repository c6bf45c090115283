"""XML of a robot's description, checked before a robot is built from it.

URDF comes from elsewhere: a few of its lines may expand to millions of elements.
"""

import io
from pathlib import Path
from xml.etree import ElementTree

from labcrane.errors import ProtocolError
from labcrane.limits import LIMITS, LimitError, check_size
from labcrane.machines.descriptions.chain import ChainError

MOST_ELEMENTS = 20_000


def read_robot(path: Path) -> ElementTree.Element:
    """Return the root of a file: small, flat, and without a document type and its entities.

    Raises
    ------
    ChainError
        It is not XML, or too large.
    """
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
