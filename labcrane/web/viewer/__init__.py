"""Viewer: a recorded session on a page, from its participant file alone."""

__all__: list[str] = []
