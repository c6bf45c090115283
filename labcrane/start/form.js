// Form: fields of a study, made from the JSON Schema and the study's values; it sends one edit for each change.

export const h = (tag, about = {}, ...children) => {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(about)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (key in made && !key.includes("-") && key !== "list") made[key] = value;
    else made.setAttribute(key, value === true ? "" : value);
  }
  made.append(...children.flat(Infinity).filter((each) => each !== null && each !== undefined && each !== false));
  return made;
};

const key = (place) => JSON.stringify(place);
const kindOf = (value) => value === null ? "null" : Array.isArray(value) ? "array" : typeof value;
const typesOf = (schema) => [schema.type ?? []].flat().map((each) => each === "integer" ? "number" : each);

export class Form {
  // `send(how, place, value)` makes an edit; `words` translates; `remedies(finding)` gives its buttons.
  constructor(send, words, remedies) {
    Object.assign(this, { send, words, remedies, opened: new Set(["sessions"].map((each) => key([each]))), chosen: new Map() });
  }

  // Return the form of a study: one section for each key.
  draw(schema, data, found) {
    Object.assign(this, { root: schema, data: data ?? {}, found, count: 0 });
    const top = this.known(schema, this.data), required = top.required ?? [];
    const there = Object.keys(top.properties).filter((name) => name in this.data || required.includes(name));
    const rest = Object.keys(top.properties).filter((name) => !there.includes(name));
    const plain = there.filter((name) => this.simple(top.properties[name], this.data[name]));
    return [
      ...plain.map((name) => this.field(name, top.properties[name], this.data[name], [name], required.includes(name))),
      ...there.filter((name) => !plain.includes(name)).map((name) => this.section(name, top.properties[name], this.data[name])),
      this.more(top, rest, []),
      ...Object.keys(this.data).filter((name) => !(name in top.properties)).map((name) => this.unknown([name], this.data[name])),
    ];
  }

  section(name, schema, value) {
    const place = [name], inside = this.found.filter((one) => one.place[0] === name);
    const mark = inside.length ? h("span", { className: inside.some((one) => one.kind === "problem") ? "problem" : "question" }, ` (${inside.length})`) : null;
    const made = h("details", { className: "top", open: this.opened.has(key(place)) },
      h("summary", { "data-place": key(place) }, this.title(name, schema), mark), this.help(schema), this.inner(schema, value, place));
    made.addEventListener("toggle", () => this.opened[made.open ? "add" : "delete"](key(place)));
    return made;
  }

  resolved(schema) {
    let made = schema ?? {};
    while (made.$ref) { const { $ref, ...rest } = made; made = { ...this.root.$defs[$ref.split("/").pop()], ...rest }; }
    return made;
  }

  // The schema that a value follows: of several the one of its type, and for `use` that of the name.
  known(schema, value) {
    let made = this.resolved(schema);
    const several = made.anyOf ?? made.oneOf;
    if (several) {
      const parts = several.map((each) => this.resolved(each)).filter((each) => each.type !== "null");
      const fits = (each) => each.enum ? each.enum.includes(value) : each.const !== undefined ? each.const === value
        : typesOf(each).includes(kindOf(value)) && (kindOf(value) !== "object" || !each.properties
          || each.additionalProperties !== false || Object.keys(value).every((name) => name in each.properties));
      const { anyOf, oneOf, ...about } = made;
      const words = parts.filter((each) => each.enum || typesOf(each).includes("string"));
      if (words.length === parts.length && parts.length > 1) return { ...about, type: "string", examples: parts.flatMap((each) => each.enum ?? []) };
      made = { ...(parts.find(fits) ?? (value === undefined || value === null ? parts[0] : {})), ...about };
      return this.known(made, value);
    }
    if (made.properties?.use && made.allOf) {
      const one = made.allOf.find((each) => each.if?.properties.use.const === value?.use);
      const settings = one ? this.resolved(one.then) : { properties: {} };
      return { ...made, ...settings, description: settings.description ?? made.description, allOf: undefined,
        properties: { ...settings.properties, use: made.properties.use } };
    }
    return made;
  }

  simple(schema, value) {
    const known = this.known(schema, value);
    return Boolean(known.enum || known.const !== undefined || typesOf(known).some((each) => ["string", "number", "boolean"].includes(each)));
  }

