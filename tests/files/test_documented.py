"""What is written in YAML describes itself."""

import sys

import pytest
from programs import ran
from pydantic import Field, ValidationError

from labcrane.files.model import StrictModel


class Link(StrictModel):
    """A link."""

    length: float
    """Length,
    in metres."""

    mass: float = Field(default=1.0, description="In its own words.")
    """In the docstring's words."""

    colour: str = "red"


class Chain(Link):
    """A chain of links."""

    links: tuple[Link, ...] = ()
    """What it consists of."""

    end: Link | None = None
    """What is at its end."""

    colour: str = "blue"
    """Which colour it has."""

    def length_of(self) -> float:
        """Return what is no key."""
        return self.length


def test_a_schema_describes_every_key_with_the_docstring_under_it() -> None:
    keys = Chain.model_json_schema()["properties"]
    assert {key: said.get("description") for key, said in keys.items()} == {
        "length": "Length,\nin metres.",
        "mass": "In its own words.",
        "colour": "Which colour it has.",
        "links": "What it consists of.",
        "end": "What is at its end.",
    }


def test_models_inside_a_model_are_described_as_well() -> None:
    inside = Chain.model_json_schema()["$defs"]["Link"]["properties"]
    assert inside["length"]["description"] == "Length,\nin metres."
    assert "description" not in inside["colour"]


def test_a_model_whose_source_is_nowhere_has_a_schema_without_words() -> None:
    program = (
        "from labcrane.files.model import StrictModel\n"
        "class Typed(StrictModel):\n"
        "    length: float\n"
        "    'In metres.'\n"
        "print(Typed.model_json_schema()['properties'])\n"
    )
    done = ran([sys.executable, "-c", program], check=True)
    assert done.stdout.strip() == "{'length': {'title': 'Length', 'type': 'number'}}"


@pytest.mark.parametrize("written", [{"length": 1.0, "lenght": 2.0}, {"length": float("inf")}])
def test_unknown_keys_and_numbers_that_are_none_are_refused(written: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        Link.model_validate(written)


def test_what_was_read_never_changes() -> None:
    link = Link(length=1.0)
    with pytest.raises(ValidationError, match="frozen"):
        link.length = 2.0
