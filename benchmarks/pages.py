"""Pages under attack: how soon the examiner's notes are answered while a session runs at 240 Hz.

    python -m benchmarks.pages

The attackers come from other addresses: pages that are refused and pages that are allowed, asked
for without an end, bodies of 226 MB, readers that never read, hundreds of sockets, messages. They
share this computer with the session, which a laboratory's do not.
"""

import os
import sys
import tempfile
from pathlib import Path

from benchmarks.table import Row, show

TESTS = Path(__file__).parents[1] / "tests"
LSL = "[multicast]\nAddressesOverride = {127.0.0.1}\n[lab]\nKnownPeers = {127.0.0.1}\n"
SECONDS, PROMISED_S = 20.0, 1.0


def rows() -> list[Row]:
    """Return how long the slowest of the notes took."""
    sys.path.insert(0, str(TESTS))
    from faults.sessions import unique, wait_for  # noqa: PLC0415
    from pages.room import STUDY, a_room  # noqa: PLC0415
    from pages.siege import attack  # noqa: PLC0415
    from pages.test_rights import ask, cookie_of  # noqa: PLC0415

    steps = "      - break: {seconds: 120}\n      - block: {task: aiming, pairs: 1}\n"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if "LSLAPICFG" not in os.environ:
            (folder / "lsl_api.cfg").write_text(LSL)
            os.environ["LSLAPICFG"] = str(folder / "lsl_api.cfg")
        protocol = folder / "study.yaml"
        protocol.write_text(STUDY.format(study=unique("siege"), steps=steps))
        with a_room(protocol, folder / "data") as room:
            wait_for(lambda: room.process("pages"))
            examiner, guest = (cookie_of(room, page) for page in ("supervisor", "participant"))
            told = attack(room, examiner, guest, SECONDS)
            ask(room, "POST", "/orders/end", examiner)
            room.ended()
    assert set(told.notes) == {202}, "the right people are let in"
    what = f"slowest answer to {len(told.notes)} notes under attack, s"
    return [Row("pages", what, max(told.delays), PROMISED_S, "a second", 1.0)]


if __name__ == "__main__":
    show(rows())
