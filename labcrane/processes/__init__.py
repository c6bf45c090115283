"""Child processes, handled in one way: session, recorder, feedback, page, checks of ``doctor``.

In come a module to run and the messages for it; out go its messages and the notice of its end. A
child that stalls, crashes or hangs does not delay this process.
"""
