"""Send EEG and gaze as an amplifier and an eye tracker do, until standard input ends."""

import math
import sys
import threading

from pylsl import StreamInfo, StreamOutlet, local_clock

STREAMS = {
    "EEG": (100.0, {"Fz": ("microvolts", "EEG"), "Cz": ("microvolts", "EEG")}),
    "Gaze": (50.0, {"x": ("pixels", "Gaze"), "y": ("pixels", "Gaze")}),
}


def outlet(kind: str) -> StreamOutlet:
    rate, channels = STREAMS[kind]
    info = StreamInfo(f"former {kind}", kind, 2, rate, "float32", f"former-{kind.lower()}")
    described = info.desc().append_child("channels")
    for label, (unit, of_type) in channels.items():
        channel = described.append_child("channel")
        for name, value in (("label", label), ("unit", unit), ("type", of_type)):
            channel.append_child_value(name, value)
    return StreamOutlet(info)


def send(kind: str, ended: threading.Event) -> None:
    rate, out, sent, began = STREAMS[kind][0], outlet(kind), 0, local_clock()
    while not ended.wait(max(0.0, began + sent / rate - local_clock())):
        angle = 2.0 * math.pi * sent / rate
        wave = [round(20.0 * math.sin(10.0 * angle)), round(20.0 * math.cos(4.0 * angle))]
        out.push_sample(wave if kind == "EEG" else [960.0 + wave[0], 540.0 + wave[1]])
        sent += 1


ended = threading.Event()
senders = [threading.Thread(target=send, args=(kind, ended)) for kind in STREAMS]
for each in senders:
    each.start()
sys.stdin.read()
ended.set()
