"""Settings of cameras, microphones and screens."""

import os
import sys
from typing import Annotated, ClassVar, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt, field_validator

from labcrane import DeviceError
from labcrane.core import CaptureSettings, Usual
from labcrane_film.windows import window_of

SYSTEM = sys.platform if sys.platform in {"win32", "darwin"} else "linux"
CAMERAS = {"linux": "v4l2", "win32": "dshow", "darwin": "avfoundation"}
MICROPHONES = {"linux": "alsa", "win32": "dshow", "darwin": "avfoundation"}
SCREENS = {"linux": "x11grab", "win32": "gdigrab", "darwin": "avfoundation"}
"""What FFmpeg calls the devices of each system."""

LOGIN = "LABCRANE_CAMERA_LOGIN"
"""Environment variable with the login of cameras of the network: a protocol is public."""


class SourceSettings(CaptureSettings):
    """What is common to cameras, microphones and screens."""

    kind: ClassVar[Literal["video", "audio"]] = "video"
    grabbed: ClassVar[bool] = False
    """Whether the moment of capture is between its timestamp and its arrival."""

    format: str | None = None
    """FFmpeg's name for the kind of device, where it is not the system's usual one: ``lavfi`` for a
    generated test source."""

    options: dict[str, str] = Field(default_factory=dict)
    """Further options of FFmpeg for the device: ``{rtsp_transport: tcp}``."""

    codec: str = "libx264"
    """Encoder of pictures that come uncompressed. Others are copied as they come."""

    lag_s: Annotated[float | None, Usual(1e-5, 2.0)] = None
    """Time from the event to the device's timestamp, in seconds, as measured or stated by the
    maker; subtracted from the times. Without it the lag is unknown, and so is the uncertainty."""

    lag_error_s: Annotated[NonNegativeFloat, Usual(1e-5, 1.0)] = 0.0
    """Uncertainty of that lag, in seconds."""

    def source(self) -> tuple[str, str | None, dict[str, str]]:
        """Return FFmpeg's name of the device, its format, and its options."""
        raise NotImplementedError


class FilmCameraSettings(SourceSettings):
    """A camera: of this computer, or of the network by RTSP."""

    device: str
    """``/dev/video0`` on Linux, the camera's name on Windows, its number or name on a Mac; or an
    address: ``rtsp://10.0.0.5/stream``. Its login, ``name:password``, is in the environment
    variable ``LABCRANE_CAMERA_LOGIN``."""

    size: Annotated[tuple[PositiveInt, PositiveInt] | None, Usual(16, 16_384)] = None
    """Width and height in pixels; the camera's own by default."""

    rate_hz: Annotated[PositiveFloat | None, Usual(1.0, 1000.0)] = None
    """Pictures per second; the camera's own by default."""

    compression: str | None = None
    """What the camera is to send: ``mjpeg`` or ``h264``, which is copied into the file."""

    @field_validator("device")
    @classmethod
    def _without_login(cls, device: str) -> str:
        if "@" in device.partition("://")[2].partition("/")[0]:
            raise ValueError(
                "the address has a login, and every participant file keeps the protocol; set the "
                f"environment variable {LOGIN} to name:password, and take it out of the address"
            )
        return device

    def source(self) -> tuple[str, str | None, dict[str, str]]:
        kind, network, place = self.device.partition("://")
        if network:
            login = os.environ.get(LOGIN, "")
            address = f"{kind}://{login}@{place}" if login else self.device
            return address, self.format, dict(self.options)
        form = self.format or CAMERAS[SYSTEM]
        device = f"video={self.device}" if form == "dshow" else self.device
        asked = {
            "video_size": f"{self.size[0]}x{self.size[1]}" if self.size else None,
            "framerate": f"{self.rate_hz:g}" if self.rate_hz else None,
            "vcodec" if form == "dshow" else "input_format": self.compression,
        }
        return device, form, {k: v for k, v in asked.items() if v} | self.options


class MicrophoneSettings(SourceSettings):
    """A microphone. Its frames are pieces of sound of some milliseconds; a time is of its start."""

    kind: ClassVar[Literal["video", "audio"]] = "audio"

    device: str = "default"
    """ALSA's name on Linux, the microphone's name on Windows, its number or name on a Mac."""

    def source(self) -> tuple[str, str | None, dict[str, str]]:
        form = self.format or MICROPHONES[SYSTEM]
        named = {"dshow": f"audio={self.device}", "avfoundation": f":{self.device}"}
        return named.get(form, self.device), form, dict(self.options)


class ScreenSettings(SourceSettings):
    """The screen of this computer, or a part of it: what the operator sees."""

    grabbed: ClassVar[bool] = True

    display: str | None = None
    """The display: ``:0`` on Linux, ``desktop`` or ``title=NAME OF A WINDOW`` on Windows,
    ``Capture screen 0`` on a Mac; by default the one on which labcrane runs."""

    part: tuple[int, int, PositiveInt, PositiveInt] | None = None
    """Left, top, width and height in pixels; the whole screen by default."""

    of: str | None = None
    """The view whose window is recorded, instead of a part of the screen. On Linux and Windows; of
    a view that fills a monitor as of one in a window."""

    rate_hz: Annotated[PositiveFloat, Usual(1.0, 1000.0)] = 30.0
    """Pictures per second."""

    lag_s: Annotated[float | None, Usual(1e-5, 2.0)] = 0.0
    """As of a camera. What is recorded is the picture in the computer; a display shows it later."""

    def window(self, title: str) -> tuple[str, dict[str, str]]:
        """Return FFmpeg's name of the screen that has a window of a title, and its options."""
        display, form, options = self.source()
        if form == "gdigrab":
            return f"title={title}", options
        if form != "x11grab":
            raise DeviceError(
                f"a view's window cannot be recorded by {form}; record the screen: remove of"
            )
        return display, options | {"window_id": hex(window_of(display, title))}

    def source(self) -> tuple[str, str | None, dict[str, str]]:
        form = self.format or SCREENS[SYSTEM]
        usual = {"x11grab": os.environ.get("DISPLAY", ":0"), "gdigrab": "desktop"}
        display = self.display or usual.get(form, "Capture screen 0")
        asked = {"framerate": f"{self.rate_hz:g}"}
        if self.part:
            left, top, width, height = self.part
            x, y = ("grab_x", "grab_y") if form == "x11grab" else ("offset_x", "offset_y")
            asked |= {x: str(left), y: str(top), "video_size": f"{width}x{height}"}
        return display, form, asked | self.options
