"""Arguments and options that several commands take."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labcrane.errors import ProtocolError
from labcrane.files.study_folder import DATA, data_of, protocol_of

if TYPE_CHECKING:
    from labcrane.protocol.study import Study

AsJson = Annotated[bool, typer.Option("--json", help="print JSON, for scripts")]
STUDY = "the study: its folder, its protocol or its data folder"


def protocol_in(path: Path | None) -> Path | None:
    """Return a study's file where a study was given."""
    return None if path is None else protocol_of(path)


def data_in(path: Path | None) -> Path | None:
    """Return a study's data folder where a study was given."""
    return None if path is None else data_of(path)


def study_of(protocol: Path) -> "Study":
    """Return the study of a protocol, with the plugins that are there for it."""
    from labcrane.protocol.study import load
    from labcrane.registry.registry import discover

    return load(protocol, discover(study=protocol))


def data_here() -> Path:
    """Return the data folder of the study whose folder this is; this one where it is the data."""
    return data_of(Path())


def one_study(data: Path | None, study: Path | None = None) -> Path:
    """Return the data folder of a study that is ``--data`` or an argument, or is here.

    Raises
    ------
    ProtocolError
        Both were given.
    """
    if study is not None and data is not None:
        raise ProtocolError(
            f"the study was given twice, as {study} and as --data {data}; give it once"
        )
    return study or data or data_here()


ProtocolHere = Annotated[
    Path,
    typer.Argument(
        metavar="PROTOCOL",
        help=STUDY,
        callback=protocol_in,
        default_factory=Path,
        show_default="here",
    ),
]
StudyData = Annotated[
    Path,
    typer.Argument(
        metavar="STUDY",
        help=STUDY,
        callback=data_in,
        default_factory=data_here,
        show_default="here",
    ),
]
StudyFirst = Annotated[
    list[Path],
    # Of several arguments click gives those that must be there the last words, and this the rest.
    typer.Argument(metavar="STUDY", help=STUDY, default_factory=list, show_default="here"),
]
StudyOrHere = Annotated[
    Path | None,
    typer.Argument(metavar="STUDY", help=STUDY, callback=data_in, show_default="here"),
]
DataOrHere = Annotated[
    Path | None,
    typer.Option("--data", help=STUDY, callback=data_in, show_default="here"),
]
DataBeside = Annotated[
    Path | None, typer.Option(help="data folder; by default data/ in the protocol's folder")
]


def data_folder(data: Path | None, protocol: Path | None) -> Path:
    """Return the given data folder, or the one in the protocol's folder, or data/ here."""
    return data or (protocol.parent if protocol else Path()) / DATA


def first_study(words: Sequence[Path]) -> Path | None:
    """Return the study that stands before the other arguments, if one does.

    Raises
    ------
    ProtocolError
        It is more than one word, or nothing of that name is there.
    """
    if not words:
        return None
    if len(words) > 1 or not words[0].exists():
        said = " ".join(map(str, words))
        raise ProtocolError(
            f"{said!r} stands where a study does, and there is none; give one study, by its "
            "folder, its protocol or its data folder, and words with blanks in quotes"
        )
    return words[0]


Local = Annotated[bool, typer.Option("--local", help="keep LSL streams on this computer")]


def stay_on_this_computer() -> None:
    """Keep LSL on loopback; before anything imports pylsl."""
    from labcrane.streams.network import use_loopback

    use_loopback()
