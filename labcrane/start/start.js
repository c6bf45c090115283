// Start page: a study's form and its YAML beside each other, what check finds, and the commands that run.
import { Form, h } from "/asset/form.js";

const WAIT_MS = 400, POLL_MS = 500, OLD_MS = 3000;
const find = (id) => document.getElementById(id), main = find("main");
const words = await (await fetch("/asset/words.json")).json();
let language = localStorage.getItem("labcrane-language") ?? navigator.language.slice(0, 2);
if (!(language in words)) language = "en";
const t = (word, fills = {}) => Object.entries(fills).reduce((text, [name, value]) => text.replace(`{${name}}`, value), words[language][word]);

let doc = null, schema = null, found = [], checked = "", view = "form", desk = null, jobs = new Map(), shown = null, given = {}, command = "check";
let late = false, queue = Promise.resolve(), typing = null;

const ask = async (name, body = {}) => {
  let answer;
  try {
    answer = await fetch(`/ask/${name}`, { method: "POST", body: JSON.stringify(body), headers: { "content-type": "application/json" } });
  } catch { throw new Error(t("gone")); }
  const raw = await answer.text();
  if (answer.status === 413) throw new Error(t("too_long", { count: raw.match(/\d+/)?.[0] }));
  let said;
  try { said = JSON.parse(raw); } catch { throw new Error(raw || `${answer.status} ${answer.statusText}`); }
  if (!answer.ok) throw new Error(said.error);
  return said;
};
const tell = (error) => { const at = find("alert"); at.textContent = error?.message ?? error ?? ""; at.hidden = !at.textContent; };
// Requests that change the study go one after the other, each with the revision that the one before gave.
const inTurn = (run) => (queue = queue.then(run).then((value) => { tell(""); return value; }, tell));
const change = (name, body = {}) => inTurn(async () => {
  const box = find("yaml");
  if (box) box.readOnly = true; // what is typed meanwhile would take the change back
  try {
    await typed();
    take(await ask(name, { revision: doc.revision, ...body }));
  } finally { if (box) box.readOnly = false; }
});

const form = new Form((how, place, value) => change("edit", { how, place, value }), t, (one) => remedies(one));
form.openFile = (name) => turn("file", { name });
form.preview = () => { command = "pages"; inTurn(async () => { await start({ protocol: doc.study }); view = "do"; draw(); }); };
form.redraw = (place) => { drawForm(); refocus(JSON.stringify(place)); };

const take = (made) => {
  const text = doc?.text, before = find("yaml")?.value;
  doc = made;
  Object.assign(form, { files: doc.files, tied: doc.tied, places: new Set(doc.places.map(([place]) => JSON.stringify(place))) });
  document.title = `${doc.name} · labcrane`;
  if (find("yaml") && before === text) put(doc.text);
  drawBar();
  drawForm();
  check();
  if (doc.ask) question(doc.ask);
};
const put = (text) => {
  const box = find("yaml"), at = box.selectionStart, top = box.scrollTop;
  if (box.value === text) return;
  box.value = text;
  box.setSelectionRange(at, at);
  box.scrollTop = top;
};

// What was typed in the YAML goes as one splice; places count characters, as Python does.
const typed = async () => {
  clearTimeout(typing);
  const box = find("yaml"), now = box?.value;
  if (!box || !doc || now === doc.text) return;
  const old = [...doc.text], made = [...now];
  let begin = 0, end = 0;
  while (begin < Math.min(old.length, made.length) && old[begin] === made[begin]) begin++;
  while (end < Math.min(old.length, made.length) - begin && old.at(-1 - end) === made.at(-1 - end)) end++;
  const body = { begin, end: old.length - end, text: made.slice(begin, made.length - end).join("") };
  const answer = await ask("splice", { revision: doc.revision, ...body });
  const still = box.value === now;
  doc = answer;
  Object.assign(form, { tied: doc.tied, places: new Set(doc.places.map(([place]) => JSON.stringify(place))) });
  if (still) { drawBar(); drawForm(); check(); } else later();
};
const later = () => { clearTimeout(typing); typing = setTimeout(() => inTurn(typed), WAIT_MS); };

