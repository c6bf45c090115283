"""Latin and Williams squares: each row is one participant's order of ``0 .. n-1``."""

Square = tuple[tuple[int, ...], ...]


def latin_square(n: int) -> Square:
    """Return the cyclic square: every item once in every row and in every position."""
    return tuple(tuple((row + column) % n for column in range(n)) for row in range(n))


def williams(n: int) -> Square:
    """Return a square in which every item also follows every other one equally often.

    For even ``n`` there are ``n`` rows and each ordered pair of neighbours occurs once; for odd
    ``n`` the reversed rows are added, ``2 n`` in all, and each pair occurs twice (Williams 1949,
    Australian Journal of Scientific Research A 2, 149; first row after Bradley 1958, JASA 53, 525).
    """
    first = [(step + 1) // 2 if step % 2 else (n - step // 2) % n for step in range(n)]
    rows = tuple(tuple((item + row) % n for item in first) for row in range(n))
    return rows if n % 2 == 0 else rows + tuple(row[::-1] for row in rows)
