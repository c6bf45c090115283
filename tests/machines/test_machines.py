"""Machine files: those that come with labcrane, and what is said of wrong ones."""

import math
from pathlib import Path

import numpy as np
import pytest

from labcrane import ProtocolError
from labcrane.machines import load_machine
from labcrane.machines.library import machine_names

GOOD = """\
title: Digger
source: a test
joints:
  - {name: slew, d: 1.5, alpha_deg: -90, range_deg: [-90, 90], speed_deg_s: 20, mass_kg: 9, effort: 9}
  - name: boom
    a: 3.0
    range_deg: [-60, 60]
    speed_deg_s: 10
    mass_kg: 9
    effort: 9
  - {name: stick, a: 2.0, range_deg: [-60, 60], speed_deg_s: 10, mass_kg: 9, effort: 9}
"""  # noqa: E501 - as people write them


def complaint(folder: Path, text: str) -> str:
    """Return what is said of a machine file with ``text``, with the file's name alone."""
    (folder / "digger.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(ProtocolError) as refusal:
        load_machine("digger.yaml", folder)
    return str(refusal.value).replace(f"{folder}/", "")


@pytest.mark.parametrize("name", ["ch8", "ch8_cranelike"])
def test_the_links_of_ch8_add_up_to_the_length_in_the_study(name: str) -> None:
    joints = load_machine(name).joints
    assert joints[0].d + sum(joint.a for joint in joints) == pytest.approx(10.19, abs=1e-9)


@pytest.mark.parametrize("name", ["ch8", "ch8_cranelike"])
def test_the_joints_of_ch8_have_the_ranges_in_the_study(name: str) -> None:
    lowest, highest = np.degrees(load_machine(name).limits).T
    np.testing.assert_allclose(highest - lowest, (342.0, 172.0, 172.0, 172.0), rtol=1e-12)


def test_ch8_has_the_rebuilt_link_set() -> None:
    machine = load_machine("ch8")
    assert machine.names == ("slew", "shoulder", "elbow", "wrist")
    assert machine.base_x == 0.2677
    assert [joint.a for joint in machine.joints] == [0.0, 2.9055, 2.7665, 2.8112]
    tilt = math.atan2(0.128, 0.024)
    offsets = [joint.offset for joint in machine.joints]
    np.testing.assert_allclose(offsets, (0.0, -tilt, tilt, 0.0), atol=1e-8)


def test_ch8_cranelike_has_the_rebuilt_link_set() -> None:
    machine = load_machine("ch8_cranelike")
    assert [joint.a for joint in machine.joints] == [0.0, 4.10, 3.30, 1.09]
    assert machine.joints[0].d == 1.70


def test_every_bundled_machine_can_be_read() -> None:
    assert machine_names() == ["ch8", "ch8_cranelike"]
    for name in machine_names():
        machine = load_machine(name)
        for rest, (lowest, highest) in zip(machine.rest, machine.limits, strict=True):
            assert lowest <= rest <= highest


def test_a_machine_beside_the_study_is_read_in_degrees_and_gives_radians(tmp_path: Path) -> None:
    (tmp_path / "digger.yaml").write_text(GOOD, encoding="utf-8")
    machine = load_machine("digger.yaml", tmp_path)
    assert machine.names == ("slew", "boom", "stick")
    assert machine.speeds[0] == pytest.approx(math.pi / 9)
    assert machine.limits[1] == pytest.approx((-math.pi / 3, math.pi / 3))


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        (
            "    range_deg:",
            "    rang_deg:",
            "digger.yaml:7:5: 'rang_deg' is not a key of joints[2]; did you mean 'range_deg'?\n"
            "digger.yaml:7:5: joints[2] needs 'range_deg'; did you write it as 'rang_deg'?",
        ),
        (
            "    range_deg: [-60, 60]",
            "    range_deg: [60, -60]",
            "digger.yaml:5:5: joints[2]: range_deg must rise, but is 60.0 to -60.0 "
            "degrees; write the lowest first",
        ),
        (
            "    effort: 9",
            "    effort: 9\n    inertia_kgm2: [1, 1, 2.1, 0, 0, 0]",
            "digger.yaml:5:5: joints[2]: link 'boom' has the principal moments of inertia 1, 1 "
            "and 2.1 kg m²; no body has one that is larger than the sum of the others; correct "
            "inertia_kgm2",
        ),
        (
            "    effort: 9",
            "    effort: 9\n    rest_deg: 61",
            "digger.yaml:5:5: joints[2]: rest_deg 61 is outside the joint's range; it must "
            "be -60 to 60",
        ),
        (
            "name: stick",
            "name: boom",
            "digger.yaml:1:1: the file: joints are called slew, boom, boom; give each a name "
            "of its own",
        ),
        (
            "alpha_deg: -90",
            "alpha_deg: 90",
            "digger.yaml:1:1: the file: the first joint slews: it needs alpha_deg -90",
        ),
        (
            "    a: 3.0",
            "    a: 3.0\n    d: 0.1",
            "digger.yaml:1:1: the file: joint 'boom' pitches: it needs alpha_deg 0 and d 0",
        ),
        (
            GOOD[GOOD.index("  - {name: stick") :],
            "",
            "digger.yaml:1:1: the file: a machine needs 3 joints or more, but has 2",
        ),
        (
            "    mass_kg: 9",
            "    mass_kg: .inf",
            "digger.yaml:9:14: joints[2].mass_kg is .inf; it must be a finite number: neither "
            ".nan nor .inf",
        ),
    ],
)
def test_a_mistake_is_told_with_its_line_and_what_is_possible(
    tmp_path: Path, right: str, wrong: str, said: str
) -> None:
    assert GOOD.count(right) == 1
    assert complaint(tmp_path, GOOD.replace(right, wrong)) == said


def test_a_machine_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ProtocolError, match=r"digger\.yaml' does not exist"):
        load_machine("digger.yaml", tmp_path)
