// Drafts: unsaved text of a field is kept in this tab, and restored when the page was reloaded.
// A field names its draft (`data-draft`) and states the recorded value (`data-held`): a
// draft of text that has been saved, or was changed elsewhere since, is discarded.
(() => {
  const place = (field) => `labcrane-draft ${field.dataset.draft}`;
  const each = (node, then) => {
    if (node.matches?.("input[data-draft]")) then(node);
    node.querySelectorAll?.("input[data-draft]").forEach(then);
  };
  const restore = (field) => {
    let kept = null;
    try { kept = JSON.parse(sessionStorage.getItem(place(field))); } catch { /* nothing is kept here */ }
    if (!kept || kept.text === field.value) return;
    if (kept.held !== field.dataset.held) { forget(field); return; }
    field.value = kept.text;
    field.dispatchEvent(new Event("input", { bubbles: true }));
  };
  const forget = (field) => { try { sessionStorage.removeItem(place(field)); } catch { /* as above */ } };
  addEventListener("input", ({ target: field }) => {
    if (!field.dataset?.draft) return;
    const kept = JSON.stringify({ text: field.value, held: field.dataset.held });
    try { sessionStorage.setItem(place(field), kept); } catch { /* as above */ }
  });
  new MutationObserver((changes) => {
    for (const change of changes) {
      if (change.type === "childList") change.addedNodes.forEach((node) => each(node, restore));
      else if (change.target.dataset.draft) forget(change.target); // the record has taken an answer
    }
  }).observe(document, { subtree: true, childList: true, attributeFilter: ["data-held"] });
})();
