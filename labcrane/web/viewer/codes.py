"""Codes of a behaviour-coding scheme: keys that annotate what is seen while a recording plays."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from labcrane.core.settings import Settings
from labcrane.errors import ProtocolError
from labcrane.files.yaml import parse_yaml

TAKEN = " .,mnb"
"""Keys of the viewer itself."""


class Code(Settings):
    """What a key annotates."""

    name: str = Field(min_length=1)
    """What is written."""

    lasts: bool = False
    """Whether it has a beginning and an end, each a press of the key; else it is a moment."""


@dataclass(frozen=True, slots=True)
class Opening:
    """How the viewer opens: at which second, for which coder, with which codes."""

    at: float = 0.0
    coder: str = ""
    codes: Sequence[dict[str, Any]] = ()


def read_codes(path: Path) -> list[dict[str, Any]]:
    """Return the codes of a scheme, ready for JSON: key, name, and whether it lasts.

    A scheme is a mapping of keys: ``g: {name: looks away, lasts: true}``.

    Raises
    ------
    ProtocolError
        It is not one, or a key is taken.
    """
    try:
        key = Annotated[str, Field(min_length=1, max_length=1)]
        found = TypeAdapter(dict[key, Code]).validate_python(
            parse_yaml(path.read_text(encoding="utf-8"), str(path))
        )
    except (OSError, UnicodeDecodeError, ValidationError) as error:
        raise ProtocolError(
            f"{path} is not a scheme of codes: {error}; write one key a line, as "
            "g: {name: looks away, lasts: true}"
        ) from error
    if taken := [key for key in found if key in TAKEN]:
        raise ProtocolError(
            f"{path}: the viewer has keys {', '.join(map(repr, TAKEN))} itself; choose another "
            f"for {found[taken[0]].name!r}"
        )
    return [{"key": key, **code.model_dump()} for key, code in found.items()]
