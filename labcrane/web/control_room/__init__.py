"""Room: the experimenter's control room, from what a session says to what a browser shows.

In come events, frames and the state of streams; out go a lamp with its reason, bars, points and
sentences. Nothing here gives an order: that is the page's.
"""

__all__: list[str] = []
