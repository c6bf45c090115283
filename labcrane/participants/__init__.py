"""The participants: register, consent, deviations, erasure, relabelling, transfer.

In come pseudonyms, never names; out go entries that outlive a crash, and proof of what was erased.
"""
