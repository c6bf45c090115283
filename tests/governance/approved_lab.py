"""A study as it was approved, and what is refused once it has drifted."""

from pathlib import Path

from governed import Lab

from labcrane import ProtocolError
from labcrane.session.eligibility import check_eligibility

MACHINE = (Path(__file__).parents[2] / "labcrane" / "machines" / "data" / "ch8.yaml").read_text(
    encoding="utf-8"
)


def approved_lab(folder: Path) -> Lab:
    """Return a study that names files of all kinds, approved, with P001's consent."""
    lab = Lab(folder)
    (folder / "mine.yaml").write_text(MACHINE, encoding="utf-8")
    (folder / "hello.md").write_text("Hello.\nPlease hold both sticks.\n", encoding="utf-8")
    lab.protocol.write_text(
        lab.text.replace("machine: ch8", "machine: mine.yaml").replace(
            "steps:", "steps:\n      - consent\n      - instructions: hello.md"
        ),
        encoding="utf-8",
    )
    lab.approve()
    lab.consent("P001")
    return lab


def refusal(lab: Lab) -> list[str]:
    """Return the differences for which P001 is refused; nothing when P001 may be run."""
    try:
        check_eligibility(lab.visit("P001"))
    except ProtocolError as error:
        first, *lines, last = str(error).splitlines()
        assert first.endswith("is not the study that was approved under 'KB-12/2026':")
        assert "labcrane amend" in last
        return [line.strip() for line in lines]
    return []
