"""Log of a bus, as candump and Vector's loggers write it, or a person who edited it."""

import io
import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane import ProtocolError

if TYPE_CHECKING:
    import can

SCREEN = re.compile(
    r"\s*\((?P<at>[\d.]+)\)\s+(?P<bus>\w+)\s+(?P<id>[0-9A-F]+)\s+\[\d+\](?P<data>.*)"
)
"""A line of ``candump -ta`` as it is shown, not as ``candump -l`` writes it."""

COMMENT = ("#", ";", "//")
FRAME = re.compile(r"\s*\d+\.\d+\s")
HEADER = "base {} timestamps {}\nno internal events logged\n"


def read_log(path: Path, bus: str | None) -> tuple[list["can.Message"], bool, int]:
    """Return the frames of a bus, whether each is timed from the one before it, and torn lines.

    A last line without a line end may have lost a part of its data, so it is left out.

    Raises
    ------
    ProtocolError
        The file is not a log, or has the frames of several buses and ``bus`` names none of them.
    """
    import can  # noqa: PLC0415 - loads for a moment
    from can.io.asc import ASCReader  # noqa: PLC0415
    from can.io.canutils import CanutilsLogReader  # noqa: PLC0415

    relative, torn = False, 0
    try:
        if path.suffix.lower() in {".log", ".asc"}:
            text = _text(path)
            lines = [line for line in text.split("\n") if not line.lstrip().startswith(COMMENT)]
            torn = int(bool(lines[-1:] and lines.pop().strip()))  # behind the last line end
            if path.suffix.lower() == ".log":
                found = list(CanutilsLogReader(io.StringIO("".join(map(_as_logged, lines)))))
            else:
                relative = any("timestamps relative" in line for line in lines)
                found = list(ASCReader(io.StringIO(_as_vector(lines, relative=relative))))
        else:
            with can.LogReader(path) as reader:
                found = list(reader)
    # Of damaged files python-can's readers let through also struct's and zlib's errors.
    except Exception as error:
        raise ProtocolError(
            f"{path} cannot be read as a candump, asc or blf log: {error}"
        ) from error
    buses = list(dict.fromkeys(_bus(frame) for frame in found))
    if (bus is None and len(buses) > 1) or (found and bus not in {None, *buses}):
        raise ProtocolError(
            f"{path} holds frames of the buses {', '.join(buses)}; name the panel's, as in "
            f"bus: {buses[0]}"
        )
    return [frame for frame in found if bus in {None, _bus(frame)}], relative, torn


def _text(path: Path) -> str:
    raw = path.read_bytes()
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("cp1252")  # month names of Vector's loggers in Germany
    return text.replace("\r\n", "\n")


def _bus(frame: "can.Message") -> str:
    """Return a bus as logs call it: Vector's are numbers from 1, and python-can's from 0."""
    channel = frame.channel
    return str(channel + 1) if isinstance(channel, int) else str(channel)


def _as_logged(line: str) -> str:
    shown = SCREEN.fullmatch(line.rstrip())
    if shown is None:
        return f"{line}\n" if line.strip() else ""
    data = re.sub(r"\s*'.*", "", shown["data"]).replace(" ", "")
    return f"({shown['at']}) {shown['bus']} {shown['id']}#{data}\n"


def _as_vector(lines: Iterable[str], *, relative: bool) -> str:
    """Return a log with a header as python-can reads it: without one it loses the first frame."""
    lines = list(lines)
    base = "dec" if any(re.match(r"base\s+dec", line, re.IGNORECASE) for line in lines) else "hex"
    body = "".join(f"{line}\n" for line in lines if FRAME.match(line))
    return HEADER.format(base, "relative" if relative else "absolute") + body