  // Whether an anchor ties a value to another one: it can then be changed in the YAML only.
  isTied(place) {
    return !this.places.has(key(place)) || this.tied.some((one) => key(one) === key(place.slice(0, one.length)));
  }

  title(name, schema) { return this.resolved(schema).title ?? String(name).replaceAll("_", " "); }

  help(schema) {
    const text = this.resolved(schema).description;
    return text ? h("small", { id: `help-${++this.count}` }, text.replaceAll("``", "")) : null;
  }

  messages(place) {
    return this.found.filter((one) => key(one.place) === key(place)).map((one) =>
      h("p", { className: one.kind === "problem" ? "problem" : "question" }, one.message, " ", ...this.remedies(one)));
  }

  field(name, schema, value, place, required) {
    if (!this.simple(schema, value)) {
      return h("div", { className: "field", role: "group", "aria-label": place.join(" ") },
        h("div", { className: "row" }, h("strong", {}, this.title(name, schema)), required ? null : this.remover(place)),
        this.help(schema), this.messages(place), this.inner(schema, value, place));
    }
    const known = this.known(schema, value), help = this.help(schema), messages = this.messages(place);
    const control = this.control(known, value, place, required);
    control.id = `field-${++this.count}`;
    control.setAttribute("data-place", key(place));
    if (help) control.setAttribute("aria-describedby", help.id);
    if (messages.length) control.setAttribute("aria-invalid", "true");
    const tied = value !== undefined && this.isTied(place);
    if (tied) control.disabled = true;
    return h("div", { className: "field" }, h("label", { htmlFor: control.id }, this.title(name, schema)), control,
      tied ? h("small", { className: "question" }, this.words("tied"), " ") : null, help,
      this.files?.includes(value) ? h("button", { onclick: () => this.openFile(value) }, this.words("open", { name: value })) : null, messages);
  }

  control(schema, value, place, required) {
    const unset = value === undefined, change = (made) => {
      if (made === "" && !required) { if (!unset) this.send("remove", place); } else if (made !== value) this.send("set", place, made);
    };
    const choices = schema.enum ?? (typesOf(schema).includes("boolean") ? [true, false] : null);
    if (choices) {
      const shown = (each) => each === true ? this.words("yes") : each === false ? this.words("no") : String(each);
      const names = [...new Set(unset || choices.includes(value) ? choices : [value, ...choices])];
      const default_ = schema.default === undefined || schema.default === null ? "" : ` (${shown(schema.default)})`;
      return h("select", { onchange: (event) => change(event.target.value === "" ? "" : JSON.parse(event.target.value)) },
        required && !unset ? null : h("option", { value: "" }, this.words("default") + default_),
        names.map((each) => h("option", { value: JSON.stringify(each), selected: each === value }, shown(each))));
    }
    const number = typesOf(schema).includes("number");
    const read = (text) => number && text.trim() !== "" && Number.isFinite(Number(text)) ? Number(text) : text;
    const long = typeof value === "string" && value.includes("\n");
    const placeholder = schema.default === undefined || schema.default === null ? "" : String(schema.default);
    const made = h(long ? "textarea" : "input", { defaultValue: value ?? "", placeholder, readOnly: schema.const !== undefined,
      rows: long ? 4 : undefined, onchange: ({ target }) => { target.defaultValue = target.value; change(read(target.value)); } });
    const names = this.names(schema, place);
    if (names.length && !long) {
      const list = h("datalist", { id: `names-${++this.count}` }, names.map((each) => h("option", { value: each })));
      made.setAttribute("list", list.id);
      (this.lists ??= document.body).append(list);
    }
    return made;
  }

  // Names that a text may refer to: those below the key of the same name, and files.
  names(schema, place) {
    const last = [...place].reverse().find((each) => typeof each === "string") ?? "";
    const below = this.data[`${last}s`] ?? this.data[last];
    const own = below && kindOf(below) === "object" ? Object.keys(below) : [];
    return [...(schema.examples ?? []).filter((each) => typeof each === "string"), ...own, ...(last === "instructions" || last === "consent" ? this.files ?? [] : [])];
  }

