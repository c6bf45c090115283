"""Settings of the pages: where they are served."""

from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from labcrane.core.settings import Settings

Language = Literal["en", "de"]


class PageSettings(Settings):
    """Of the supervisor's and the participant's page."""

    host: str = "127.0.0.1"
    """Address at which they are served: this computer only by default. An address of the lab's
    network, ``192.168.1.20``, opens them to its tablets; whoever has no token is refused."""

    port: int = Field(default=0, ge=0, le=65535)
    """Port; 0 takes a free one."""

    certificate: Path | None = None
    """The lab's certificate in PEM, with which the pages are served over TLS; a path counts from
    the protocol. Without it, whoever listens on the lab's network can read along."""

    key: Path | None = None
    """The certificate's private key in PEM, without a passphrase."""

    language: Language = "en"
    """In which the participant's page speaks; questionnaires have languages of their own."""

    @model_validator(mode="after")
    def _both_or_none(self) -> Self:
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate and key belong together: give both, or none")
        return self
