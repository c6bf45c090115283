"""Keeping LSL on this computer."""

import os
import subprocess
import sys

import pytest

from labcrane import StreamError
from labcrane.streams.network import LOOPBACK, VARIABLE, describe, use_loopback


def python(code, **env):
    """Run code in a fresh interpreter."""
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, encoding="utf-8", env=env, check=False
    )


def test_use_loopback_writes_a_configuration_that_liblsl_reads():
    done = python(
        "from labcrane.streams.network import use_loopback, describe\n"
        "network = use_loopback()\n"
        "assert network.loopback and describe() == network == use_loopback()\n"
        "import pylsl\n"
        "pylsl.local_clock()\n"
        "print(network.config.read_text(), end='')"
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == LOOPBACK
    assert "Loaded default config" not in done.stderr


def test_use_loopback_refuses_when_pylsl_is_loaded_already():
    done = python(
        "import os\n"
        "import pylsl\n"
        "from labcrane.streams.network import use_loopback\n"
        "del os.environ['LSLAPICFG']\n"
        "use_loopback()",
        LSLAPICFG=os.environ[VARIABLE],
    )
    assert "pylsl was imported before LSLAPICFG was set" in done.stderr


def test_a_configuration_of_the_user_holds(tmp_path, monkeypatch):
    config = tmp_path / "lab.cfg"
    config.write_text("[lab]\nKnownPeers = {10.0.0.7}\n", encoding="utf-8")
    monkeypatch.setenv(VARIABLE, str(config))
    network = use_loopback()
    assert network.config == config
    assert not network.loopback
    assert "the network" in str(network)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("ResolveScope = machine", "ResolveScope = link"),
        ("IPv6 = disable", "IPv6 = allow"),
        ("KnownPeers = {127.0.0.1}", "KnownPeers = {127.0.0.1, 10.0.0.7}"),
        ("AddressesOverride = {127.0.0.1}\n", ""),
    ],
)
def test_one_address_beyond_this_computer_is_not_loopback(tmp_path, monkeypatch, old, new):
    config = tmp_path / "almost.cfg"
    config.write_text(LOOPBACK, encoding="utf-8")
    monkeypatch.setenv(VARIABLE, str(config))
    assert describe().loopback
    config.write_text(LOOPBACK.replace(old, new), encoding="utf-8")
    assert not describe().loopback


def test_a_configuration_that_cannot_be_read_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, str(tmp_path / "missing.cfg"))
    with pytest.raises(StreamError, match=r"missing\.cfg"):
        use_loopback()