  inner(schema, value, place) {
    const known = this.known(schema, value);
    if (kindOf(value) === "array" || (value === undefined && typesOf(known).includes("array"))) return this.list(known, value ?? [], place);
    if (known.properties && kindOf(value ?? {}) === "object") return this.object(known, value ?? {}, place);
    if (known.additionalProperties && kindOf(value ?? {}) === "object") return this.map(known, value ?? {}, place);
    if (this.simple(schema, value)) return this.field(place.at(-1), schema, value, place, true);
    return this.unknown(place, value);
  }

  object(schema, value, place) {
    const required = schema.required ?? [], all = Object.keys(schema.properties);
    const there = all.filter((name) => name in value || required.includes(name));
    there.sort((a, b) => (b === "use") - (a === "use"));
    return h("div", { className: "group" },
      there.map((name) => this.field(name, schema.properties[name], value[name], [...place, name], required.includes(name))),
      this.more(schema, all.filter((name) => !there.includes(name)), place),
      Object.keys(value).filter((name) => !(name in schema.properties)).map((name) => this.unknown([...place, name], value[name])));
  }

  // Settings that the study does not have yet; they are made when they are looked at.
  more(schema, all, place) {
    const names = all.filter((name) => this.resolved(schema.properties[name]).const === undefined); // one value: no choice
    if (!names.length) return null;
    const own = `more ${key(place)}`, made = h("details", { open: this.opened.has(own) },
      h("summary", { "data-place": own }, `${this.words("more")} (${names.length})`));
    const fill = () => made.childElementCount > 1 || made.append(...names.map((name) => {
      const inner = schema.properties[name], at = [...place, name];
      if (this.simple(inner, undefined)) return this.field(name, inner, undefined, at, false);
      const help = this.help(inner);
      return h("div", { className: "field" }, h("div", { className: "row" }, h("strong", {}, this.title(name, inner)),
        this.button("add", () => { this.opened.add(key([at[0]])); this.send("set", at, this.skeleton(inner, name)); }, at)), help);
    }));
    if (made.open) fill();
    made.addEventListener("toggle", () => { this.opened[made.open ? "add" : "delete"](own); fill(); });
    return made;
  }

  map(schema, value, place) {
    const name = h("input", { "aria-label": `${this.words("name")}: ${place.join(" ")}`, placeholder: this.words("name"), "data-place": key([...place, "+"]) });
    const add = () => { name.defaultValue = name.value; if (name.value.trim() && !Object.hasOwn(value, name.value.trim())) this.send("set", [...place, name.value.trim()], this.skeleton(schema.additionalProperties, name.value.trim())); };
    name.addEventListener("keydown", (event) => { if (event.key === "Enter") add(); });
    return h("div", { className: "group" },
      Object.entries(value).map(([own, each]) => h("div", { className: "field", role: "group", "aria-label": own },
        h("div", { className: "row" }, h("strong", {}, own), this.remover([...place, own])),
        this.messages([...place, own]), this.simple(schema.additionalProperties, each)
          ? this.field(own, schema.additionalProperties, each, [...place, own], true)
          : this.inner(schema.additionalProperties, each, [...place, own]))),
      h("div", { className: "row" }, h("div", {}, name), this.button("add", add, [...place, "+"])));
  }

  list(schema, value, place) {
    const items = this.resolved(schema.items ?? {}), kinds = this.kinds(items);
    if (kinds.length) return this.strip(items, kinds, value, place);
    const of = (at) => schema.prefixItems?.[at] ?? items;
    return h("div", { className: "group" },
      value.map((each, at) => h("div", { className: "field" },
        this.simple(of(at), each) ? this.field(at + 1, { ...of(at), title: undefined, description: undefined }, each, [...place, at], true) : this.inner(of(at), each, [...place, at]),
        h("div", { className: "row" }, this.movers(value, at, place), this.remover([...place, at])))),
      this.button("add", () => this.send("insert", [...place, value.length], this.skeleton(of(value.length), "")), [...place, value.length]));
  }

  // The kinds of a list whose items are each one key and its value, as the steps of a session.
  kinds(items) {
    const one = (items.anyOf ?? []).map((each) => this.resolved(each)).find((each) => each.maxProperties === 1 && each.properties);
    return one ? [...items.anyOf.filter((each) => each.const).map((each) => each.const), ...Object.keys(one.properties)] : [];
  }

