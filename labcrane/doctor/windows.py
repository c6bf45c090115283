"""Settings of Windows that delay a loop, hold back LSL or endanger data.

Written without a computer with Windows, and tested only on texts as its documentation shows them.
Each check is a function of what the registry or a command returns. It uses values and identifiers,
because commands answer in the language of the computer.
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PureWindowsPath

from labcrane.core.findings import Finding, Verdict

APPLIES: bool = sys.platform == "win32"

COMMAND_S = 10.0
"""Time limit of a command."""

UDP_PORTS, TCP_PORTS = range(16571, 16605), range(16572, 16605)
"""LSL's ports, as in docs/lab.md."""

FAST_PLANS = {
    "8c5e7fda-e8bf-4a96-9a85-a6e23a8c635c": "High performance",
    "e9a42b02-d5df-448d-aa00-03f14749eb61": "Ultimate performance",
}
SLOW_PLANS = {
    "381b4222-f694-41f0-9685-ff5bb260df2e": "Balanced",
    "a1841308-3541-4fab-bc81-f71556f20b4a": "Power saver",
}
USB, SUSPEND = "2a737441-1930-4402-8d77-b2bebba308a3", "48e6b7a6-50f5-4782-a5d4-53bb8f07e226"
"""Subgroup and setting of powercfg for USB selective suspend."""

GAMES = r"Software\Microsoft\Windows\CurrentVersion\GameDVR"

PLAIN_DPI = 96
REMOTE_DRIVE = 4
"""What GetDriveTypeW returns for a drive on the network."""

FINE_TIMER = 10_000
"""A resolution of 1 ms, in units of 100 ns."""

SYNCED = ("OneDrive", "OneDriveConsumer", "OneDriveCommercial")
"""Variables that name OneDrive's folders."""

SYNCING = re.compile(
    r"(onedrive|dropbox|google ?drive|my drive|icloud ?drive|nextcloud|owncloud|seafile)\b",
    re.IGNORECASE,
)
"""Beginnings of folders' names that programs for synchronisation use."""

_GUID = re.compile(r"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}", re.IGNORECASE)
_PORTS = re.compile(r"LPort(?:2_\d+)?=(\d+)(?:-(\d+))?$")


def firewall(rules: Iterable[str], program: str) -> Finding:
    """Return whether the firewall lets LSL in, from the registry's FirewallRules.

    Parameters
    ----------
    rules
        ``v2.31|Action=Allow|Active=TRUE|Dir=In|Protocol=17|LPort2_10=16571-16604|Name=LSL|``.
    program
        This Python, whose rule may let in all ports.
    """
    opened: dict[str, set[int]] = {"17": set(), "6": set()}
    for rule in rules:
        fields = [field for field in rule.split("|") if "=" in field]
        named = dict(field.split("=", 1) for field in fields)
        if (named.get("Action"), named.get("Active"), named.get("Dir")) != ("Allow", "TRUE", "In"):
            continue
        if {"Svc", "AppPkgId"} & set(named):  # of a service or an app alone
            continue
        app = named.get("App", program)
        if PureWindowsPath(app) != PureWindowsPath(program):
            continue
        ranges = [found for field in fields if (found := _PORTS.match(field))]
        ports = {
            port for each in ranges for port in range(int(each[1]), int(each[2] or each[1]) + 1)
        }
        if not ranges and "App" in named:
            ports = {*UDP_PORTS}
        for protocol in [named["Protocol"]] if "Protocol" in named else opened:
            opened.get(protocol, set()).update(ports)
    closed = [
        f'netsh advfirewall firewall add rule name="LSL {name}" dir=in action=allow '
        f"protocol={name} localport={ports[0]}-{ports[-1]}"
        for name, number, ports in (("UDP", "17", UDP_PORTS), ("TCP", "6", TCP_PORTS))
        if not opened[number].issuperset(ports)
    ]
    if not closed:
        return Finding(Verdict.PASS, "the firewall has rules that let in the ports of LSL")
    fix = f"as administrator: {' & '.join(closed)}"
    return Finding(Verdict.WARN, "the firewall has no rule that lets in all ports of LSL", fix)


def power_plan(said: str) -> Finding:
    """Return whether the processor may sleep, from ``powercfg /getactivescheme``."""
    fix = "powercfg /setactive SCHEME_MIN"
    if not (found := _GUID.search(said)):
        return Finding(Verdict.WARN, "the power plan cannot be read", fix)
    plan = found[0].lower()
    if plan in FAST_PLANS:
        return Finding(Verdict.PASS, f"the power plan is {FAST_PLANS[plan]}")
    name = SLOW_PLANS.get(plan, "one of the maker's or of your own")
    text = f"the power plan is {name}, with which the processor may wake up slowly"
    return Finding(Verdict.WARN, text, fix)


