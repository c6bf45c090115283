"""Keeps a recorder process running for as long as a recording lasts."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from labcrane.streams.request import StreamRequest

PATIENCE_S = 15.0
"""How long a recorder may take to close its journal when it is told to stop."""


class RecorderKeeper:
    """Starts the recorder, starts it again when it dies, and knows what it last said.

    Attributes
    ----------
    status
        The last line of the recorder's own report; empty before it has spoken.
    restarts
        How often it had to be started again.
    """

    def __init__(self, journal: Path, requests: Sequence[StreamRequest]) -> None:
        self.status: dict[str, Any] = {}
        self.restarts = 0
        self._orders = json.dumps(
            {"journal": str(journal), "streams": [asdict(request) for request in requests]}
        )
        self._process = self._start()

    @property
    def pid(self) -> int:
        """The recorder's process id."""
        return self._process.pid

    @property
    def ready(self) -> bool:
        """Whether everything that is required flows, and its clocks are sane."""
        return bool(self.status.get("ready"))

    def lost(self) -> set[str]:
        """Return the required streams that are not as they should be, by the study's names."""
        return {
            stream["label"]
            for stream in self.status.get("streams", ())
            if stream["required"] and not stream["sane"]
        }

    def complaints(self) -> list[str]:
        """Return what is not as it should be, one line for each complaint."""
        lines = [f"recorder: {fault}" for fault in self.status.get("faults", ())]
        for stream in self.status.get("streams", ()):
            lines += [f"{stream['label']}: {warning}" for warning in stream["warnings"]]
            lines += [f"{stream['label']}: {misfit}" for misfit in stream["misfits"]]
            if not (stream["sane"] or stream["warnings"] or stream["misfits"]):
                lines.append(f"{stream['label']}: {stream['condition']}")
        return list(dict.fromkeys(lines))

    def watch(self) -> bool:
        """Start the recorder again if it has died; whether it had."""
        if self._process.poll() is None:
            return False
        self.restarts += 1
        self.status = {}
        self._process = self._start()
        return True

    def stop(self) -> None:
        """Let the recorder write down what has come and close its journal."""
        process = self._process
        if process.stdin is None:
            raise AssertionError("the recorder is started with a pipe")
        try:
            process.stdin.write("stop\n")
            process.stdin.close()
        except BrokenPipeError:
            pass  # it died this very moment; its journal is as whole as it can be
        deadline = time.monotonic() + PATIENCE_S
        try:
            process.wait(max(0.0, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        self._listener.join()

    def _start(self) -> "subprocess.Popen[str]":
        process = subprocess.Popen(  # noqa: S603 - our own program
            [sys.executable, "-m", "labcrane.streams.recorder", self._orders],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            # It closes its journal when told to, not when a key is pressed.
            start_new_session=True,
        )
        self._listener = threading.Thread(target=self._listen, args=(process,), daemon=True)
        self._listener.start()
        return process

    def _listen(self, process: "subprocess.Popen[str]") -> None:
        if process.stdout is None:
            raise AssertionError("the recorder is started with a pipe")
        for line in process.stdout:
            status = json.loads(line)
            if process is self._process_or(process):
                self.status = status

    def _process_or(self, process: "subprocess.Popen[str]") -> "subprocess.Popen[str]":
        """Return the present recorder; ``process`` itself while it is just being started."""
        return getattr(self, "_process", process)
