"""Viewer: a recorded session on a page, from its participant file alone.

In comes a participant file, read a piece at a time; out go poses, traces and a time line that a
browser shows. Nothing is written.
"""

__all__: list[str] = []
