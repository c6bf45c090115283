"""A whole data set, session by session."""

from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from labcrane import Machine
from labcrane.analysis import Exporter, Participant
from labcrane.recording import SessionRecord
from labcrane_bids.dataset import (
    copy_phenotype,
    describe_dataset,
    describe_participants,
    people_table,
)
from labcrane_bids.events import event_description, event_table
from labcrane_bids.eyes import eye_recordings
from labcrane_bids.files import label, write_bare_tsv, write_json, write_tsv
from labcrane_bids.motion import TrackingSystem, tracking_systems
from labcrane_bids.phenotype import Phenotype
from labcrane_bids.settings import BidsSettings

FIRST_DAY = datetime(1925, 1, 1, tzinfo=UTC)
PERSON = ("age", "sex", "handedness", "group")


class Bids(Exporter):
    """Motion with one tracking system per device, events, eye tracking and phenotype.

    Streams of others that are no gaze, as EEG, are not written: mne-bids does that from the XDF
    export.
    """

    shared = ("dataset_description.json", "README", "participants.json", "phenotype/*.json")

    def __init__(self, settings: BidsSettings, machine: Machine) -> None:
        self._settings = settings
        self._machine = machine

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        rows, contexts = [], []
        known = people_table(self._settings.people)
        phenotype = Phenotype()
        for participant in participants:
            context = participant.context
            contexts.append(context)
            subject = f"sub-{label(participant.name)}"
            phenotype.add(subject, participant)
            rows.append(
                {"participant_id": subject}
                | {name: known.get(participant.name, {}).get(name) for name in PERSON}
                | {"status": str(participant.status)}
            )
            shift = None
            for number, session in participant.sessions():
                started = datetime.fromisoformat(str(session.attrs["started"]))
                if shift is None:
                    shift = started.date() - FIRST_DAY.date()
                moved = started - shift if self._settings.shift_dates else started
                at = folder / subject / f"ses-{number:02}"
                stem = f"{subject}_ses-{number:02}"
                self._session(at, stem, session, moved)
        describe_dataset(folder, self._settings, contexts)
        describe_participants(folder, rows)
        copy_phenotype(self._settings.phenotype, folder, phenotype.write(folder))

    def _session(self, at: Path, stem: str, session: SessionRecord, started: datetime) -> None:
        import pandas as pd

        (at / "motion").mkdir(parents=True)
        context = session.context
        task = label(str(context.get("session_name", "")) or "crane")
        named = f"{stem}_task-{task}"
        scans = []
        for system in tracking_systems(session, self._settings.every):
            path = at / "motion" / f"{named}_tracksys-{system.label}_motion"
            self._motion(path, system, session, task)
            scans.append(f"motion/{path.name}.tsv")
        events = event_table(session)
        write_tsv(at / "motion" / f"{named}_events.tsv", events)
        about = event_description(events, context)
        write_json(at / "motion" / f"{named}_events.json", about)
        for eye, samples, description in eye_recordings(session):
            (at / "beh").mkdir(exist_ok=True)
            path = at / "beh" / f"{named}_recording-{eye}_physio"
            write_bare_tsv(path.with_name(f"{path.name}.tsv.gz"), samples)
            write_json(path.with_name(f"{path.name}.json"), description)
            scans.append(f"beh/{path.name}.tsv.gz")
        when = started.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ")
        table = pd.DataFrame({"filename": scans, "acq_time": when})
        write_tsv(at / f"{stem}_scans.tsv", table)

    def _motion(
        self, path: Path, system: TrackingSystem, session: SessionRecord, task: str
    ) -> None:
        write_bare_tsv(path.with_name(f"{path.name}.tsv"), system.samples)
        channels = path.with_name(f"{path.name.removesuffix('_motion')}_channels.tsv")
        write_tsv(channels, system.channels)
        rate_hz = float(session.attrs["rate_hz"]) / self._settings.every
        seconds = float(system.samples["latency"].iloc[-1]) if len(system.samples) else 0.0
        about: dict[str, Any] = {
            "TaskName": task,
            "TaskDescription": str(session.context.get("title", "")),
            "SamplingFrequency": rate_hz,
            "SamplingFrequencyEffective": (
                (len(system.samples) - 1) / seconds if seconds > 0.0 else rate_hz
            ),
            "TrackingSystemName": system.label,
            "DeviceSerialNumber": "n/a",
            "Manufacturer": "labcrane",
            "ManufacturersModelName": self._machine.title,
            "SoftwareVersions": str(session.context.get("versions", {}).get("labcrane", "n/a")),
            "RecordingDuration": seconds,
            "RecordingType": "continuous",
            "MotionChannelCount": len(system.channels),
            "TrackedPointsCount": system.channels["tracked_point"].nunique(),
            **_counts(system),
            "SpatialAxes": "FLU" if system.label == "crane" else "n/a",
            "MissingValues": "n/a",
            "SubjectArtefactDescription": "n/a",
            "Description": system.description,
        }
        write_json(path.with_name(f"{path.name}.json"), about)


def _counts(system: TrackingSystem) -> dict[str, int]:
    found = system.channels["type"].value_counts()
    kinds = ["POS", "VEL", "ACCEL", "ORNT", "JNTANG", "ANGACCEL", "GYRO", "MAGN", "LATENCY", "MISC"]
    return {f"{kind}ChannelCount": int(found.get(kind, 0)) for kind in kinds}
