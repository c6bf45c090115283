"""The process in which monitors look at what a recorder receives.

    python -m labcrane.monitoring.process '{"protocol": "", "machine": "ch8", "use": null}'

On its standard input come messages: a line of JSON, and for samples their times and values as
little-endian doubles behind it. It answers each with a line of JSON: what has changed. It ends with
its input. A monitor that hangs or crashes takes this process with it, and nothing else.

Nothing pauses because of a fault: detection may be wrong, and analysis decides. Threads in the
recorder would end it when they crash in C; inlets of their own would get other samples.
"""

import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from typing import IO, Any

import numpy as np

from labcrane.core.signals import SignalChannel, SignalStream
from labcrane.monitoring.config import MonitorBuilder, MonitorConfig
from labcrane.monitoring.monitored_stream import MonitoredStream
from labcrane.types import FloatArray

DOUBLE = np.dtype("<f8")


def main(arguments: list[str]) -> int:
    """Look at samples until the input ends; the process's exit status."""
    builder = MonitorBuilder(MonitorConfig.of(json.loads(arguments[0])))
    return serve(builder, sys.stdin.buffer, sys.stdout)


def serve(builder: MonitorBuilder, messages: IO[bytes], answers: IO[str]) -> int:
    """Answer every message of ``messages``; the process's exit status."""
    streams: dict[int, MonitoredStream] = {}
    for line in messages:
        message = json.loads(line)
        number = message["number"]
        if "stream" in message:
            streams[number] = _begin(builder, message["stream"])
            answer: dict[str, Any] = {"monitors": streams[number].monitors, "changes": []}
        else:
            times, samples = _samples(messages, message)
            changes = streams[number].look(times, samples)
            answer = {
                "changes": [asdict(each.fault) | {"bad": each.bad} for each in changes],
                "samples": [message["first"], message["first"] + len(times)],
            }
        answer |= {"number": number, "failed": streams[number].failed}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()
    return 0


def _begin(builder: MonitorBuilder, fields: Mapping[str, Any]) -> MonitoredStream:
    channels = tuple(SignalChannel(**channel) for channel in fields["channels"])
    stream = SignalStream(fields["name"], fields["type"], fields["rate_hz"], channels)
    return MonitoredStream(stream, builder.build(stream))


def _samples(messages: IO[bytes], message: Mapping[str, Any]) -> tuple[FloatArray, FloatArray]:
    rows, columns = message["rows"], message["columns"]
    raw = np.frombuffer(messages.read(DOUBLE.itemsize * rows * (1 + columns)), DOUBLE)
    return raw[:rows], raw[rows:].reshape(rows, columns)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
