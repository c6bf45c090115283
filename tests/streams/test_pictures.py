"""Pictures of cameras on their way to the supervisor's page."""

import base64
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from io import BytesIO

import matplotlib.image
import numpy as np
import pylsl
import pytest
from faults.sessions import unique, wait_for

from labcrane.core import CameraImage
from labcrane.streams.pictures import PictureOutlet
from labcrane.web.pictures import Pictures

GREYS = np.arange(60, dtype=np.uint8).reshape(6, 10)


@pytest.fixture
def source() -> str:
    return unique("pictures")


@pytest.fixture
def outlet(source: str) -> Iterator[PictureOutlet]:
    made = PictureOutlet("watch", source)
    yield made
    made.close()


Watching = Callable[[str, tuple[str, ...]], Pictures]


@pytest.fixture
def watching() -> Iterator[Watching]:
    """Return what watches cameras of the view until the test is over."""
    with ExitStack() as open_:
        yield lambda source, cameras: open_.enter_context(
            closing(Pictures(source, {"watch": cameras}))
        )


def test_pictures_are_wanted_only_while_somebody_watches(
    outlet: PictureOutlet, source: str
) -> None:
    assert not outlet.wanted
    with closing(Pictures(source, {"watch": ("depth",)})):
        wait_for(lambda: outlet.wanted)


def test_a_picture_arrives_as_it_was_with_its_age(
    outlet: PictureOutlet, source: str, watching: Watching
) -> None:
    page = watching(source, ("depth", "cab"))
    assert page.of("watch", "depth") == (None, "no picture yet")
    wait_for(lambda: outlet.wanted)
    now = pylsl.local_clock()
    made = now + 60.0  # or it would be out of date on a computer that is held up
    outlet.push({"depth": CameraImage(GREYS, now - 100.0, "white 2 m, black 14 m")}, made)
    wait_for(lambda: page.of("watch", "depth")[1] != "no picture yet")
    shot, said = page.of("watch", "depth")
    assert shot is not None
    old, _, rest = said.partition(" s old · ")
    assert 99.9 <= float(old) <= pylsl.local_clock() - now + 100.1
    assert rest == "white 2 m, black 14 m"
    head, _, coded = shot.source.partition(",")
    assert head == "data:image/png;base64"
    read = matplotlib.image.imread(BytesIO(base64.b64decode(coded)))
    np.testing.assert_array_equal(np.round(255 * read), GREYS)
    assert page.of("watch", "cab") == (None, "no picture yet")


def test_a_picture_that_is_out_of_date_is_not_shown(
    outlet: PictureOutlet, source: str, watching: Watching
) -> None:
    page = watching(source, ("depth",))
    wait_for(lambda: outlet.wanted)
    made = pylsl.local_clock() - 100.0
    outlet.push({"depth": CameraImage(GREYS, made)}, made)
    wait_for(lambda: page.of("watch", "depth")[1] != "no picture yet")
    shot, said = page.of("watch", "depth")
    assert shot is None
    age = float(said.removeprefix("no picture for ").removesuffix(" s"))
    assert 99.0 <= age <= pylsl.local_clock() - made + 1.0