  strip(items, kinds, value, place) {
    const properties = items.anyOf.find((each) => each.properties).properties;
    const kind = (step) => typeof step === "string" ? step : Object.keys(step ?? {})[0] ?? "?";
    const about = (step) => { const own = step?.[kind(step)]; return typeof own === "string" ? own : own?.task ?? own?.name ?? own?.seconds ?? (Array.isArray(own) ? own.join(", ") : ""); };
    const now = Math.min(this.chosen.get(key(place)) ?? 0, value.length - 1);
    const choose = (at) => { this.chosen.set(key(place), at); this.redraw([...place, at]); };
    const step = value[now], select = h("select", { "aria-label": this.words("kind") }, kinds.map((each) => h("option", {}, each)));
    const inner = step === undefined ? null : typeof step === "string" ? null : kind(step) in properties
      ? (this.simple(properties[kind(step)], step[kind(step)])
        ? this.field(kind(step), properties[kind(step)], step[kind(step)], [...place, now, kind(step)], true)
        : this.inner(properties[kind(step)], step[kind(step)], [...place, now, kind(step)])) : this.unknown([...place, now], step);
    const add = () => {
      const own = select.value in properties ? { [select.value]: this.skeleton(properties[select.value], select.value) } : select.value;
      this.chosen.set(key(place), now + 1);
      this.send("insert", [...place, now + 1], own);
    };
    return h("div", { className: "group" },
      h("ol", { className: "strip" }, value.map((each, at) => h("li", {}, h("button", { "aria-pressed": String(at === now), "data-place": key([...place, at]),
        className: this.found.some((one) => key(one.place).startsWith(key([...place, at]).slice(0, -1))) ? "problem" : "", onclick: () => choose(at) },
      `${at + 1} ${kind(each)}`, h("small", {}, String(about(each))))))),
      h("div", { className: "row" }, select, this.button("add_step", add, [...place, "add"]),
        step === undefined ? null : [this.movers(value, now, place, (to) => this.chosen.set(key(place), to)), this.remover([...place, now])]),
      ["consent", "instructions", "questionnaire"].includes(kind(step)) ? this.button("pages", () => this.preview(), [...place, now, "pages"]) : null,
      step === undefined ? null : this.messages([...place, now]), inner);
  }

  movers(value, at, place, then = () => {}) {
    const move = (to) => { then(to); this.send("move", [...place, at], to); };
    return [this.button("earlier", at > 0 && (() => move(at - 1)), [...place, at, "earlier"]),
      this.button("later", at < value.length - 1 && (() => move(at + 1)), [...place, at, "later"])];
  }

  remover(place) { return this.button("remove", () => this.send("remove", place), [...place, "remove"], place.at(-1)); }

  button(word, run, place, about = "") {
    const said = typeof about === "number" ? about + 1 : about;
    return h("button", { disabled: !run, onclick: run || undefined, "data-place": key(place), "aria-label": said === "" ? undefined : `${this.words(word)}: ${said}` }, this.words(word));
  }

  // What the form cannot show is shown as text; it is changed in the YAML beside it.
  unknown(place, value) {
    return h("div", { className: "field" }, h("strong", {}, String(place.at(-1))), h("small", {}, this.words("as_text")),
      this.messages(place), h("pre", {}, JSON.stringify(value ?? null)));
  }

  // A value to begin with: what the schema requires, and no more.
  skeleton(schema, name) {
    const whole = this.resolved(schema), known = this.known(schema, undefined);
    if (known.const !== undefined) return known.const;
    if (whole.properties?.use && whole.allOf) {
      const use = whole.properties.use.enum.includes(name) ? name : whole.properties.use.enum[0];
      const own = this.known(schema, { use });
      return { use, ...this.required(own) };
    }
    if (known.enum) return known.enum[0];
    if (known.properties) return this.required(known);
    const types = typesOf(known);
    if (types.includes("array")) return known.minItems ? [this.skeleton(known.items, name)] : [];
    if (types.includes("object")) return {};
    if (types.includes("number")) return known.minimum ?? (known.exclusiveMinimum ?? 0) + 1;
    if (types.includes("boolean")) return true;
    return this.names(known, [name])[0] ?? "";
  }

  required(known) {
    const names = (known.required ?? []).filter((name) => name !== "use");
    return Object.fromEntries(names.map((name) => [name, this.skeleton(known.properties[name], name)]));
  }
}
