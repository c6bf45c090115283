"""The views and sounds of a session: their processes, previews and delays.

In come the session's own LSL streams; out go pictures, tones, and logs of when each was presented.
"""
