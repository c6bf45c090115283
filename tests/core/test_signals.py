"""Named quantities, and where they sit in an array."""

from types import SimpleNamespace

import pytest

from labcrane import ProtocolError, Signal
from labcrane.core import Layout, signals_of
from labcrane.protocol.rig import Rig

SIGNALS = (
    Signal("left", "1", ("x", "trigger")),
    Signal("joint.angle", "rad", ("slew", "wrist")),
    Signal("joint.velocity", "rad/s", ("slew", "wrist")),
    Signal("mode", "1"),
)


def test_signals_come_back_from_the_columns_of_a_recording() -> None:
    layout = Layout("the machine", SIGNALS)
    units = dict(zip(layout.columns, layout.units, strict=True))
    assert signals_of(layout.columns, units) == SIGNALS


def test_a_signal_is_found_where_its_columns_are() -> None:
    layout = Layout("the machine", SIGNALS)
    assert layout.columns[layout.find("joint.velocity")] == (
        "joint.velocity.slew",
        "joint.velocity.wrist",
    )
    assert layout.index("mode") == layout.size - 1


def test_what_is_not_there_is_told_with_what_is() -> None:
    layout = Layout("the machine", SIGNALS)
    with pytest.raises(ProtocolError, match=r"has no 'tip'; it has left, joint\.angle"):
        layout.find("tip")
    with pytest.raises(ProtocolError, match=r"has no 'left\.y'; it has left\.x, left\.tri"):
        layout.index("left.y")


def test_tasks_that_show_other_signals_are_named_with_what_they_show() -> None:
    device = SimpleNamespace(signals=SIGNALS)
    tasks = {"aim": SimpleNamespace(signals=SIGNALS[:2]), "idle": SimpleNamespace(signals=())}
    study = SimpleNamespace(protocol=SimpleNamespace(rate_hz=240.0), machine=None)
    with pytest.raises(
        ProtocolError, match=r"'aim' shows left, joint.angle; 'idle' shows nothing; put them into"
    ):
        Rig(device, device, device, tasks).describe(study, participant_seed=1)
