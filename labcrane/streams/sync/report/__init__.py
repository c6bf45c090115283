"""The report on time stamps: how right they are, and what to do where they are not.

In come a session's corrected streams and the limits of its study; out go findings in words.
"""