def usb_suspend(said: str) -> Finding:
    """Return whether USB devices may be suspended, from ``powercfg /query``."""
    fix = (
        f"powercfg /setacvalueindex SCHEME_CURRENT {USB} {SUSPEND} 0 "
        "& powercfg /setactive SCHEME_CURRENT"
    )
    values = [int(each, 16) for each in re.findall(r"\b0x[0-9a-f]{8}\b", said, re.IGNORECASE)]
    if len(values) < 2:  # noqa: PLR2004 - with a cable, and with the battery
        return Finding(Verdict.WARN, "USB selective suspend cannot be read", fix)
    if values[-2]:
        return Finding(Verdict.WARN, "USB selective suspend is on: joysticks may fall asleep", fix)
    return Finding(Verdict.PASS, "USB selective suspend is off while the cable is plugged in")


def scaling(dpi: object) -> Finding:
    """Return whether windows are scaled, from the registry's AppliedDPI; 96 is 100 %."""
    if dpi in {None, PLAIN_DPI}:
        return Finding(Verdict.PASS, "the display is not scaled")
    share = f"{100 * dpi / PLAIN_DPI:.0f} %" if isinstance(dpi, int) else str(dpi)
    text = f"the display is scaled to {share}: sizes of views in pixels differ"
    fix = "set 100 % in Settings, System, Display, Scale; for each monitor, then log in again"
    return Finding(Verdict.WARN, text, fix)


def game_bar(capture: object, mode: object) -> Finding:
    """Return whether Game Bar or Game Mode is on, from AppCaptureEnabled and AutoGameModeEnabled.

    Game Mode is on where the registry has no value.
    """
    places = {
        "Game Bar's recording": rf"{GAMES} /v AppCaptureEnabled",
        "Game Mode": r"Software\Microsoft\GameBar /v AutoGameModeEnabled",
    }
    on = [
        name
        for name, is_on in zip(places, (capture not in {None, 0}, mode != 0), strict=True)
        if is_on
    ]
    if not on:
        return Finding(Verdict.PASS, "Game Bar's recording and Game Mode are off")
    commands = [f"reg add HKCU\\{places[name]} /t REG_DWORD /d 0 /f" for name in on]
    text = f"{' and '.join(on)} may take time from the loop, the views and sounds"
    return Finding(Verdict.WARN, text, " & ".join(commands))


def antivirus(said: str, folder: PureWindowsPath) -> Finding:
    """Return whether Defender leaves out the data folder, from the lines of its ExclusionPath."""
    fix = f"as administrator, in PowerShell: Add-MpPreference -ExclusionPath '{folder}'"
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    left_out = [PureWindowsPath(line) for line in lines if PureWindowsPath(line).is_absolute()]
    if any(folder.is_relative_to(each) for each in left_out):
        return Finding(Verdict.PASS, f"Microsoft Defender does not scan {folder}")
    if lines and not left_out:  # N/A: Must be an administrator to view exclusions
        text = f"only an administrator can see whether Microsoft Defender scans {folder}"
        return Finding(Verdict.WARN, text, fix)
    text = f"Microsoft Defender may scan {folder} while a session writes to it"
    return Finding(Verdict.WARN, text, f"{fix}; ask who is responsible for this computer")


def timer(finest: int | None, now: int | None) -> Finding:
    """Return how fine timers can be, from NtQueryTimerResolution, in units of 100 ns."""
    if finest is None or now is None:
        fix = "read the lateness of ticks above"
        return Finding(Verdict.WARN, "the timer resolution cannot be read", fix)
    text = f"timers can be as fine as {finest / 1e4:.1f} ms, and are {now / 1e4:.1f} ms now"
    if finest <= FINE_TIMER:
        return Finding(Verdict.PASS, text)
    fix = "bcdedit /deletevalue useplatformtick, as administrator; then restart"
    return Finding(Verdict.WARN, f"{text}: ticks come late", fix)


def synchronised(folder: PureWindowsPath, environment: Mapping[str, str]) -> Finding:
    """Return whether a program for synchronisation copies or locks the data folder."""
    roots = [PureWindowsPath(environment[name]) for name in SYNCED if environment.get(name)]
    named = [part for part in folder.parts if SYNCING.match(part)]
    if named or any(folder.is_relative_to(root) for root in roots):
        text = (
            f"{folder} is in a synchronised folder: it may be locked or moved while a session "
            "writes, and data of people leave this computer"
        )
        return Finding(Verdict.WARN, text, "give a folder outside it with --data")
    return Finding(Verdict.PASS, f"{folder} is not in a synchronised folder")


