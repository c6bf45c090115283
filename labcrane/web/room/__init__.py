"""Room: the supervisor's control room, from what a session says to what a browser shows."""

__all__: list[str] = []
