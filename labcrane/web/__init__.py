"""The pages of experimenter and participant, and of a recording, each served by its own process.

In come the session's events and streams; out go pages, and commands that pass through the launcher.
Nothing here touches the loop.
"""
