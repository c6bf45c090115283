"""Settings of the pages: where they are served."""

import re
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from labcrane.core.settings import Settings, WrongKey, was_run

Language = Literal["en", "de", "pl", "fr", "es"]


READABLE = 4.5
"""Contrast of text and background that WCAG 2.2 requires at AA."""


def contrast_to_white(colour: str) -> float:
    """Return the contrast of white and ``#rrggbb``, 1 to 21, as WCAG 2.2 defines it."""
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in parts]  # noqa: PLR2004 - sRGB's own
    light = sum(v * weight for v, weight in zip(linear, (0.2126, 0.7152, 0.0722), strict=True))
    return 1.05 / (light + 0.05)


def unserved(certificate: Path, key: Path) -> str:
    """Return why pages cannot be served with a certificate and its key; nothing where they can."""
    import ssl  # noqa: PLC0415 - few studies have their own

    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    try:
        # Without a passphrase it would be asked for in the terminal.
        context.load_cert_chain(certificate, key, password="")
    except (OSError, ValueError) as error:  # ssl's errors are OSErrors
        return (
            f"the pages cannot be served with certificate {str(certificate)!r} and key "
            f"{str(key)!r}: {error}; give both in PEM, without a passphrase"
        )
    return ""


class PageSettings(Settings):
    """Of the experimenter's and the participant's page."""

    host: str = "127.0.0.1"
    """Address at which they are served: this computer only by default. An address of the lab's
    network, ``192.168.1.20``, opens them to its tablets; requests without a token are refused."""

    port: int = Field(default=0, ge=0, le=65535)
    """Port; 0 takes a free one."""

    certificate: Path | None = None
    """The lab's certificate in PEM, with which the pages are served over TLS; a path counts from
    the protocol. Without it, the lab's network carries the pages unencrypted."""

    key: Path | None = None
    """The certificate's private key in PEM, without a passphrase."""

    language: Language = "en"
    """Language of the participant's page; questionnaires have languages of their own."""

    one_at_a_time: bool = False
    """Whether the participant's page shows one item per screen instead of all."""

    colour: str = Field(default="#0d47a1", pattern=r"^#[0-9a-fA-F]{6}$")
    """The study's colour on the participant's page, as ``#rrggbb``: dark enough for white text on
    it (contrast 4.5 to 1)."""

    @field_validator("host")
    @classmethod
    def _is_an_address(cls, host: str, info: ValidationInfo) -> str:
        if was_run(info) or host == "127.0.0.1":
            return host
        if re.fullmatch(r"[\d.]+", host) or not re.fullmatch(
            r"[\w.-]+", host
        ):  # of names nothing more is said
            from ipaddress import ip_address  # noqa: PLC0415 - only an address needs it

            try:
                ip_address(host)
            except ValueError:
                raise ValueError(
                    f"{host!r} is not an address; write four numbers from 0 to 255, such as "
                    "192.168.1.20, and the port under port:"
                ) from None
        return host

    @field_validator("colour")
    @classmethod
    def _can_be_written_on(cls, colour: str) -> str:
        if (ratio := contrast_to_white(colour)) < READABLE:
            raise ValueError(
                f"white words on {colour} have a contrast of {ratio:.1f} to 1, and need "
                f"at least {READABLE:g} to 1; choose a darker colour"
            )
        return colour

    @model_validator(mode="after")
    def _both_or_none(self) -> Self:
        if (self.certificate is None) != (self.key is None):
            there = "key" if self.certificate is None else "certificate"
            raise WrongKey("certificate and key belong together: give both, or none", at=(there,))
        return self
