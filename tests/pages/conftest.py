"""One browser for all tests of the pages: starting one takes longer than what most of them do."""

from collections.abc import Iterator

import pytest
from pages.room import a_browser
from selenium import webdriver


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    with a_browser(tmp_path_factory.mktemp("profile")) as browser:
        yield browser
