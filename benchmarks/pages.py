"""Pages: what they cost the loop with four browsers open, and how they answer under attack.

    python -m benchmarks.pages

Sessions with the experimenter's page open in four browsers alternate with sessions of the same
study without pages. The cost is the processor time of the session's process and the lateness of its
ticks. The browsers have the lowest priority, because a laboratory's run on other computers. Even so
the kernel lets them finish their slice of a core. Therefore sessions without pages have other
programs of that priority beside them.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

import numpy as np
import psutil

from benchmarks.beside import QUARTER_MS, late_ms
from benchmarks.table import Row, show

TESTS = Path(__file__).parents[1] / "tests"
LSL = "[multicast]\nAddressesOverride = {127.0.0.1}\n[lab]\nKnownPeers = {127.0.0.1}\n"
SECONDS, PROMISED_S = 20.0, 1.0
BROWSERS, TURNS, WATCHED_S, REST_S = 4, 2, 12.0, 600
LAST_IN_LINE = 19


def rows(*, brief: bool = False) -> list[Row]:
    """Return what the pages cost the loop, and how long the slowest of the notes took."""
    turns, watched_s, siege_s = (1, 3.0, 5.0) if brief else (TURNS, WATCHED_S, SECONDS)
    sys.path[:0] = [str(TESTS), str(TESTS / "helpers")]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if "LSLAPICFG" not in os.environ:
            (folder / "lsl_api.cfg").write_text(LSL)
            os.environ["LSLAPICFG"] = str(folder / "lsl_api.cfg")
        return [*cost(folder, turns, watched_s), siege(folder, siege_s)]


def cost(folder: Path, turns: int, watched_s: float) -> list[Row]:
    """Return lateness and processor time of a session, in four browsers and beside programs."""
    from faults.sessions import unique  # noqa: PLC0415
    from pages.room import STUDY, a_browser  # noqa: PLC0415

    protocol = folder / "rest.yaml"
    steps = f"      - break: {{seconds: {REST_S}}}\n"
    protocol.write_text(STUDY.format(study=unique("cost"), steps=steps))
    share: dict[bool, list[float]] = {False: [], True: []}
    late: dict[bool, list[float]] = {False: [], True: []}
    with a_browser(folder / "profile") as browser:
        for turn in range(turns):
            for watched in (False, True):
                data = folder / f"{turn}{watched}"
                with a_session(protocol, data, watched=watched) as (launcher, session):
                    if watched:
                        watch(browser, link_of(launcher))
                        behind(browser)
                    with nullcontext() if watched else others():
                        used, began = sum(session.cpu_times()[:2]), time.perf_counter()
                        time.sleep(watched_s)
                        ended = time.perf_counter()
                        used = sum(session.cpu_times()[:2]) - used
                    if watched:
                        assert all(map(str.strip, clocks(browser))), "a browser shows nothing"
                due, lateness = late_ms(recovered(data))
                there = (due >= began) & (due < ended)
                assert there.sum() > 0.9 * watched_s * 240.0, "the ticks are of another time"
                share[watched].append(used / (ended - began))
                late[watched].append(float(np.quantile(lateness[there], 0.99)))
                kind = f"{BROWSERS} browsers" if watched else "no pages, other programs"
                print(f"{kind}: {share[watched][-1]:.3f} of a core, 99 % of ticks late by at most "
                      f"{late[watched][-1]:.2f} ms", flush=True)  # fmt: skip
    four = f"{BROWSERS} browsers open"
    return [
        Row("pages", f"99 % of ticks late by at most, {four}, ms", min(late[True]),
            min(late[False]) + QUARTER_MS, "other programs, and a quarter of a tick", 1.0),
        Row("pages", f"the session's share of a core, {four}", min(share[True]),
            min(share[False]), "other programs", 1.5),
    ]  # fmt: skip


@contextmanager
def a_session(
    protocol: Path, data: Path, *, watched: bool
) -> "Iterator[tuple[subprocess.Popen[str], psutil.Process]]":
    """Run a session as a user does, with pages or without; give launcher and session."""
    from faults.sessions import labcrane, session_process, wait_for  # noqa: PLC0415

    page = "--page" if watched else "--no-page"
    words = ("run", protocol, "--participant", "P001", "--simulate", page, "--data", data)
    launcher = labcrane(*words, env={**os.environ, "PYTHONUNBUFFERED": "1", "COLUMNS": "200"})
    try:
        wait_for(lambda: session_process(launcher))
        session = session_process(launcher)
        time.sleep(5.0)  # it has started by then, and does not load any more
        yield launcher, session
    finally:
        processes = [psutil.Process(launcher.pid)]
        processes += processes[0].children(recursive=True)
        for process in processes:
            with suppress(psutil.NoSuchProcess):
                process.kill()
        psutil.wait_procs(processes, timeout=60)
        launcher.wait()
        launcher.stdout.close()


def link_of(launcher: "subprocess.Popen[str]") -> str:
    """Return the link of the experimenter's page, as the launcher prints it."""
    said = (line for line in launcher.stdout if "experimenter's page: " in line)
    return next(said).split("experimenter's page: ")[1].split()[0]


