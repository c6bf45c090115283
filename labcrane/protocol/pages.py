"""Settings of the pages: where they are served."""

from typing import Literal

from pydantic import Field

from labcrane.core.settings import Settings

Language = Literal["en", "de"]


class PageSettings(Settings):
    """Of the supervisor's and the participant's page."""

    host: str = "127.0.0.1"
    """Address at which they are served: this computer only by default. An address of the lab's
    network, ``192.168.1.20``, opens them to its tablets; whoever has no token is refused."""

    port: int = Field(default=0, ge=0, le=65535)
    """Port; 0 takes a free one."""

    language: Language = "en"
    """In which the participant's page speaks; questionnaires have languages of their own."""
