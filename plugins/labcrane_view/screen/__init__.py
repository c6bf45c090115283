"""The screen that a view is on: its monitors, its window, where that is, and the refresh rate.

In come settings of the view. Out goes a window of the engine, and how its pictures get onto glass.
"""
