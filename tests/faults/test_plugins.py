"""Plugins that raise, return nonsense, dawdle, hang or exit, in each of their methods."""

import re
from pathlib import Path

import numpy as np
import pytest
from faults.faulty_study import CASES, RUNNING, Spoil, line_of, recorded, run_again, run_fast
from rehearsal import ScriptedConsole

from labcrane import PluginError
from labcrane.testing import Visit, discover, load, main, run


@pytest.mark.slow
@pytest.mark.parametrize(
    ("role", "method", "at", "how"),
    [*((*case, "raising") for case in CASES), ("dynamics", "step", 50, "leaving")],
)
def test_a_method_that_raises_is_named_with_its_line_and_nothing_is_lost(
    role: str, method: str, at: int, how: str, spoil: Spoil
) -> None:
    protocol = spoil(f"{role} {method} {at} {how}")
    with pytest.raises(PluginError) as caught:
        run_fast(protocol)
    said = str(caught.value)
    assert said.startswith(f"{role} 'faulty_{role}' of plugin 'plugins/faulty.py', in {method}() (")
    raised = {"raising": "ValueError: a mistake in a plugin", "leaving": "SystemExit: had enough"}
    line = line_of("raise ValueError" if how == "raising" else "raise SystemExit")
    assert f"raised {raised[how]} ({protocol.parent / 'plugins' / 'faulty.py'}:{line})" in said
    session = recorded(protocol)
    if method in RUNNING:
        assert session is not None
        failed = session.events.query("name == 'session.failed'")
        assert [data["why"] for data in failed["data"]] == [said]
        tick = int(re.search(r"in tick (\d+)$", said)[1])
        assert len(session.streams["loop"].data) == tick
        assert "labcrane resume" in caught.value.__notes__[0]
        run_again(protocol)
    elif method == "close":
        assert session is not None
        assert session.events["name"].iloc[-1] == "session.end"


@pytest.mark.slow
def test_a_machine_that_cannot_be_reset_is_named_when_its_session_is_gone_on_with(
    spoil: Spoil,
) -> None:
    protocol = spoil("task evaluate 50 raising")
    with pytest.raises(PluginError, match=r"in evaluate\(\)"):
        run_fast(protocol)
    # The crane resets itself once when it is opened.
    (protocol.parent / "plugins" / "order.txt").write_text("dynamics reset 2 raising")
    study = load(protocol, discover(study=protocol))
    visit = Visit(
        study, "P001", 1, protocol.parent / "data", simulated=True, fast=True, resumed=True
    )
    with pytest.raises(PluginError, match=r"^dynamics .* in reset\(\) .* raised ValueError"):
        run(visit, ScriptedConsole())
    run_again(protocol)


NONSENSE = {
    ("input", "read", "nan"): "returned left.y nan in tick 49",
    ("input", "read", "short"): "returned shape (11,), but its signals need (12,) in tick 49",
    ("input", "read", "nothing"): "returned NoneType, not an array of float64 in tick 49",
    ("scheme", "command", "nan"): "returned command.shoulder nan in tick",
    ("scheme", "command", "short"): "returned shape (",
    ("dynamics", "state", "nan"): "returned joint.angle.shoulder nan in tick",
    ("dynamics", "step", "nan"): "returned joint.angle.shoulder nan in tick 49",
    ("dynamics", "step", "short"): "returned shape (13,), but its signals need (14,) in tick 49",
    (
        "task",
        "evaluate",
        "judged_short",
    ): "returned shape (6,), but its signals need (7,) in tick",
    ("task", "evaluate", "nothing"): "returned None in tick",
}


@pytest.mark.parametrize(("role", "method", "how"), NONSENSE)
def test_nonsense_is_refused_before_it_is_recorded(
    role: str, method: str, how: str, spoil: Spoil
) -> None:
    protocol = spoil(f"{role} {method} 50 {how}")
    with pytest.raises(PluginError) as caught:
        run_fast(protocol)
    said = str(caught.value)
    source = protocol.parent / "plugins" / "faulty.py"
    where = f"in {method}() ({source}:{line_of('def bad')})"
    assert said.startswith(f"{role} 'faulty_{role}' of plugin 'plugins/faulty.py', {where}, ")
    assert NONSENSE[role, method, how] in said
    session = recorded(protocol)
    assert session is not None
    for name in ("input", "command", "state"):
        assert np.isfinite(session.streams[name].data.to_numpy()).all()


def test_an_exporter_that_raises_is_named_with_its_line(
    spoil: Spoil,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    from labcrane_xdf.merged import MergedXdf

    def export(self, participants, folder):
        raise KeyError("no such stream")

    run_fast(spoil("nobody nothing 1 raising"))
    monkeypatch.setattr(MergedXdf, "export", export)
    arguments = ["--to", "xdf", "--include", "simulated", "--out", str(tmp_path / "out")]
    assert main(["export", str(tmp_path / "data"), *arguments]) == 1
    said = capsys.readouterr().err
    assert "exporter 'xdf' of plugin 'xdf'" in said
    assert re.search(r"raised KeyError: 'no such stream' \(.*test_plugins\.py:\d+\)", said)
