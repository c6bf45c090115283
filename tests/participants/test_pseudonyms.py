"""Names for participants who are yet to come."""

import re

import pytest

from labcrane import ProtocolError
from labcrane.files.pseudonyms import pseudonyms


@pytest.mark.parametrize("pattern", ["P[0-9]{3}", r"P-\d{3}", r"VP\d+", r"S_[0-9]{2}", "[0-9]{4}"])
def test_names_match_the_pattern(pattern: str) -> None:
    names = pseudonyms(pattern, 20)
    assert len(set(names)) == 20
    assert all(re.fullmatch(pattern, name) for name in names)


@pytest.mark.parametrize("pattern", [r"[A-Z]{2}-\d{2}", r"P\d{2}-[ab]", r"P[1-3]"])
def test_a_pattern_that_gives_no_names_is_told_one_that_does(pattern: str) -> None:
    with pytest.raises(ProtocolError, match="no 20 names of letters and a number") as refused:
        pseudonyms(pattern, 20)
    (advised,) = re.findall(r"as in '([^']+)'", str(refused.value))
    assert pseudonyms(advised, 20)[0] == "P001"
