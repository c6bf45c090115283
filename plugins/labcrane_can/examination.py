"""Bus examination: whether it can be opened, and what a panel says on it."""

import time
from collections import Counter

from labcrane import DeviceError, ProtocolError
from labcrane.core import Finding, Verdict
from labcrane.registry import Prompt
from labcrane_can.command_state import PanelCommands
from labcrane_can.listener import MOST_FRAMES_S, open_bus
from labcrane_can.settings import CanSettings

LISTEN_S = 1.0
WAIT_S = 0.05


def examine(settings: CanSettings, ask: Prompt | None) -> list[Finding]:
    """Listen to the bus for a second; nothing is sent."""
    del ask  # a panel in order speaks without being touched
    try:
        commands = PanelCommands(settings)
        bus = open_bus(settings)
    except (DeviceError, ProtocolError) as error:
        return [Finding.failed(error)]
    sources: Counter[int] = Counter()
    try:
        began = now = time.perf_counter()
        while now - began < LISTEN_S:
            frame = bus.recv(WAIT_S)
            now = time.perf_counter()
            if frame is not None:
                sources[frame.arbitration_id & 0xFF] += 1
                commands.take(frame, now)
    finally:
        bus.shutdown()
    return [_traffic(settings, sources, now - began), *_valves(commands)]


def _traffic(settings: CanSettings, sources: Counter[int], seconds: float) -> Finding:
    rate = sum(sources.values()) / seconds
    nodes = ", ".join(f"0x{node:02X}" for node in sorted(sources))
    text = f"{settings.bus}: {rate:.0f} frames a second"
    if rate > MOST_FRAMES_S:
        return Finding(Verdict.FAIL, f"{text} from {nodes}", "find the device that floods the bus")
    if not sources:
        fix = f"switch the panel on; check its plug, the terminators and bitrate {settings.bitrate}"
        return Finding(Verdict.FAIL, f"{settings.bus} is open and silent", fix)
    return Finding(Verdict.PASS, f"{text} from {nodes}")


def _valves(commands: PanelCommands) -> list[Finding]:
    heard = [joint for joint, asked in commands.asked.items() if asked.time > 0.0]
    silent = [joint for joint in commands.asked if joint not in heard]
    found = []
    if heard:
        found.append(Finding(Verdict.PASS, f"the panel commands {', '.join(heard)}"))
    if silent:
        why = f" ({commands.complaint()})" if commands.complaint() else ""
        text = f"no command for {', '.join(silent)} within {LISTEN_S:g} s{why}"
        found.append(Finding(Verdict.FAIL, text, "compare valves and node with the panel's manual"))
    return found
