// Theme: dark or light as the computer is, now and later, until people choose on a page.
(() => {
  const root = document.documentElement, dark = matchMedia("(prefers-color-scheme: dark)"), kept = "labcrane-theme";
  let chosen = null;
  try { chosen = localStorage.getItem(kept); } catch { /* a browser that keeps nothing */ }
  const paint = () => { root.dataset.theme = chosen ?? (dark.matches ? "dark" : "light"); };
  window.labcraneTheme = () => {
    chosen = root.dataset.theme === "dark" ? "light" : "dark";
    try { localStorage.setItem(kept, chosen); } catch { /* as above */ }
    paint();
  };
  dark.addEventListener("change", paint);
  paint();
})();
