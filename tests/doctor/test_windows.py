"""What the doctor says of Windows' settings, from texts as a registry and commands return them."""

from pathlib import PureWindowsPath

import pytest

from labcrane.core import Finding, Verdict
from labcrane.doctor import windows

PYTHON = r"C:\lab\.venv\Scripts\python.exe"
DATA = PureWindowsPath(r"C:\Users\lab\study\data")
UDP = "v2.31|Action=Allow|Active=TRUE|Dir=In|Protocol=17|LPort2_10=16571-16604|Name=LSL UDP|"
TCP = "v2.31|Action=Allow|Active=TRUE|Dir=In|Protocol=6|LPort2_10=16572-16604|Name=LSL TCP|"
OF_PYTHON = rf"v2.31|Action=Allow|Active=TRUE|Dir=In|Protocol=%d|App={PYTHON}|Name=Python|"


def passes(finding: Finding) -> bool:
    assert bool(finding.advice) is (finding.verdict is not Verdict.PASS)
    return finding.verdict is Verdict.PASS


@pytest.mark.parametrize(
    "rules",
    [
        [UDP, TCP],
        [OF_PYTHON % 17, OF_PYTHON % 6],
        [UDP.replace("16604", "16580"), UDP.replace("16571", "16581"), TCP],
    ],
)
def test_rules_for_all_ports_of_lsl_or_for_python_pass(rules: list[str]) -> None:
    assert passes(windows.firewall(rules, PYTHON))


@pytest.mark.parametrize(
    "rule",
    [
        TCP.replace("Allow", "Block"),
        TCP.replace("TRUE", "FALSE"),
        TCP.replace("Dir=In", "Dir=Out"),
        TCP.replace("16604", "16590"),
        (OF_PYTHON % 6).replace("lab", "other"),
        TCP + "Svc=upnphost|",
    ],
)
def test_a_rule_that_does_not_let_lsl_in_is_answered_with_the_command(rule: str) -> None:
    found = windows.firewall([UDP, rule], PYTHON)
    assert found.verdict is Verdict.WARN
    assert found.advice == (
        'as administrator: netsh advfirewall firewall add rule name="LSL TCP" dir=in action=allow '
        "protocol=TCP localport=16572-16604"
    )


def test_without_rules_both_commands_are_given() -> None:
    said = windows.firewall([], PYTHON).advice
    assert "protocol=UDP localport=16571-16604 & netsh " in said
    assert "protocol=TCP localport=16572-16604" in said


@pytest.mark.parametrize(
    ("said", "text"),
    [
        (
            "Power Scheme GUID: 8c5e7fda-e8bf-4a96-9a85-a6e23a8c635c  (High performance)",
            "the power plan is High performance",
        ),
        (
            "GUID des Energieschemas: 381b4222-f694-41f0-9685-ff5bb260df2e  (Ausbalanciert)",
            "the power plan is Balanced, with which the processor may wake up slowly",
        ),
        ("", "the power plan cannot be read"),
    ],
)
def test_the_power_plan_is_named_in_any_language(said: str, text: str) -> None:
    found = windows.power_plan(said)
    assert found.text == text
    assert passes(found) is (text == "the power plan is High performance")
    assert found.advice in {"", "powercfg /setactive SCHEME_MIN"}


QUERY = """\
    GUID Alias: ...
      Possible Setting Index: 000
      Possible Setting Index: 001
    Current AC Power Setting Index: 0x0000000{}
    Current DC Power Setting Index: 0x00000001
"""


def test_usb_suspend_is_judged_as_with_the_cable_plugged_in() -> None:
    assert passes(windows.usb_suspend(QUERY.format(0)))
    found = windows.usb_suspend(QUERY.format(1))
    assert found.text == "USB selective suspend is on: joysticks may fall asleep"
    assert found.advice.endswith(f"{windows.SUSPEND} 0 & powercfg /setactive SCHEME_CURRENT")
    assert windows.usb_suspend("").text == "USB selective suspend cannot be read"


