"""LSL: what labcrane sends, what it receives, and how right the time stamps are.

``network`` says where streams travel, ``outlets`` sends the session, ``inlet`` and ``recorder``
receive the streams of others, ``correction`` maps their time stamps onto this computer's clock, and
``sync_report`` says how well that went.

Nothing here imports pylsl before it is used: liblsl reads its configuration when it is loaded.
"""