def watch(browser: object, link: str) -> None:
    """Open the experimenter's page in four windows, each drawing as if it were the only one."""
    from faults.sessions import wait_for  # noqa: PLC0415
    from pages.room import text  # noqa: PLC0415

    for number in range(BROWSERS):
        browser.switch_to.new_window("window")
        at = link if number == 0 else link.partition("?")[0]
        wait_for(lambda at=at: loaded(browser, at))  # the link is printed before it is served
        wait_for(lambda: text(browser, "now"))


def loaded(browser: object, link: str) -> bool:
    """Whether a page was loaded."""
    from selenium.common.exceptions import WebDriverException  # noqa: PLC0415

    try:
        browser.get(link)
    except WebDriverException:
        return False
    return True


def clocks(browser: object) -> "Iterator[str]":
    """Yield what each of the four windows says is done now, and close it."""
    from pages.room import text  # noqa: PLC0415

    for handle in browser.window_handles[1:]:
        browser.switch_to.window(handle)
        yield text(browser, "now")
        browser.close()
    browser.switch_to.window(browser.window_handles[0])


@contextmanager
def others() -> "Iterator[None]":
    """Keep every core busy with a program of the lowest priority."""
    words = ["nice", "-n", str(LAST_IN_LINE), sys.executable, "-c", "while True: pass"]
    busy = [subprocess.Popen(words) for _ in os.sched_getaffinity(0)]
    try:
        yield
    finally:
        for each in busy:
            each.kill()
            each.wait()


def behind(browser: object) -> None:
    """Let every other process of this computer go before the browser's."""
    for process in psutil.Process(browser.service.process.pid).children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            process.nice(LAST_IN_LINE)


def recovered(data: Path) -> Path:
    """Return the participant file of a session that was killed."""
    command = [sys.executable, "-m", "labcrane", "recover", str(data)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return data / "P001-SIMULATED" / "P001-SIMULATED.h5"


def siege(folder: Path, seconds: float) -> Row:
    """Return how long the slowest of the notes took while the pages were attacked.

    The attackers come from other addresses: pages that are refused and pages that are allowed,
    asked for without an end, bodies of 226 MB, readers that never read, hundreds of sockets,
    messages. They share this computer with the session, which a laboratory's do not.
    """
    from faults.sessions import unique, wait_for  # noqa: PLC0415
    from pages.room import STUDY, a_room  # noqa: PLC0415
    from pages.siege import attack  # noqa: PLC0415
    from pages.test_rights import ask, cookie_of  # noqa: PLC0415

    steps = "      - break: {seconds: 120}\n      - block: {task: aiming, pairs: 1}\n"
    protocol = folder / "study.yaml"
    protocol.write_text(STUDY.format(study=unique("siege"), steps=steps))
    with a_room(protocol, folder / "data") as room:
        wait_for(lambda: room.process("pages"))
        examiner, guest = (cookie_of(room, page) for page in ("supervisor", "participant"))
        told = attack(room, examiner, guest, seconds)
        ask(room, "POST", "/orders/end", examiner)
        room.ended()
    assert set(told.notes) == {202}, "the right people are let in"
    what = f"slowest answer to {len(told.notes)} notes under attack, s"
    return Row("pages", what, max(told.delays), PROMISED_S, "a second", 1.0)


if __name__ == "__main__":
    show(rows())
