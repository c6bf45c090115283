"""An amplifier on a computer with another clock. Sends the truth in its first channel.

Channel 0 is the true time of the sample, channel 1 its number, the rest is noise. ``exact`` stamps
every sample with what its clock reads when it is taken; ``chunk`` sends samples some time after,
without stamps, so that liblsl stamps the last one of a chunk with the time of sending. The other
modes are exact as well, but for what their name says. A device that finds itself late by a second,
as after a sleep, goes on with the sample that is due.
"""

import argparse
import ctypes
import random
import time

import numpy as np
import pylsl

CLOCK_GETTIME, CLOCK_MONOTONIC = 228, 1  # x86-64

MODES = (
    "exact", "chunk", "lost", "uneven", "stalling", "shuffled", "changing", "receiver", "foreign",
    "dying", "coarse",
)  # fmt: skip
FOREIGN_S = 77_777.0
HELD_S = 2.5


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


def told():
    parser = argparse.ArgumentParser()
    parser.add_argument("--name", default="Skewed")
    parser.add_argument("--mode", choices=MODES, default="exact")
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--size", type=int, default=20)
    parser.add_argument("--turn-s", type=float, default=15.0, help="when what happens once does")
    parser.add_argument("--crystal-ppm", type=float, default=35.0)
    parser.add_argument("--least-s", type=float, default=0.008)
    parser.add_argument("--scatter-s", type=float, default=0.004)
    return parser.parse_args()


def main():
    options = told()
    outlet = an_outlet(options)
    noise, delays = np.random.default_rng(1), random.Random(2)
    size, actual = options.size, options.rate * (1 + options.crystal_ppm * 1e-6)
    begin, first = true_time() + 0.2, 0
    turn = begin + options.turn_s
    held = []
    while True:
        numbers = np.arange(first, first + size)
        times = sampled(options.mode, begin + numbers / actual, turn, noise, options.rate)
        due = times.max()
        if options.mode == "chunk":
            due += options.least_s + delays.expovariate(1.0) * options.scatter_s
        if options.mode == "dying" and due > turn:
            time.sleep(3600.0)
        wait_until(due)
        if true_time() - due > 1.0:
            first = int((true_time() - begin) * actual) + 1
            continue
        first += size
        samples = noise.normal(size=(size, 8))
        samples[:, 0], samples[:, 1] = times, numbers
        held.append((samples, stamped(options.mode, times)))
        if options.mode == "stalling" and turn < due < turn + HELD_S:
            continue
        if options.mode == "shuffled" and len(held) < 2:
            continue
        if options.mode == "shuffled" and delays.random() < 0.1:
            held.reverse()
        for values, stamps in held:
            send(outlet, options.mode, values, stamps, noise)
        held.clear()


def send(outlet, mode, values, stamps, noise):
    if mode == "chunk":
        outlet.push_chunk(values)
        return
    kept = noise.random(len(values)) > (0.005 if mode == "lost" else -1.0)
    if kept.any():
        outlet.push_chunk(values[kept], [stamps[k] for k in np.flatnonzero(kept)])


def sampled(mode, times, turn, noise, rate):
    """Return when samples are really taken."""
    if mode == "uneven":
        return np.sort(times + noise.normal(0.0, 0.1 / rate, len(times)))
    if mode == "changing":
        return np.where(times > turn, turn + (times - turn) / 1.01, times)
    return times


def stamped(mode, times):
    """Return how samples taken at these times are stamped."""
    if mode == "receiver":
        return list(times)
    stamps = [MAP(t) for t in times]
    if mode == "foreign":
        return [stamp + FOREIGN_S for stamp in stamps]
    return [round(stamp, 3) for stamp in stamps] if mode == "coarse" else stamps


main()
