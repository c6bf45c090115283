"""The views and sounds of a session: their processes, previews and delays.

Input: the session's own LSL streams. Output: pictures, tones, and logs of their presentation times.
"""
