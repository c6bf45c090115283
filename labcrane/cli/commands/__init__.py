"""The commands, one module for each group of them.

In come arguments that typer has parsed; each command imports what it needs when it runs.
"""
