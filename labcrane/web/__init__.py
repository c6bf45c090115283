"""The pages of examiner and participant, served by a process of their own.

In come the session's events and streams; out go pages, and commands that pass through the launcher.
Nothing here touches the loop.
"""
