"""Marks that are made on the viewer's page, and go to the record's annotations."""

from collections.abc import Mapping
from typing import Any

from labcrane.errors import LabcraneError
from labcrane.recording.annotations import annotate, read_annotations, withdraw
from labcrane.web.viewer.film import Film


class Marks:
    """The marks of one film, in seconds from its start, and what a page requests.

    What is asked and cannot be done is said on the page; nothing that was recorded is touched.
    """

    def __init__(self, film: Film) -> None:
        self._place = film.place
        self._start = film.start

    def shown(self, said: str = "") -> dict[str, Any]:
        """Return every valid mark and the message about them, ready for JSON."""
        if self._place is None:
            return {"marks": [], "markSaid": "", "marking": False}
        file, session = self._place
        try:
            found = read_annotations(file.absolute().parent, session)
        except LabcraneError as error:
            return {"marks": [], "markSaid": str(error), "marking": True}
        marks = [
            {"t": round(mark.time - self._start, 4), "to": round(mark.until - self._start, 4),
             "text": mark.text, "written": mark.written, "number": mark.number,
             "coder": mark.coder}
            for mark in found
        ]  # fmt: skip
        return {"marks": marks, "markSaid": said, "marking": True}

    def asked(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """Make a mark, or take one back; return what is shown then."""
        if self._place is None:
            return self.shown()
        file, session = self._place
        try:
            if "text" not in asked:
                withdraw(file, session, int(asked["withdraw"]))
                return self.shown("withdrawn; the file keeps the original")
            begin, end = (self._start + float(asked[name]) for name in ("t", "to"))
            text, coder = str(asked["text"]), str(asked.get("coder", ""))
            made = annotate(file, session, begin, text, end, coder)
            if "withdraw" in asked:  # what has ended replaces what began
                withdraw(file, session, int(asked["withdraw"]))
        except (LabcraneError, LookupError, TypeError, ValueError) as error:
            return self.shown(f"not kept: {error}")
        return self.shown("kept") | {"made": made.number}
