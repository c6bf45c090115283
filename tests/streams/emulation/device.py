"""An amplifier on a computer with another clock. Sends the truth in its first channel.

Channel 0 is the true time of the sample, channel 1 its number, the rest is noise. ``exact`` stamps
every sample with what its clock reads when it is taken; ``chunk`` sends samples some time after,
without stamps, so that liblsl stamps the last one of a chunk with the time of sending.
"""

import argparse
import ctypes
import random
import time

import numpy as np
import pylsl

CLOCK_GETTIME, CLOCK_MONOTONIC = 228, 1  # x86-64


class Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


LIBC = ctypes.CDLL(None, use_errno=True)
MAP = LIBC.skew_map
MAP.restype, MAP.argtypes = ctypes.c_double, [ctypes.c_double]


def true_time():
    """Return the computer's own clock, by a system call that nothing intercepts."""
    now = Timespec()
    LIBC.syscall(ctypes.c_long(CLOCK_GETTIME), ctypes.c_long(CLOCK_MONOTONIC), ctypes.byref(now))
    return now.seconds + now.nanoseconds * 1e-9


def wait_until(due):
    """Sleep, and spin at the end: the least transport delay is what it is said to be."""
    time.sleep(max(due - true_time() - 0.0003, 0.0))
    while true_time() < due:
        pass


def an_outlet(options):
    info = pylsl.StreamInfo(
        options.name, "EEG", 8, options.rate, "double64", f"{options.name}-amplifier"
    )
    channels = info.desc().append_child("channels")
    for label in ("Truth", "Counter", *(f"E{k}" for k in range(6))):
        channel = channels.append_child("channel")
        channel.append_child_value("label", label)
        channel.append_child_value("unit", "microvolts")
    return pylsl.StreamOutlet(info)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--name", default="Skewed")
    parser.add_argument("--mode", choices=("exact", "chunk"), default="exact")
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--crystal-ppm", type=float, default=35.0)
    parser.add_argument("--least-s", type=float, default=0.008)
    parser.add_argument("--scatter-s", type=float, default=0.004)
    options = parser.parse_args()
    outlet = an_outlet(options)
    noise, delays = np.random.default_rng(1), random.Random(2)
    size, actual = 20, options.rate * (1 + options.crystal_ppm * 1e-6)
    begin, first = true_time() + 0.2, 0
    while True:
        numbers = np.arange(first, first + size)
        times = begin + numbers / actual
        due = times[-1]
        if options.mode == "chunk":
            due += options.least_s + delays.expovariate(1.0) * options.scatter_s
        wait_until(due)
        samples = noise.normal(size=(size, 8))
        samples[:, 0], samples[:, 1] = times, numbers
        if options.mode == "exact":
            outlet.push_chunk(samples, [MAP(t) for t in times])
        else:
            outlet.push_chunk(samples)
        first += size


main()