let checking = null, again = false;
const check = () => {
  if (checking) { again = true; return; }
  checked = t("checking");
  drawFindings();
  checking = ask("check").then((told) => {
    if (told.revision !== doc.revision) { again = true; return; }
    const before = JSON.stringify(found);
    found = told.findings.map((one) => ({ ...one, place: placeOf(one) }));
    checked = found.length ? t("found", { count: found.length }) : t("fine");
    drawFindings();
    if (JSON.stringify(found) !== before) drawForm();
  }, (error) => { checked = error.message; found = []; drawFindings(); }).finally(() => {
    checking = null;
    if (again) { again = false; check(); }
  });
};
const placeOf = (one) => {
  let best = [];
  for (const [place, line, column] of doc.places) {
    if (line < one.line || (line === one.line && column <= Math.max(1, one.column))) best = place; else break;
  }
  return best;
};
// Remedies: a near name replaces what was written; a warning that is intended is listed as expected.
const remedies = (one) => {
  if (doc.name !== doc.study) return []; // the finding is in the protocol, and another file is open
  const near = /^(?<before>.*)'(?<wrong>[^']+)'.*did you mean '(?<right>[^']+)'/.exec(one.message)?.groups;
  const made = [];
  if (near && one.line) {
    // Columns count characters, as Python does; those of JavaScript count some characters twice.
    const lines = doc.text.split("\n"), line = lines[one.line - 1], skipped = [...line].slice(0, Math.max(0, one.column - 1)).join("");
    const at = line.indexOf(near.wrong, skipped.length), before = [...lines.slice(0, one.line - 1), line.slice(0, at)].join("\n");
    const begin = [...before].length, end = begin + [...near.wrong].length;
    if (at >= 0) made.push(h("button", { onclick: () => change("splice", { begin, end, text: near.right }) }, t("use", { name: near.right })));
  }
  if (one.kind === "question" && one.key) made.push(h("button", { onclick: () => change("edit", { how: "insert", place: ["expected", (doc.data.expected ?? []).length], value: one.key }) }, t("intended")));
  return made;
};

const refocus = (place) => [...document.querySelectorAll("[data-place]")].find((each) => each.dataset.place === place)?.focus({ preventScroll: true });
const drawForm = () => {
  const box = find("form"), active = document.activeElement;
  if (!box || !schema) return;
  // A field that is being written is left alone until it is done.
  late = box.contains(active) && active.matches("input, textarea") && active.value !== active.defaultValue;
  if (late) { box.addEventListener("focusout", () => setTimeout(() => late && drawForm()), { once: true }); return; }
  const focus = box.contains(document.activeElement) ? document.activeElement.dataset.place : null, top = box.scrollTop;
  document.querySelectorAll("datalist").forEach((each) => each.remove());
  if (doc.name !== doc.study) { box.replaceChildren(h("p", { className: "faint" }, t("as_read")), h("div", { className: "text" }, doc.text)); return; }
  box.replaceChildren(...(doc.unreadable ? [h("p", { className: "problem" }, doc.unreadable), h("p", {}, t("fix_text"))]
    : form.draw(schema, doc.data, found)).filter(Boolean));
  box.scrollTop = top;
  if (focus) refocus(focus);
};
const drawFindings = () => {
  const box = find("findings");
  if (!box) return;
  find("checked").textContent = checked;
  box.replaceChildren(...found.map((one) => h("li", { className: one.kind === "problem" ? "problem" : "question" },
    h("button", { onclick: () => goto(one.line), disabled: doc.name !== doc.study }, t("line", { line: one.line })), " ", one.message, " ", ...remedies(one))));
};
const show = (line) => { const box = find("yaml"); box.scrollTop = (line - 4) * box.scrollHeight / doc.text.split("\n").length; };
const follow = ({ target }) => {
  const line = doc.places.find(([place]) => JSON.stringify(place) === target.dataset?.place)?.[1];
  if (line) show(line);
};
const goto = (line) => {
  const box = find("yaml"), start = doc.text.split("\n").slice(0, line - 1).join("\n").length + (line > 1 ? 1 : 0);
  box.focus();
  box.setSelectionRange(start, start + (doc.text.split("\n")[line - 1] ?? "").length);
  show(line);
};

const turn = (name, body) => inTurn(async () => { if (doc) await typed(); await begin(await ask(name, body)); });
const newFile = () => {
  const box = find("question"), name = h("input", { id: "file-name", value: "notes.md" });
  box.ariaLabel = t("new_file");
  box.replaceChildren(h("label", { htmlFor: "file-name" }, t("new_file")), name, h("div", { className: "row" },
    h("button", { id: "make", className: "main", onclick: () => { box.close(); turn("file", { name: name.value, new: true }); } }, t("add")),
    h("button", { onclick: () => box.close() }, t("cancel"))));
  box.showModal();
};
const drawBar = () => {
  document.documentElement.lang = language;
  const pick = find("language");
  pick.ariaLabel = t("language");
  pick.replaceChildren(...Object.keys(words).map((each) => h("option", { value: each, selected: each === language }, words[each].own)));
  find("title").textContent = doc ? doc.name : "labcrane";
  find("state").textContent = !doc ? "" : [doc.folder, doc.unsaved ? t("unsaved") : t("saved"), doc.others.length > 0 && t("others", { count: doc.others.length, names: doc.others.join(", ") }), doc.restored && t("restored"), doc.newer && t("newer"), doc.approved && t("approved")].filter(Boolean).join(" · ");
  const files = () => h("select", { id: "file", ariaLabel: t("file"), onchange: ({ target }) => { if (target.value) turn("file", { name: target.value }); else { target.value = doc.name; newFile(); } } },
    [...new Set([...doc.protocols, ...doc.files])].map((each) => h("option", { selected: each === doc.name }, each)), h("option", { value: "" }, t("new_file")));
  const tab = (name) => h("button", { id: `tab-${name}`, "aria-pressed": String(view === name), onclick: () => { view = name; draw(); } }, t(name));
  find("actions").replaceChildren(...(doc ? [
    files(), tab("form"), tab("plan"), tab("do"),
    h("button", { id: "undo", disabled: !doc.undo, onclick: () => change("undo") }, t("undo")),
    h("button", { id: "redo", disabled: !doc.redo, onclick: () => change("redo") }, t("redo")),
    h("button", { id: "save", className: "main", disabled: !doc.unsaved, onclick: () => save() }, t("save")),
    h("button", { id: "close", onclick: () => inTurn(async () => { await typed(); doc = null; await home(); }) }, t("other")),
  ] : []));
};
const save = (about = {}) => change("save", about);
const question = (kind) => {
  const box = find("question"), close = (run) => { box.close(); run?.(); };
  box.ariaLabel = t("save");
  const over = { every: doc.every, ...(kind === "newer" ? { over_newer: true } : { over_newer: doc.newer, over_approved: true }) };
  box.replaceChildren(h("p", {}, t(`ask_${kind}`)), h("div", { className: "row" },
    h("button", { id: "over", onclick: () => close(() => save(over)) }, t(kind === "newer" ? "over" : "save_anyway")),
    kind === "newer" ? h("button", { id: "reload", onclick: () => close(() => change("reload")) }, t("reload")) : null,
    h("button", { id: "keep", className: "main", autofocus: true, onclick: () => close() }, t("cancel"))));
  box.showModal();
};

const home = async () => {
  desk = await ask("studies");
  drawBar();
  const open = (path) => turn("open", { path });
  const shipped = h("select", { id: "shipped" }, desk.shipped.map((each) => h("option", { selected: each === "whole" }, each)));
  const name = h("input", { id: "name", value: "my_study" });
  const copy = () => turn("copy", { shipped: shipped.value, name: name.value });
  const list = (paths) => paths.length ? h("ul", {}, paths.map((each) => h("li", {}, h("button", { onclick: () => open(each) }, each)))) : h("p", { className: "faint" }, t("none"));
  main.replaceChildren(h("div", { className: "columns" },
    h("section", {}, h("h2", {}, t("new")), h("div", { className: "field" }, h("label", { htmlFor: "shipped" }, t("shipped")), shipped),
      h("div", { className: "field" }, h("label", { htmlFor: "name" }, t("folder")), name), h("button", { id: "copy", className: "main", onclick: copy }, t("copy"))),
    h("section", {}, h("h2", {}, t("here")), h("p", { className: "faint" }, desk.root), list(desk.here)),
    h("section", {}, h("h2", {}, t("recent")), list(desk.recent))));
};
const begin = async (made) => {
  doc = made;
  found = [];
  schema = null;
  view = "form";
  draw();
  take(made);
  schema = await ask("schema");
  drawForm();
};

const draw = () => {
  drawBar();
  if (!doc) return;
  if (view === "do") { drawDo(); return; }
  if (view === "plan") { drawPlan(); return; }
  main.replaceChildren(h("div", { className: "work" },
    h("section", { "aria-label": t("form") }, h("div", { id: "form", className: "scroll", tabIndex: 0, role: "group", ariaLabel: t("form"), onfocusin: follow }, h("p", {}, t("loading")))),
    h("section", { "aria-label": doc.name }, h("textarea", { id: "yaml", "aria-label": doc.name, className: doc.name === doc.study ? "" : "text", spellcheck: false, value: doc.text, oninput: later }),
      h("strong", { id: "checked", role: "status" }, checked), h("ul", { id: "findings", tabIndex: 0, ariaLabel: t("findings"), role: "list" }))));
  drawForm();
  drawFindings();
};

// The plan of each participant, of the text as it is now.
const drawPlan = async () => {
  const box = h("section", { id: "plan", className: "scroll", tabIndex: 0, "aria-label": t("plan"), role: "group" }, h("p", { role: "status" }, t("loading")));
  main.replaceChildren(box);
  const told = await inTurn(async () => { await typed(); return ask("plan"); });
  if (!told) { box.replaceChildren(h("p", { className: "problem" }, find("alert").textContent)); return; }
  const minutes = (seconds) => (seconds / 60).toFixed(1);
  const block = (each) => h("li", {}, `${each.number} ${each.name}${each.practice ? ` (${t("practice")})` : ""}: ${each.trials}, ${minutes(each.expected_s)} min`,
    Object.entries(each.levels).map(([factor, levels]) => `; ${factor}: ${levels.join(", ")}`));
  const row = (each) => h("tr", {}, [each.participant, `${each.session} ${each.name}`, [...new Set(each.blocks.map((one) => one.group).filter(Boolean))].join(", "),
    [...new Set(each.blocks.map((one) => one.condition).filter(Boolean))].join(", "), minutes(each.expected_s)].map((text) => h("td", {}, text)), h("td", {}, h("ul", {}, each.blocks.map(block))));
  box.replaceChildren(h("code", {}, told.line), h("ul", { id: "balance" }, told.balance.map((each) => h("li", { className: each.includes("not balanced") ? "question" : "" }, each))),
    h("table", {}, h("thead", {}, h("tr", {}, ["participant", "session", "group", "condition", "minutes", "blocks"].map((word) => h("th", { scope: "col" }, t(word))))),
      h("tbody", {}, told.sessions.map(row))));
};

// Folders of output: simulated, simulated-2 and so on.
const numbered = (name, number) => number === 1 ? name : `${name}-${number}`;
const count = (name, number = 1) => desk.folders.includes(numbered(name, number)) ? count(name, number + 1) : number - 1;
const fresh = (name) => numbered(name, count(name) + 1), newest = (name) => numbered(name, Math.max(1, count(name)));
// What a study needs in turn, with the settings that are usual; each is a command of the list below it.
const TASKS = [["rehearse", "check", { rehearse: true }], ["picture", "feedback preview", { folder: "pictures" }], ["pages", "pages", {}],
  ["people", "simulate", { folder: () => fresh("simulated"), participants: "10" }],
  ["their_report", "report", { data: () => newest("simulated"), folder: () => `${newest("simulated")}-report`, include: "simulated" }],
  ["power", "power", { folder: "power", participants: "12,24", pool: "24", cohorts: "200" }], ["preregistration", "methods", { planned: true }],
  ["computer", "doctor", {}], ["pilot", "run", { participant: "P001", pilot: true }], ["go_on", "resume", { participant: "P001", pilot: true }],
  ["overview", "study", {}], ["report", "report", { include: "pilot", folder: "pilot-report" }], ["tables", "export", { to: "tables", folder: () => fresh("tables"), include: "pilot" }]];
let settings = {}, allOpen = false, task = "";
// The effect whose power is asked for: the first two groups of a study that has groups.
const effect = () => {
  const [one, other] = Object.keys(doc.data?.design?.groups ?? {});
  return other ? { effect: `movement_time~group[${one},${other}]` } : {};
};

const drawDo = async () => {
  desk = await ask("studies");
  desk.jobs.forEach((each) => jobs.set(each.number, each));
  const one = desk.commands.find((each) => each.name === command), sections = [...new Set(desk.commands.map((each) => each.section))];
  const preset = (option) => option.flag === "" && !option.required && option.kind === "text" ? doc.study : "";
  const usual = (name) => typeof settings[name] === "function" ? settings[name]() : settings[name];
  given = Object.fromEntries(one.options.map((each) => [each.name, usual(each.name) ?? (each.kind === "flag" ? null : preset(each))]));
  const input = (option, at) => option.kind === "flag"
    ? h("select", { id: `option-${at}`, onchange: (event) => { given[option.name] = event.target.value === "" ? null : event.target.value === "yes"; } },
      h("option", { value: "" }, t("default")), h("option", { value: "yes", selected: given[option.name] === true }, t("yes")), option.off ? h("option", { value: "no" }, t("no")) : null)
    : h("input", { id: `option-${at}`, value: given[option.name], required: option.required, oninput: (event) => { given[option.name] = event.target.value; } });
  const option = (each, at) => h("div", { className: "field" }, h("label", { htmlFor: `option-${at}` }, each.flag || each.name), input(each, at), h("small", {}, each.help));
  const needed = one.options.filter((each) => each.required || each.name in settings), rest = one.options.filter((each) => !needed.includes(each));
  const pick = (name, how, word = "") => { command = name; task = word; settings = name === "power" ? { ...how, ...effect() } : how; return drawDo(); };
  main.replaceChildren(h("div", { className: "work" },
    h("section", { "aria-label": t("do") }, h("div", { className: "scroll", tabIndex: 0, role: "group", ariaLabel: t("do") },
      h("div", { role: "group", "aria-label": t("tasks") }, h("h2", {}, t("tasks")), h("div", { className: "row" }, TASKS.map(([word, name, how]) =>
        h("button", { "data-place": word, "aria-pressed": String(task === word), onclick: () => pick(name, how, word).then(() => refocus(word)) }, t(word))))),
      h("h2", {}, `labcrane ${one.name}`), h("p", {}, one.help),
      needed.map((each) => option(each, one.options.indexOf(each))),
      h("button", { id: "start", className: "main", onclick: () => inTurn(() => start(given)) }, t("run")),
      h("details", {}, h("summary", {}, `${t("more")} (${rest.length})`), rest.map((each) => option(each, one.options.indexOf(each)))),
      h("details", { id: "all", open: allOpen, ontoggle: ({ target }) => { allOpen = target.open; } }, h("summary", {}, t("commands")),
        sections.map((title) => h("div", { role: "group", "aria-label": title }, h("h2", {}, title), h("div", { className: "row" },
          desk.commands.filter((each) => each.section === title).map((each) => h("button", { "aria-pressed": String(each.name === command), "data-place": each.name,
            onclick: () => pick(each.name, {}).then(() => refocus(command)) }, each.name)))))))),
    h("section", { "aria-label": t("output") }, h("div", { className: "row", id: "jobs" }), h("code", { id: "command" }),
      h("p", { id: "status", role: "status" }), h("pre", { className: "log", id: "log", tabIndex: 0, role: "log", ariaLabel: t("output") }),
      h("div", { id: "links", className: "row" }), h("div", { id: "reports", className: "row" }), h("div", { id: "pictures" }))));
  drawJob();
};
// What runs are the files: all are saved first, and only if nothing has to be asked.
const start = async (given) => {
  if (doc.unsaved || doc.others.length) {
    try {
      take(await ask("save", { revision: doc.revision, every: true }));
    } catch (error) { take(await ask("show")); throw error; }
    if (doc.ask) return;
  }
  const job = await ask("run", { revision: doc.revision, command, given });
  jobs.set(job.number, job);
  shown = job.number;
  drawJob();
};
const drawJob = () => {
  if (!find("jobs")) return;
  if (shown === null && jobs.size) shown = Math.max(...jobs.keys());
  const job = jobs.get(shown);
  find("jobs").replaceChildren(...[...jobs.values()].map((each) => h("button", { "aria-pressed": String(each.number === shown), onclick: () => { shown = each.number; drawJob(); } }, `${each.number + 1} ${each.line.split(" ")[1]}`)),
    job && job.status === null ? h("button", { id: "stop", onclick: () => ask("stop", { number: shown }).then(() => tell(""), tell) }, t("stop")) : "");
  if (!job) { find("status").textContent = t("nothing_run"); return; }
  find("command").textContent = job.line;
  find("status").textContent = job.status === null ? t("running") : job.status === 0 ? t("done") : t("failed", { status: job.status });
  const log = find("log"), low = log.scrollTop + log.clientHeight > log.scrollHeight - 20;
  if (log.textContent !== job.output) { log.textContent = job.output; if (low) log.scrollTop = log.scrollHeight; }
  const draw = (id, parts, made) => {
    const at = find(id), key = JSON.stringify([job.number, parts]);
    if (at.dataset.of !== key) { at.dataset.of = key; at.replaceChildren(...parts.map(made)); }
  };
  draw("reports", [...new Set(job.output.match(/\S+\.html\b/g) ?? [])], (each) => h("button", { onclick: () => ask("look", { number: job.number, path: each }).then(() => tell(""), tell) }, t("open", { name: each })));
  const links = [...job.output.matchAll(/^(.*?):? *(https?:\/\/(?:127\.0\.0\.1|localhost)(?=[:/])\S+)/gm)].map((each) => each.slice(1));
  draw("links", links, ([about, link]) => h("a", { href: link, target: "_blank", rel: "noreferrer", className: "look" }, about || link.split("?")[0]));
  draw("pictures", job.pictures ?? [], (each) => h("img", { className: "seen", src: `/picture/${job.number}/${each}`, alt: each }));
};
setInterval(async () => {
  const job = jobs.get(shown);
  if (view !== "do" || !job || (job.status !== null && job.pictures)) return;
  try { jobs.set(shown, await ask("job", { number: shown })); } catch (error) { tell(error); return; }
  drawJob();
}, POLL_MS);
// Another program may change the file meanwhile.
setInterval(async () => {
  if (!doc || document.hidden) return;
  const now = await ask("show").catch((error) => { tell(error); return null; });
  if (now && doc && now.revision === doc.revision && (now.newer !== doc.newer || now.approved !== doc.approved)) { doc = { ...doc, newer: now.newer, approved: now.approved }; drawBar(); }
}, OLD_MS);

find("language").addEventListener("change", (event) => {
  language = event.target.value;
  localStorage.setItem("labcrane-language", language);
  if (doc) { draw(); check(); } else home();
});
addEventListener("keydown", (event) => {
  if (!(event.ctrlKey || event.metaKey) || !doc) return;
  const name = { s: "save", z: event.shiftKey ? "redo" : "undo", y: "redo" }[event.key.toLowerCase()];
  if (!name || (name !== "save" && document.activeElement.matches("input, textarea:not(#yaml)"))) return;
  event.preventDefault();
  if (name === "save") save(); else change(name);
});
addEventListener("beforeunload", (event) => { if (find("yaml") && doc && find("yaml").value !== doc.text) event.preventDefault(); });

inTurn(async () => {
  desk = await ask("studies");
  if (desk.open) await begin(await ask("show")); else await home();
});
