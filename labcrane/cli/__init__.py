"""The ``labcrane`` command: the only part that prints.

In come words of the command line; out go text, tables, progress and an exit status.
"""
