"""The ``labcrane`` command: the only part that prints.

Input: words of the command line. Output: text, tables, progress and an exit status.
"""
