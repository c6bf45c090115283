"""A bus behind a socketcand server on this computer."""

import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress

import can
import pytest

from labcrane import DeviceError, Tick
from labcrane.testing import ch8, make_frame, make_run
from labcrane_can.avc import encode
from labcrane_can.panel import CanPanel
from labcrane_can.settings import CanSettings

VALVES = {"slew": 1, "shoulder": 2, "elbow": 3, "wrist": 4}


class Server:
    """As much of socketcand as raw mode needs, with a panel on its bus that always says the same.

    The protocol is described in socketcand's doc/protocol.md.
    """

    def __init__(self, levels: dict[int, int]) -> None:
        self._levels = levels
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.port = self._socket.getsockname()[1]
        self.said: list[str] = []
        self._client: socket.socket | None = None
        self._over = False
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def hang_up(self) -> None:
        if self._client is not None:
            with suppress(OSError):  # it was faster
                self._client.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self._over = True
        self.hang_up()
        self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self._thread.join()

    def _serve(self) -> None:
        while not self._over:
            try:
                client, _ = self._socket.accept()
            except OSError:
                return
            self._client = client
            with client, suppress(OSError):  # hung up
                self._talk(client)

    def _talk(self, client: socket.socket) -> None:
        client.sendall(b"< hi >")
        while text := client.recv(4096).decode("ascii"):
            self.said += re.findall(r"< .*? >", text)
            client.sendall(b"< ok >" * len(re.findall("open|rawmode", text)))
            if "rawmode" in text:
                threading.Thread(target=self._send, args=(client,), daemon=True).start()

    def _send(self, client: socket.socket) -> None:
        try:
            while True:
                for valve, level in self._levels.items():
                    identifier, data = encode(valve, level, 0x25)
                    text = f"< frame {identifier:08X} {time.time():.6f} {data.hex().upper()} >"
                    client.sendall(text.encode())
                time.sleep(0.02)
        except OSError:
            return


@pytest.fixture
def server() -> Iterator[Server]:
    server = Server({1: 50, 2: -125, 3: 0, 4: 250})
    yield server
    server.close()


def test_a_panel_behind_socketcand_is_read_told_lost_and_found_again(server: Server) -> None:
    bus = f"socketcand:can0@127.0.0.1:{server.port}"
    device = CanPanel(CanSettings(bus=bus, valves=VALVES), ch8())
    run = make_run(ch8(), axes=device.signals)
    device.open(run)

    def read_until(ready: Callable[[list[float]], bool]) -> list[float]:
        end = time.perf_counter() + 240.0
        while time.perf_counter() < end:
            now = time.perf_counter()
            axes = device.read(Tick(0, now, now), make_frame(run))[:4].tolist()
            if ready(axes):
                return axes
            time.sleep(0.005)
        raise AssertionError(f"waited in vain; {device.fault}")

    with closing(device):
        assert read_until(lambda axes: all(axes[at] for at in (0, 1, 3))) == [0.2, -0.5, 0.0, 1.0]
        assert device.fault is None
        identifier, data = encode(3, -1, 0x80)
        assert device._listener is not None
        device._listener.send(identifier, data)
        wanted = f"< send {identifier:08X} 8 {' '.join(f'{byte:x}' for byte in data)} >"
        read_until(lambda _: wanted in server.said)
        assert server.said[:2] == ["< open can0 >", "< rawmode >"]
        server.hang_up()
        read_until(lambda axes: not any(axes))
        why = f"{bus} is gone: no data came for 1 s; the connection is being reopened"
        read_until(lambda _: device.fault in {why, None})
        read_until(lambda axes: axes == [0.2, -0.5, 0.0, 1.0])  # it was dialled again
        assert device.fault is None


def test_a_server_that_is_not_there_is_told_before_python_can_tries_for_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(can, "Bus", lambda **_: pytest.fail("python-can tries for 10 s"))
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    settings = CanSettings(bus=f"socketcand:can0@127.0.0.1:{port}", valves=VALVES)
    with pytest.raises(DeviceError, match=r"cannot be opened: .*refused; plug the adapter in"):
        CanPanel(settings, ch8()).open(make_run(ch8()))
