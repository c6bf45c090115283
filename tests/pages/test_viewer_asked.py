"""What a page asks the viewer, put together by hand: nothing of it raises in the page's process."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

ASKED: list[Any] = [
    None,
    3,
    "key",
    [],
    {},
    {"key": 1, "ident": "x", "kind": "second"},
    {"key": 1, "ident": 1e400, "kind": "second", "t": 0},
    {"key": 1, "ident": 1, "kind": "second"},
    {"key": 1, "ident": 1, "kind": "second", "t": float("nan")},
    {"key": 1, "ident": 1, "kind": "second", "t": [1]},
    {"key": 1, "ident": 1, "kind": "__class__", "t": 1.0},
    {"key": 1, "ident": 1, "kind": ["second"], "t": 1.0},
]


@pytest.mark.parametrize("asked", ASKED, ids=str)
def test_what_no_page_of_ours_asks_is_left_unanswered(asked: Any) -> None:
    from labcrane.web.viewer import element

    (kind,) = (
        each for each in vars(element).values() if isinstance(each, type) and "_asked" in vars(each)
    )
    shown: list[float] = []
    viewer = kind.__new__(kind)
    vars(viewer).update(
        _show=lambda second: shown.append(second) or "",
        _answers={"second": lambda asked: {}},
        _given={},
    )
    asyncio.run(viewer._asked(SimpleNamespace(args=asked)))
    assert shown == []
    assert viewer._given == {}