def share(folder: PureWindowsPath, drive_type: int | None) -> Finding:
    """Return whether the data folder is on the network, from its name and GetDriveTypeW."""
    if folder.drive.startswith("\\\\") or drive_type == REMOTE_DRIVE:
        text = f"{folder} is on a network share: the network can make the loop wait"
        fix = "record on this computer's disk, and copy with labcrane transfer"
        return Finding(Verdict.WARN, text, fix)
    return Finding(Verdict.PASS, f"{folder} is not on a network share")


def long_paths(enabled: object) -> Finding:
    """Return whether paths of more than 259 characters work, from LongPathsEnabled."""
    if enabled == 1:
        return Finding(Verdict.PASS, "paths of more than 259 characters are allowed")
    key = r"HKLM\SYSTEM\CurrentControlSet\Control\FileSystem"
    fix = f"as administrator: reg add {key} /v LongPathsEnabled /t REG_DWORD /d 1 /f"
    text = "paths of more than 259 characters fail, as exports may have"
    return Finding(Verdict.WARN, text, fix)


def examine(data: Path) -> Iterator[Finding]:
    """Read the settings of this computer, and yield what is found of each."""
    folder = PureWindowsPath(data.absolute())
    desktop = r"Control Panel\Desktop\WindowMetrics"
    rules = (
        r"SYSTEM\CurrentControlSet\Services\SharedAccess\Parameters\FirewallPolicy\FirewallRules"
    )
    files = r"SYSTEM\CurrentControlSet\Control\FileSystem"
    exclusions = "(Get-MpPreference).ExclusionPath"
    yield firewall(map(str, _values("HKEY_LOCAL_MACHINE", rules).values()), sys.executable)
    yield power_plan(_said("powercfg", "/getactivescheme"))
    yield usb_suspend(_said("powercfg", "/query", "SCHEME_CURRENT", USB, SUSPEND))
    yield scaling(_values("HKEY_CURRENT_USER", desktop).get("AppliedDPI"))
    yield game_bar(
        _values("HKEY_CURRENT_USER", GAMES).get("AppCaptureEnabled"),
        _values("HKEY_CURRENT_USER", r"Software\Microsoft\GameBar").get("AutoGameModeEnabled"),
    )
    yield antivirus(_said("powershell", "-NoProfile", "-Command", exclusions), folder)
    yield timer(*_timers())
    yield synchronised(folder, os.environ)
    yield share(folder, _drive_type(folder))
    yield long_paths(_values("HKEY_LOCAL_MACHINE", files).get("LongPathsEnabled"))


def _said(*command: str) -> str:
    """Return the output of a command; empty where there is none."""
    try:
        done = subprocess.run(  # noqa: S603 - programs of Windows
            command, check=False, capture_output=True, timeout=COMMAND_S
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.decode(errors="replace")


def _values(root: str, key: str) -> dict[str, object]:
    """Return the values of a key of the registry; none where there is no such key."""
    found: dict[str, object] = {}
    if sys.platform == "win32":
        import winreg  # noqa: PLC0415 - on Windows only

        try:
            with winreg.OpenKey(getattr(winreg, root), key) as opened:
                for number in range(winreg.QueryInfoKey(opened)[1]):
                    name, value, _ = winreg.EnumValue(opened, number)
                    found[name] = value
        except OSError:
            return found
    return found


def _timers() -> tuple[int | None, int | None]:
    """Return the finest resolution of timers and the one there is, in units of 100 ns."""
    answer: tuple[int | None, int | None] = (None, None)
    if sys.platform == "win32":
        import ctypes  # noqa: PLC0415 - on Windows only

        coarsest, finest, now = (ctypes.c_ulong() for _ in range(3))
        query = ctypes.WinDLL("ntdll").NtQueryTimerResolution
        if query(ctypes.byref(coarsest), ctypes.byref(finest), ctypes.byref(now)) == 0:
            answer = finest.value, now.value
    return answer


def _drive_type(folder: PureWindowsPath) -> int | None:
    found: int | None = None
    if sys.platform == "win32":
        import ctypes  # noqa: PLC0415 - on Windows only

        found = int(ctypes.WinDLL("kernel32").GetDriveTypeW(folder.anchor))
    return found
