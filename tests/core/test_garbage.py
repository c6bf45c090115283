"""Garbage is looked for where a simulated study leaves it, and nowhere while a session runs."""

import gc
import weakref

import pytest
from left_out import as_in_a_program

from labcrane.core.garbage import cleared, settled


@pytest.fixture(autouse=True)
def alone():
    with as_in_a_program():
        yield


class Ring:
    """An object that holds itself."""

    def __init__(self) -> None:
        self.ring = self


def test_what_holds_itself_is_gone_when_the_part_that_made_it_ends() -> None:
    gc.disable()
    try:
        with cleared():
            made = weakref.ref(Ring())
            assert made() is not None
        assert made() is None
    finally:
        gc.enable()


def test_what_was_there_before_is_not_looked_through() -> None:
    gc.disable()
    try:
        before = weakref.ref(Ring())
        with cleared():
            pass
        assert before() is not None
        gc.collect()
        assert before() is None
    finally:
        gc.enable()


def test_a_part_within_another_leaves_the_others_things_out_until_its_end() -> None:
    before = weakref.ref(Ring())
    with settled():
        with settled():
            pass
        with pytest.raises(ValueError, match="it fails"), settled():
            raise ValueError("it fails")
        with cleared():
            made = weakref.ref(Ring())
        assert made() is None
        assert before() is not None
    gc.collect()
    assert before() is None
