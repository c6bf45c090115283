"""What can be measured of how a page looks: accessibility by axe-core, and text in its boxes."""

import json
import os
import re
from functools import cache

from needs import need, node_module
from selenium import webdriver

AXE = "axe-core"
WCAG_AA = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"]
RUN = """
const [tags, done] = arguments;
axe.run(document, {runOnly: tags, resultTypes: ['violations']}).then(found => done(
    found.violations.map(v => v.id + ': ' + v.nodes.map(n => n.html.slice(0, 200)).join(' | '))));
"""
SCREENS = os.environ.get("LABCRANE_SCREENS")
"""Folder for pictures of every state that is checked: ``python docs/screens.py`` gives one."""

SIZES = ((1280, 800), (1920, 1080), (768, 1024))

BOXES = """
const found = [], texts = [];
const shown = e => e.checkVisibility({visibilityProperty: true, opacityProperty: true});
const modal = document.querySelector('dialog:modal') ?? document.body;
const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walk.nextNode()) {
    const node = walk.currentNode, e = node.parentElement;
    if (!node.textContent.trim() || !shown(e)) continue;
    if (e.closest('script, style, select, #popup') || !modal.contains(e)) continue;
    if (e.closest('details:not([open])') && !e.closest('summary')) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const r of range.getClientRects()) {
        if (r.width < 2 || r.height < 2) continue;
        let hidden = false;
        for (let a = e; a && a !== document.body; a = a.parentElement) {
            const style = getComputedStyle(a), box = a.getBoundingClientRect();
            const scrolls = /auto|scroll/.test(style.overflowY + style.overflowX);
            if (scrolls && (r.bottom > box.bottom + 1 || r.top < box.top - 1 ||
                            r.right > box.right + 1)) hidden = true;
            else if (!scrolls && style.overflowX === 'hidden' &&
                     (r.right > box.right + 2 || r.bottom > box.bottom + 2))
                found.push('cut: ' + node.textContent.trim().slice(0, 60));
        }
        if (hidden) continue;
        if (r.right > innerWidth + 1 || r.left < -1)
            found.push('beyond the window: ' + node.textContent.trim().slice(0, 60));
        texts.push([r, node]);
    }
}
for (const e of document.querySelectorAll('select, input:not([type=range])'))
    if (shown(e) && e.scrollWidth > e.clientWidth + 2) found.push('cut in its field: ' + e.id);
texts.forEach(([a, one], at) => texts.slice(at + 1).forEach(([b, other]) => {
    const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
    const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (one !== other && wide > 2 && high > 4)
        found.push(`over each other: ${one.textContent.trim().slice(0, 40)} and ` +
                   other.textContent.trim().slice(0, 40));
}));
return [texts.length, [...new Set(found)]];
"""
"""How many lines of text are shown, and each that is cut, or over another one."""


@cache
def axe() -> str:
    """Return axe-core's program."""
    need(AXE)
    folder = node_module(AXE)
    assert folder is not None
    return (folder / "axe.min.js").read_text(encoding="utf-8")


def complaints(browser: webdriver.Chrome) -> list[str]:
    """Return what axe-core finds against WCAG 2.2 AA, a line each."""
    browser.execute_script(axe())
    return list(browser.execute_async_script(RUN, WCAG_AA))


def misplaced(browser: webdriver.Chrome, state: str) -> dict[str, list[str]]:
    """Return text that is cut or over other text, by the window's size; take a picture of each."""
    found = {}
    for width, height in SIZES:
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        browser.execute_async_script(
            "scrollTo(0, 0); requestAnimationFrame(() => requestAnimationFrame(arguments[0]))"
        )
        lines, wrong = browser.execute_script(BOXES)
        assert lines, "there is text to measure"
        if SCREENS:
            name = "-".join(re.findall(r"\w+", state.lower()))
            browser.save_screenshot(f"{SCREENS}/{name}-{width}.png")
        if wrong:
            found[f"{width}x{height}"] = wrong
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    return found


def check(browser: webdriver.Chrome, state: str) -> None:
    """See that a page in this state can be used by everybody, and that nothing of it is cut."""
    wrong = complaints(browser)
    assert not wrong, f"{state}: {json.dumps(wrong, indent=1)}"
    cut = misplaced(browser, state)
    assert not cut, f"{state}: {json.dumps(cut, indent=1)}"
