"""Start page: a study is made, checked, rehearsed and run in a browser, on the same YAML file.

In come a folder, the JSON Schema and what is typed or clicked; out go the study's file, changed in
one place at a time, and ``labcrane`` commands, each with its line. Nothing else imports it.
"""

__all__: list[str] = []
