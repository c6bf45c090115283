"""The commands, one module for each group of them.

Input: arguments that typer has parsed. Each command imports what it needs when it runs.
"""
