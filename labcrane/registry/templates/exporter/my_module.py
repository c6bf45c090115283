"""my_part: recordings as files for another program."""

from collections.abc import Iterable
from pathlib import Path

from labcrane import Offer, Settings, hookimpl, offer
from labcrane.analysis import Exporter, Participant

labcrane_api = 1


class MyPartSettings(Settings):
    """Settings of my_part: ``labcrane export DATA --to my_part --set separator=;``."""

    separator: str = ","
    """Separator of two columns."""


class MyPart(Exporter):
    """One CSV file of trials for each participant."""

    def __init__(self, settings: MyPartSettings) -> None:
        self._settings = settings

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        for participant in participants:  # one at a time: there may be hundreds
            for number, session in participant.sessions():
                trials = session.trials  # a pandas table; so are session.events and the streams
                trials.insert(0, "status", str(participant.status))
                trials.insert(0, "participant", participant.name)
                path = folder / f"{participant.name}_ses-{number:02}.csv"
                trials.to_csv(path, sep=self._settings.separator, index=False)


@hookimpl
def labcrane_exporters() -> list[Offer[Exporter]]:
    return [offer("my_part", MyPartSettings, MyPart)]
