"""Settings that a protocol gives the monitors of signals, which are facts of the laboratory."""

from typing import Any

from labcrane.recording.participant_file.reader import SessionRecord


def monitor_setting(session: SessionRecord, name: str) -> Any:
    """Return the first value of a setting among a session's monitors; None without one."""
    parts = session.context.get("components", {}).items()
    monitors = (
        choice.get("settings", {}) for part, choice in parts if part.startswith("monitors.")
    )
    stated = (settings.get(name) for settings in monitors)
    return next((value for value in stated if value is not None), None)
