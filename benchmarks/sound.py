"""Sound: how fast the tone is made offline, and how many blocks until a change is heard.

python -m benchmarks.sound
"""

import time

import numpy as np

from benchmarks.table import Row
from labcrane_sonification.settings import SonificationSettings
from labcrane_sonification.synth import Synth, offline_server
from labcrane_sonification.tone import Tone, tone

ROUNDS, SECONDS = 5, 4.0


def rows(*, brief: bool = False) -> list[Row]:
    """Return what a block with a change costs beside bare pyo with the same settings."""
    rounds = 1 if brief else ROUNDS
    settings = SonificationSettings(block=256, ramp_s=0.0)
    synth = Synth(offline_server(settings), settings)
    count = round(SECONDS * settings.rate_hz / settings.block)
    ours, bare = [], []
    for _ in range(rounds):
        ours.append(1e6 * SECONDS / _speed(synth, settings) / count)
        controls = (synth._pitch, *synth._levels)  # what a change sets, by pyo alone
        began = time.perf_counter()
        for number in range(count):
            for control in controls:
                control.value = 100.0 + number / count
            synth.block()
        bare.append(1e6 * (time.perf_counter() - began) / count)
    heard_after = _delay(synth)
    synth.close()
    each = float(np.median(ours))
    second = 1e-6 * each * settings.rate_hz / settings.block
    least = "pyo's block with the same set"
    return [
        Row("sound", "a block of 256 with a change, us", each, float(np.median(bare)), least, 2.0),
        Row("sound", "a second of sound made offline, s", second, 1.0, "the second", 0.01),
        Row("sound", "blocks until a change is heard", heard_after + 1.0, 1.0, "the next", 1.0),
    ]


def main() -> None:
    """Print both figures for every block size."""
    print("block   real time   delay")
    for block in (64, 128, 256, 512, 1024):
        settings = SonificationSettings(block=block, ramp_s=0.0)
        synth = Synth(offline_server(settings), settings)
        speed = np.median([_speed(synth, settings) for _ in range(ROUNDS)])
        print(f"{block:5d}   {speed:7.0f} x   {_delay(synth)} blocks")
        synth.close()


def _speed(synth: Synth, settings: SonificationSettings) -> float:
    count = round(SECONDS * settings.rate_hz / settings.block)
    began = time.perf_counter()
    for number in range(count):
        synth.sound(tone(settings, 4.0 * (1.0 - number / count), 0.1, 0.0))
        synth.block()
    return SECONDS / (time.perf_counter() - began)


def _delay(synth: Synth) -> int:
    """Return how many blocks pass between a change and the first block that has it."""
    synth.silence()
    while np.abs(synth.block()).max() > 0.0:
        pass
    synth.sound(Tone(1000.0, 0.0, 0.5, 0.0))
    blocks = 0
    while np.abs(synth.block()).max() == 0.0:
        blocks += 1
    return blocks


if __name__ == "__main__":
    main()
