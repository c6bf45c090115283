"""Opening of a recording to be looked at: as far as it goes, also after a kill or with damage.

Nothing is written next to the recording: the content of its journals is assembled elsewhere.
"""

import shutil
from collections.abc import Callable
from pathlib import Path

from labcrane.errors import RecordingError
from labcrane.recording.participant_file.reader import Recording, SessionRecord, open_recording
from labcrane.recording.participant_file.recover import backlog, recover
from labcrane.recording.participant_file.writer import DAMAGED
from labcrane.recording.paths import participant_path
from labcrane.session.postprocess import conclude


def opened(path: Path, session: int, scratch: Path, say: Callable[[str], None]) -> SessionRecord:
    """Return a session of a participant file, or of the journals next to it if the file has none.

    Parameters
    ----------
    path
        A participant file, or the participant's folder.
    scratch
        Where journals are put together; it is to stay for as long as the session is looked at.
    say
        Told when it is not the participant file that is shown, and why.

    Raises
    ------
    RecordingError
        Neither can be read.
    """
    file = participant_path(path) if path.is_dir() else path
    try:
        why = backlog(file).get(session, "") if file.is_file() else ""
        if not why:
            return open_recording(file).session(session)
    except (RecordingError, *DAMAGED) as error:
        if not any(file.parent.glob(f"ses-{session:02d}_*.xdf")):
            raise
        why = str(error).partition("\n")[0]
    journals = sorted(file.parent.glob(f"ses-{session:02d}_*.xdf"))
    folder = scratch / file.stem
    folder.mkdir(parents=True, exist_ok=True)
    for journal in journals:
        shutil.copyfile(journal, folder / journal.name)
    say(f"{file.name} does not give session {session} ({why}); its journals are shown instead")
    for done in recover(folder, conclude):
        if done.session == session and done.problem:
            raise RecordingError(f"neither {file} nor its journals can be read: {done.problem}")
    return Recording(participant_path(folder)).session(session)
