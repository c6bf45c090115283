"""A whole data set, session by session."""

from collections import Counter
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from labcrane import Machine
from labcrane.analysis import Exporter, Participant, answers_of, eeg_streams
from labcrane.recording import SessionRecord
from labcrane_bids.dataset import (
    copy_phenotype,
    describe_dataset,
    describe_participants,
    people_table,
)
from labcrane_bids.eeg import eeg_description, write_eeg
from labcrane_bids.events import event_description, event_table, screen_of
from labcrane_bids.files import (
    EntityLabels,
    first_tick,
    label,
    write_bare_tsv,
    write_json,
    write_tsv,
)
from labcrane_bids.motion import TrackingSystem, tracking_systems
from labcrane_bids.phenotype import Phenotype, demographics_of
from labcrane_bids.physio import continuous_recordings
from labcrane_bids.settings import BidsSettings

FIRST_DAY = datetime(1925, 1, 1, tzinfo=UTC)
PERSON = ("age", "sex", "handedness", "group")


class Bids(Exporter):
    """Motion with one tracking system per device, EEG, eye tracking, physio, events, phenotype.

    EEG is written as BrainVision files, with the samples as recorded. Each event is at the sample
    that was taken at the same time, by the corrected clock. A questionnaire that a participant
    answered more than once is in ``beh`` with its trials. Missing samples are rows without a value,
    so that start and rate give the time of every row. BIDS has no place for streams of texts, or of
    numbers without a steady rate: the README lists what is left out, and why.
    """

    shared = (
        "dataset_description.json",
        "README",
        "participants.json",
        "phenotype/*.json",
        "task-*_beh.json",
    )

    def __init__(self, settings: BidsSettings, machine: Machine) -> None:
        self._settings = settings
        self._machine = machine
        self._without: Counter[tuple[str, str]] = Counter()
        self._labels = EntityLabels()

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        rows, contexts = [], []
        known = people_table(self._settings.people)
        phenotype = Phenotype()
        for participant in participants:
            context = participant.context
            contexts.append(context)
            subject = f"sub-{label(participant.name)}"
            answers = answers_of(participant)
            phenotype.add(subject, participant, answers)
            told = known.get(participant.name, {})
            rows.append(
                {"participant_id": subject}
                | dict.fromkeys(PERSON)
                | demographics_of(answers)
                | {"group": _group(participant)}
                | {name: cell for name, cell in told.items() if name in PERSON}
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
        describe_dataset(folder, self._settings, contexts, self._without)
        describe_participants(folder, rows)
        copy_phenotype(self._settings.phenotype, folder, phenotype.write(folder))

    def _session(self, at: Path, stem: str, session: SessionRecord, started: datetime) -> None:
        import pandas as pd

        (at / "motion").mkdir(parents=True)
        context = session.context
        task = label(str(context.get("session_name", ""))) or "crane"
        named = f"{stem}_task-{task}"
        zero = first_tick(session)
        scans = []
        for system in tracking_systems(session, self._settings.every):
            path = at / "motion" / f"{named}_tracksys-{system.label}_motion"
            self._motion(path, system, session, task)
            scans.append((f"motion/{path.name}.tsv", 0.0))
        events = event_table(session)
        write_tsv(at / "motion" / f"{named}_events.tsv", events)
        about = event_description(events, context, screen_of(session))
        write_json(at / "motion" / f"{named}_events.json", about)
        streams = [stream for stream in eeg_streams(session) if len(stream) > 1]
        for stream in eeg_streams(session):
            if stream not in streams:
                self._without[stream.name, "no rate: fewer than two samples"] += 1
        for stream in streams:
            which = f"_acq-{self._labels(stream.name)}" if len(streams) > 1 else ""
            path = at / "eeg" / f"{named}{which}_eeg"
            signal = write_eeg(path, stream, session, events, task, self._settings)
            write_json(path.with_name(f"{named}{which}_events.json"), eeg_description(about))
            scans.append((f"eeg/{path.name}.vhdr", float(signal.time[0] - zero)))
        recordings = continuous_recordings(session, self._settings, self._labels, self._without)
        for recording, samples, description in recordings:
            (at / "beh").mkdir(exist_ok=True)
            path = at / "beh" / f"{named}_recording-{recording}_physio"
            write_bare_tsv(path.with_name(f"{path.name}.tsv.gz"), samples)
            write_json(path.with_name(f"{path.name}.json"), description)
            if description["PhysioType"] == "eyetrack":  # which also needs events and screen
                write_tsv(at / "beh" / f"{named}_events.tsv", events)
                write_json(at / "beh" / f"{named}_events.json", about)
            scans.append((f"beh/{path.name}.tsv.gz", 0.0))
        when = [
            (started.astimezone(UTC) + timedelta(seconds=later)).strftime("%Y-%m-%dT%H:%M:%S.%fZ")
            for _, later in scans
        ]
        table = pd.DataFrame({"filename": [name for name, _ in scans], "acq_time": when})
        write_tsv(at / f"{stem}_scans.tsv", table)

    def _motion(
        self, path: Path, system: TrackingSystem, session: SessionRecord, task: str
    ) -> None:
        write_bare_tsv(path.with_name(f"{path.name}.tsv"), system.samples())
        channels = path.with_name(f"{path.name.removesuffix('_motion')}_channels.tsv")
        write_tsv(channels, system.channels)
        rate_hz = float(session.attrs["rate_hz"]) / self._settings.every
        seconds = system.seconds
        about: dict[str, Any] = {
            "TaskName": task,
            "TaskDescription": str(session.context.get("title", "")),
            "SamplingFrequency": rate_hz,
            "SamplingFrequencyEffective": (
                (system.count - 1) / seconds if seconds > 0.0 else rate_hz
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


def _group(participant: Participant) -> str | None:
    """Return the group of the design that a participant is in, as recorded."""
    return str(participant.context.get("group") or "") or None


def _counts(system: TrackingSystem) -> dict[str, int]:
    found = system.channels["type"].value_counts()
    kinds = ["POS", "VEL", "ACCEL", "ORNT", "JNTANG", "ANGACCEL", "GYRO", "MAGN", "LATENCY", "MISC"]
    return {f"{kind}ChannelCount": int(found.get(kind, 0)) for kind in kinds}
