"""The door of the pages: who may come in, how much and how often, before anything is read.

In come requests as they arrive; out go those that are allowed, and denials in words.
"""
