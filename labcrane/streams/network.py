"""Network on which LSL streams travel: this computer only, or the lab's.

liblsl reads the file named by ``LSLAPICFG`` once, when it is loaded. So the choice is made before
anything imports pylsl, and child processes inherit it with the environment.
"""

import atexit
import configparser
import os
import socket
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from labcrane.errors import StreamError

VARIABLE = "LSLAPICFG"

FIRST_PORT, PORTS = 16572, 32
"""liblsl's defaults."""

# KnownPeers makes streams of other processes visible to liblsl before 1.18, which sees only one of
# them by multicast on loopback. PortRange 32, the default, hides outlets beyond the 32nd. Clock
# probes each second, not each two, halve the time a step of a clock goes unseen. A search that
# ends in the very moment when another wave of it begins lasts as long as that wave waits for its
# answers, 5 s by default.
LOOPBACK = """\
; LSL on this computer only: no multicast, no broadcast, nothing beyond loopback.
[ports]
IPv6 = disable
PortRange = 128
[multicast]
ResolveScope = machine
MachineAddresses = {127.0.0.1}
AddressesOverride = {127.0.0.1}
Interfaces = {127.0.0.1}
ListenAddress = 127.0.0.1
TTLOverride = 0
[lab]
KnownPeers = {127.0.0.1}
[tuning]
MulticastMinRTT = 0.05
UnicastMinRTT = 0.1
MulticastMaxRTT = 1
UnicastMaxRTT = 1
ContinuousResolveInterval = 0.75
TimeUpdateInterval = 1
[log]
level = -3
"""


@dataclass(frozen=True, slots=True)
class Network:
    """What liblsl was, or will be, told.

    Attributes
    ----------
    config
        The file in ``LSLAPICFG``; None when liblsl looks for its own.
    loopback
        Whether streams stay on this computer.
    """

    config: Path | None
    loopback: bool

    def __str__(self) -> str:
        reach = "this computer only" if self.loopback else "the network"
        return f"LSL reaches {reach}, as {self.config or 'liblsl finds its configuration'} says"


def use_loopback() -> Network:
    """Keep LSL on this computer, here and in child processes; call it before pylsl is imported.

    A configuration that the user has set in ``LSLAPICFG`` holds, whatever it says: look at the
    answer.

    Raises
    ------
    StreamError
        When pylsl has been imported without a configuration, or the one set cannot be read.
    """
    if os.environ.get(VARIABLE):
        return describe()
    if "pylsl" in sys.modules:
        raise StreamError(
            f"LSL cannot be kept on this computer any more: pylsl was imported before {VARIABLE} "
            "was set; call use_loopback() first"
        )
    handle, name = tempfile.mkstemp(prefix="labcrane-lsl-", suffix=".cfg")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(LOOPBACK)
    atexit.register(_remove, name, os.getpid())
    os.environ[VARIABLE] = name
    return Network(Path(name), loopback=True)


def describe() -> Network:
    """Say which configuration holds, and whether it keeps streams on this computer."""
    if not (name := os.environ.get(VARIABLE)):
        return Network(None, loopback=False)
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    try:
        parser.read_string(Path(name).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, configparser.Error) as error:
        raise StreamError(
            f"{VARIABLE} names {name}, which cannot be read ({error}); correct it or unset it"
        ) from error
    return Network(Path(name), loopback=_stays_here(parser))


def port_range() -> range:
    """Return the ports that liblsl takes for streams and searches, on this computer.

    Raises
    ------
    StreamError
        The configuration cannot be read.
    """
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    if config := describe().config:
        parser.read_string(config.read_text(encoding="utf-8"))
    first = parser.getint("ports", "BasePort", fallback=FIRST_PORT)
    return range(first, first + parser.getint("ports", "PortRange", fallback=PORTS))


def free_ports() -> int:
    """Return how many ports of liblsl's range are free for UDP and for TCP, the fewer of both."""
    kinds = (socket.SOCK_DGRAM, socket.SOCK_STREAM)
    return min(sum(_is_free(port, kind) for port in port_range()) for kind in kinds)


def _is_free(port: int, kind: socket.SocketKind) -> bool:
    with socket.socket(socket.AF_INET, kind) as probe:
        try:
            probe.bind(("", port))
        except OSError:
            return False
    return True


def _stays_here(parser: configparser.ConfigParser) -> bool:
    """Whether every address that liblsl may send to is on this computer."""
    if parser.get("multicast", "ResolveScope", fallback="site").strip() != "machine":
        return False
    if parser.get("ports", "IPv6", fallback="allow").strip() not in ("disable", "disabled"):
        return False
    lists = [
        parser.get("multicast", "AddressesOverride", fallback=""),
        parser.get("multicast", "MachineAddresses", fallback=""),
        parser.get("lab", "KnownPeers", fallback="{}"),
    ]
    first, second, peers = (
        [part.strip() for part in text.strip(" {}").split(",")] for text in lists
    )
    return all(address.startswith("127.") for address in [*first, *second, *filter(None, peers)])


def _remove(name: str, owner: int) -> None:
    """Remove the file at exit, but not at the exit of a forked child."""
    if os.getpid() == owner:
        Path(name).unlink(missing_ok=True)
