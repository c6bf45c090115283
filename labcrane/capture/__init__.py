"""Capture of cameras, microphones and screens: a process for each, which writes its files.

In come a visit and its protocol's recordings; out go files of frames, and a stream that lists them.
"""
