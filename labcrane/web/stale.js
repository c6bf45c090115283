// Stale: a page that its server has not reached for a while says so, and nothing on it can be pressed.
(() => {
  const AFTER_MS = 2000, LOOK_MS = 250, MOST_MS = 1000;
  const PRESSED = "button, select, input[type=range]", WRITTEN = "input:not([type=range]), textarea";
  const root = document.documentElement, is = () => root.dataset.stale !== undefined;
  let heard = null, looked = 0, silent = 0, banner = null, focus = null;
  const change = (stale) => {
    if (stale && !is()) focus = document.activeElement;
    root.toggleAttribute("data-stale", stale);
    document.querySelectorAll(PRESSED).forEach((one) => { one.inert = stale; });
    if (!stale) { banner?.remove(); banner = null; focus?.focus(); return; }
    if (!banner) {
      banner = Object.assign(document.createElement("div"), { id: "stale", role: "alert" });
      banner.append(Object.assign(document.createElement("strong"), { textContent: root.dataset.staleWords }));
      const time = Object.assign(document.createElement("span"), { id: "stale-for", ariaHidden: "true" });
      banner.append(time);
      document.body.prepend(banner);
    }
    const s = Math.floor((performance.now() - heard) / 1000);
    banner.lastChild.textContent = `${Math.floor(s / 60)}:${String(s % 60).padStart(2, "0")}`;
  };
  const look = () => {
    const now = performance.now();
    silent += Math.min(now - looked, MOST_MS); // a page that stood still itself has missed nothing yet
    looked = now;
    const stale = heard !== null && silent > AFTER_MS && !document.querySelector("[data-over]");
    if (stale || is()) change(stale);
  };
  window.labcraneBeat = () => { heard = performance.now(); silent = 0; look(); };
  setInterval(look, LOOK_MS);
  addEventListener("keydown", (e) => { if (is() && !e.target.matches?.(WRITTEN)) e.stopImmediatePropagation(); }, true);
  addEventListener("submit", (e) => { if (is()) { e.preventDefault(); e.stopImmediatePropagation(); } }, true);
})();
