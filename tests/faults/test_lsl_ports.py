"""A laboratory full of streams begins with the default ports of LSL, and what it takes of them."""

import json
import sys
from pathlib import Path

import pytest
from needs import needs
from own_modules import OWN_MODULES
from programs import ran

from labcrane.streams.network import LOOPBACK
from labcrane.streams.search import PORTS

NETWORK = ["unshare", "-rn"]
BEGINS_S = 15.0
HERE = Path(__file__).parent
OUTLETS = {"session or page": 8, "feedback.process": 2, "recorder.process": 0}
"""Streams that one process of a kind sends: the session 7, and the gateway's flow."""

needs_network = needs("networks")


def begun(folder: Path, times: int) -> list[dict]:
    """Begin a run with page, three views, two sounds, recorders, gateway and ten streams."""
    config = folder / "lsl_api.cfg"
    loopback, _, _ = LOOPBACK.partition("[tuning]")
    config.write_text(loopback.replace("PortRange = 128\n", ""))  # what is left is LSL's default
    assert "PortRange" not in config.read_text()
    done = ran(
        [*NETWORK, sys.executable, str(HERE / "crowded_run.py"), str(folder), str(times)],
        check=True,
        env={"LSLAPICFG": str(config), "PYTHONPATH": OWN_MODULES},
    )
    return [json.loads(line) for line in done.stdout.splitlines()]


def within_the_range(run: dict) -> None:
    assert run["took"] is not None, run["said"]
    for what, outlets in OUTLETS.items():
        assert run["holders"][what] <= outlets + PORTS, run["holders"]


@needs_network
@pytest.mark.long
def test_a_run_among_ten_streams_begins_with_the_default_ports(tmp_path, record_property) -> None:
    (run,) = begun(tmp_path, 1)
    record_property("begun", run)
    within_the_range(run)


@needs_network
@pytest.mark.soak
@pytest.mark.timeout(1500)
def test_it_begins_each_of_twenty_times(tmp_path, record_property) -> None:
    runs = begun(tmp_path, 20)
    record_property("begun", runs)
    assert len(runs) == 20
    for run in runs:
        within_the_range(run)
        assert run["took"] <= BEGINS_S
    record_property("seconds until it began", [run["took"] for run in runs])