def test_a_scaled_display_is_named_with_its_share() -> None:
    assert passes(windows.scaling(96))
    assert passes(windows.scaling(None))
    found = windows.scaling(144)
    assert found.verdict is Verdict.WARN
    assert found.text.startswith("the display is scaled to 150 %")


@pytest.mark.parametrize(
    ("capture", "mode", "named"),
    [(0, 0, ""), (None, 0, ""), (1, 0, "Game Bar's recording"), (0, None, "Game Mode")],
)
def test_game_bar_and_game_mode_are_found_where_they_are_on(
    capture: object, mode: object, named: str
) -> None:
    found = windows.game_bar(capture, mode)
    assert passes(found) is not bool(named)
    assert found.text.startswith(named or "Game Bar's recording and Game Mode are off")
    assert found.advice.count("reg add HKCU\\Software\\Microsoft\\") == bool(named)


def test_an_exclusion_of_the_data_folder_or_one_above_passes() -> None:
    assert passes(windows.antivirus("C:\\Users\\lab\\STUDY\r\n", DATA))
    assert passes(windows.antivirus(f"D:\\x\n{DATA}\n", DATA))


def test_without_an_exclusion_the_command_is_given() -> None:
    found = windows.antivirus("C:\\Users\\lab\\study\\data2\n", DATA)
    assert found.text == f"Microsoft Defender may scan {DATA} while a session writes to it"
    assert f"Add-MpPreference -ExclusionPath '{DATA}'" in found.advice
    hidden = windows.antivirus("N/A: Must be an administrator to view exclusions", DATA)
    assert hidden.text == f"only an administrator can see whether Microsoft Defender scans {DATA}"


def test_timers_are_fine_or_ticks_come_late() -> None:
    found = windows.timer(5000, 156250)
    assert passes(found)
    assert found.text == "timers can be as fine as 0.5 ms, and are 15.6 ms now"
    assert windows.timer(156250, 156250).text.endswith("ms now: ticks come late")
    assert windows.timer(None, None).text == "the timer resolution cannot be read"


@pytest.mark.parametrize(
    "folder",
    [
        r"C:\Users\lab\OneDrive - University\study\data",
        r"D:\Dropbox\data",
        r"E:\cloud\study\data",
    ],
)
def test_a_folder_that_is_synchronised_is_dangerous(folder: str) -> None:
    found = windows.synchronised(PureWindowsPath(folder), {"OneDrive": r"e:\Cloud"})
    assert found.verdict is Verdict.WARN
    assert found.text.startswith(f"{folder} is in a synchronised folder: it may be locked or moved")
    assert found.advice == "give a folder outside it with --data"


def test_a_folder_of_this_computer_is_not_synchronised() -> None:
    assert passes(windows.synchronised(DATA, {"OneDrive": r"C:\Users\lab\OneDrive"}))
    assert passes(windows.synchronised(DATA, {"OneDrive": ""}))


def test_a_network_share_is_told_by_its_name_or_its_drive() -> None:
    assert passes(windows.share(DATA, 3))
    for folder, drive in ((r"\\server\studies\data", None), (r"Z:\data", 4)):
        found = windows.share(PureWindowsPath(folder), drive)
        assert found.verdict is Verdict.WARN
        assert found.text.startswith(f"{folder} is on a network share")


def test_long_paths_are_allowed_or_the_command_is_given() -> None:
    assert passes(windows.long_paths(1))
    for value in (0, None):
        found = windows.long_paths(value)
        assert found.text == "paths of more than 259 characters fail, as exports may have"
        assert found.advice.endswith("/v LongPathsEnabled /t REG_DWORD /d 1 /f")


def test_elsewhere_every_setting_that_cannot_be_read_is_named(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(windows, "_said", lambda *_: "")
    monkeypatch.setattr(windows, "_values", lambda *_: {})
    found = list(windows.examine(tmp_path))
    assert len(found) == 10
    assert "the power plan cannot be read" in [each.text for each in found]
