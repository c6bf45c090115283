"""Stamping of samples: when it was done after they had been taken.

In come the stamps of a regular stream; out goes what they show of delays before they were put on.
"""
