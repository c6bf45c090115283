"""Films of a session, read again: cameras, microphones and screens.

In come a participant file and the files next to it; out go pictures, sound and levels at a time.
"""
