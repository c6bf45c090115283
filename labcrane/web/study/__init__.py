"""Study's page: who has been and who is due, and how good what was recorded is.

In comes a data folder and the protocol next to it; out goes a page of the whole study, from which
each session's viewer and report are reached. Nothing is written.
"""

__all__: list[str] = []
