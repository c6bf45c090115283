"""Who takes part, and what becomes of their data.

From the bottom up::

    places       where personal data, raw data and exports lie
    register     pseudonyms, slots, sessions, consent, exclusions, exports, stores
    enrolment    into the register: slot, consent, exclusion, notes
    visits       when a session may be run, and what is kept of it
    deviations   what did not go as the protocol says
    copies       exports and the lab's store
    unfinished   what a kill interrupted is finished by the next call
    erasure, relabel, transfer

No names: the key that links persons to pseudonyms is not kept by labcrane.
"""
