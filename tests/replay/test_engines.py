"""Engines on the same input: what the comparison says is what the engines did."""

from pathlib import Path

import numpy as np
import pytest
from needs import needs
from rehearsal import SHORT

from labcrane import ProtocolError
from labcrane.cli.app import main
from labcrane.replay.engines import Comparison, Driven, as_html, as_markdown, compare_engines


@pytest.fixture
def protocol(tmp_path: Path) -> Path:
    path = tmp_path / "study.yaml"
    path.write_text(SHORT, encoding="utf-8")
    return path


@pytest.mark.slow
def test_an_engine_beside_itself_differs_by_nothing(protocol: Path) -> None:
    done = compare_engines(protocol, ["kinematic_crane", "kinematic_crane"])
    one, other = done.driven
    assert len(one.state) > 400
    assert all(gap.largest == 0.0 for gap in done.gaps(one, other))


@pytest.mark.slow
@needs("mujoco")
def test_the_law_and_mujoco_get_the_same_input_and_end_their_trials_together(
    protocol: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = "kinematic_crane,mujoco_crane"
    assert main(["compare-engines", str(protocol), "--engines", names, "--out", str(tmp_path)]) == 0
    assert "engines.html" in capsys.readouterr().out
    page = (tmp_path / "engines.md").read_text(encoding="utf-8")
    assert "All trials ended in the same tick with the same outcome." in page
    (row,) = (line for line in page.splitlines() if line.startswith("| joint.angle.slew |"))
    _, _, unit, largest, _, span, _ = (cell.strip() for cell in row.split("|"))
    assert unit == "°"
    assert float(largest) < np.degrees(1e-9) < 1.0 < float(span)
    html = (tmp_path / "engines.html").read_text(encoding="utf-8")
    assert f"<td>{largest}</td>" in html


def test_differences_are_told_in_the_units_that_people_read() -> None:
    import pandas as pd

    units = {"joint.angle.slew": "rad", "tip.position.x": "m", "load.slew": "1"}
    was = pd.DataFrame({"joint.angle.slew": [0.0, 1.0], "tip.position.x": [0.0, 0.0]})
    now = pd.DataFrame({"joint.angle.slew": [0.0, 1.0 + np.pi / 180], "tip.position.x": [0.003, 0]})
    one = Driven("one", was.assign(**{"load.slew": 0.5}), ((7, "success"),), 0.1, 0.2)
    other = Driven("other", now, ((8, "success"),), 0.1, 0.2)
    done = Comparison("a <study>", "0" * 64, 240.0, units, (one, other))
    angle, tip = done.gaps(one, other)
    assert (angle.unit, tip.unit) == ("°", "mm")
    assert angle.largest == pytest.approx(1.0)
    assert angle.rms == pytest.approx(np.sqrt(0.5))
    assert tip.largest == pytest.approx(3.0)
    assert "did not all end in the same tick" in as_markdown(done)
    assert "a &lt;study&gt;" in as_html(done)


def test_one_engine_alone_is_compared_with_nothing(protocol: Path) -> None:
    with pytest.raises(ProtocolError, match="needs two engines; bullet_crane was named"):
        compare_engines(protocol, ["bullet_crane"])
    with pytest.raises(ProtocolError, match="'bulet_crane' is not installed; did you mean"):
        compare_engines(protocol, ["bulet_crane", "kinematic_crane"])
