"""Keeps a recorder process running for as long as a recording lasts.

A spare process has loaded everything and waits for its orders, so that a recorder that dies is
replaced at once.
"""

import json
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any

from labcrane.streams.request import StreamRequest

PATIENCE_S = 15.0
"""How long a recorder may take to close its journal when it is told to stop, or a spare to end."""


class RecorderHandle:
    """Starts the recorder, starts it again when it dies, and knows what it last said.

    Attributes
    ----------
    status
        The last line of the recorder's own report; empty before it has spoken.
    restarts
        How often it had to be started again.

    Parameters
    ----------
    journal, requests
        Where the streams go, and which.
    monitors
        What looks at their signals, as of :class:`labcrane.monitoring.config.MonitorConfig`; None
        for nothing.
    """

    def __init__(
        self,
        journal: Path,
        requests: Sequence[StreamRequest],
        monitors: Mapping[str, Any] | None = None,
    ) -> None:
        self.status: dict[str, Any] = {}
        self.restarts = 0
        self._orders = json.dumps(
            {
                "journal": str(journal),
                "streams": [asdict(request) for request in requests],
                "monitors": monitors,
            }
        )
        self._spare = _Recorder()
        self._process = self._start()

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

    def signals(self) -> dict[tuple[str, str, str], str]:
        """Return what is wrong with signals: the message by stream, channel and kind of fault.

        Streams have the study's names; the channel is empty for a whole stream.
        """
        return {
            (stream["label"], fault["channel"], fault["kind"]): fault["message"]
            for stream in self.status.get("streams", ())
            for fault in stream["signals"]
        }

    def unwatched(self) -> list[str]:
        """Return which monitors look no more, one line for each."""
        died = self.status.get("signals")
        lines = [died] if died else []
        for stream in self.status.get("streams", ()):
            lines += [
                f"{stream['label']}: monitor {name!r} was left out: {why}"
                for name, why in stream["unwatched"].items()
            ]
        return lines

    def watch(self) -> bool:
        """Start the recorder again if it has died; whether it had."""
        if self._process.poll() is None:
            return False
        self._process.hang_up()
        self.restarts += 1
        self.status = {}
        self._process = self._start()
        return True

    def stop(self) -> None:
        """Let the recorder write down what has come and close its journal."""
        process = self._process
        with suppress(BrokenPipeError):  # when it has died its journal is as whole as it can be
            process.stdin.write("stop\n")
        process.hang_up()
        process.end()
        self._listener.join()
        self._spare.hang_up()  # it ends without having been told anything
        self._spare.end()
        self._spare.stdout.close()

    def _start(self) -> "_Recorder":
        """Give the spare recorder its orders, and have another one ready."""
        ready = self._spare if self._spare.poll() is None else _Recorder()
        process, self._spare = ready, _Recorder()
        with suppress(BrokenPipeError):  # it died this very moment: the next look replaces it
            process.stdin.write(self._orders + "\n")
            process.stdin.flush()
        self._listener = threading.Thread(
            target=self._listen, args=(process, self.restarts), daemon=True
        )
        self._listener.start()
        return process

    def _listen(self, process: "_Recorder", life: int) -> None:
        with process.stdout as lines:
            for line in lines:
                if life == self.restarts:  # and not what a dead one had still to say
                    self.status = json.loads(line)


class _Recorder(subprocess.Popen[str]):
    """A recorder process that waits for its orders."""

    stdin: IO[str]
    stdout: IO[str]

    def __init__(self) -> None:
        super().__init__(
            [sys.executable, "-m", "labcrane.streams.recorder.process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            # It closes its journal when told to, not when a key is pressed.
            start_new_session=True,
        )

    def hang_up(self) -> None:
        """Let it hear no more."""
        with suppress(BrokenPipeError):
            self.stdin.close()

    def end(self) -> None:
        """Wait until it has ended, as it was told to; one that hangs is killed."""
        try:
            self.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.kill()
            self.wait()
