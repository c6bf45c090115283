"""The ``labcrane`` command: the only part that prints."""
