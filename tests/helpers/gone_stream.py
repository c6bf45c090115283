"""A stream that goes away between being found and being opened."""

import pylsl
import pytest


def goes_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the first stream that is opened be gone, as liblsl says it."""
    tries: list[float] = []

    class Inlet(pylsl.StreamInlet):
        def open_stream(self, timeout: float = pylsl.FOREVER) -> None:
            tries.append(timeout)
            if len(tries) == 1:
                raise pylsl.util.LostError("the stream has been lost.")
            super().open_stream(timeout)

    monkeypatch.setattr(pylsl, "StreamInlet", Inlet)
