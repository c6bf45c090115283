// Control room: draws the state of a session from the server, and sends the experimenter's actions.
// Everything it shows comes from `show`; what people write leaves by `order`, and a field is
// emptied only when the server has taken its words: a message lost with a connection is sent again.

import { axes, Chart, short } from "labcrane-chart";

const AGAIN_MS = 2000;
const GOES_TO = { N: "#note-field", H: "#hint-field", Q: ".room-form button, .room-form input", T: "#streams button",
  V: "#faults [id^=again-]", G: "#faults [id^=without-]" };
const TYPES_IN = new Set(["INPUT", "TEXTAREA", "SELECT"]);

export default {
  components: { Chart },
  template: `
<div class="room" :class="{wall}" :data-state="s.state" :data-level="s.lamp.level">
  <div class="room-actions" role="toolbar" aria-label="Actions" v-show="s.state !== 'ended'">
    <button v-for="b in [...s.buttons.filter((one) => !one.danger), ...dangerous]" :key="b.ident" :id="b.ident"
      type="button" @click="press(b)" class="room-button" :class="{primary: b.primary, danger: b.danger}"
      :aria-disabled="b.why ? 'true' : 'false'" :title="b.why || b.label">{{ b.label }} <kbd aria-hidden="true">{{ b.key }}</kbd></button>
    <button type="button" class="room-button quiet" id="help" @click="open('keys')"
      aria-label="Keys">?</button>
    <button type="button" class="room-button quiet" id="theme" @click="theme()">Dark or light</button>
  </div>

  <header class="room-head">
    <div class="room-lamp" :class="s.lamp.level" role="status">
      <span class="room-bulb" aria-hidden="true">{{ mark }}</span>
      <span><strong id="lamp">{{ s.lamp.reason }}</strong>
        <span v-if="s.lamp.remedy" class="room-remedy" id="remedy">{{ s.lamp.remedy }}</span></span>
    </div>
    <div class="room-who">
      <h1 id="who">{{ s.who }}</h1>
      <p id="condition">{{ s.condition }}</p>
    </div>
    <div class="room-now">
      <p class="room-big" id="now">{{ s.now }}</p>
      <p><span class="room-faint">next</span> <span id="next">{{ s.next }}</span></p>
      <p class="room-faint" id="stage" role="status">{{ s.stage }}</p>
    </div>
    <div class="room-left">
      <p class="room-big" id="left">{{ s.left }}</p>
      <progress :value="s.done" :max="s.total || 1" aria-label="trials done"></progress>
      <p class="room-faint" id="progress">{{ s.done }} of {{ s.total }} trials</p>
    </div>
  </header>
  <ol class="room-steps" id="steps" aria-label="Steps of the session">
    <li v-for="(step, at) in s.steps" :key="at" :class="step.state" :aria-current="step.state === 'now' && 'step'">
      {{ step.state === 'done' ? '✓' : '' }} {{ step.name }} <span class="room-faint">{{ step.time }}</span></li></ol>

  <p v-if="s.alarm" id="alarm" role="alert" class="room-alarm">{{ s.alarm }}</p>
  <section v-if="s.faults.length" class="room-card room-faults" id="faults" aria-label="Faults">
    <table><thead><tr><th scope="col">Fault</th><th scope="col">For</th><th scope="col">labcrane</th><th scope="col">What to do</th></tr></thead>
      <tbody><tr v-for="f in s.faults" :key="f.ident" :id="f.ident">
        <td>{{ f.what }}</td><td>{{ f.lasts }}</td><td>{{ f.does }}</td>
        <td>{{ f.todo }} <button v-for="b in [...f.buttons, ...end(f)]" :key="b.ident" type="button" class="room-button" :class="{danger: b.danger}"
          :id="b.ident" @click="press(b)">{{ b.label }} <kbd aria-hidden="true">{{ b.key }}</kbd></button></td>
      </tr></tbody></table>
  </section>
  <section v-if="s.instructions" class="room-card" aria-label="Instructions"><h2>The operator reads</h2>
    <p class="room-lines" id="instructions">{{ s.instructions }}</p></section>
  <div class="room-reports"><slot name="reports"></slot></div>
  <p v-if="told" class="room-told" id="told" role="alert">{{ told }}</p>

  <section v-if="s.report" class="room-card room-report" id="report" data-over :class="s.report.level">
    <h2 id="report-verdict">{{ s.report.verdict }}</h2>
    <p v-if="s.report.remedy" id="report-remedy">{{ s.report.remedy }}</p>
    <h3>Saved</h3>
    <ul id="saved"><li v-for="line in s.report.saved" :key="line">{{ line }}</li></ul>
    <h3>Timestamp accuracy</h3>
    <div class="room-scroll" tabindex="0" role="group" aria-label="Sync report">
      <table id="sync"><thead><tr><th v-for="head in s.report.columns" :key="head" scope="col">
        {{ head }}</th></tr></thead>
        <tbody><tr v-for="(row, at) in s.report.rows" :key="at">
          <td v-for="(cell, of) in row" :key="of">{{ cell }}</td></tr></tbody></table>
    </div>
    <ul><li v-for="line in s.report.advice" :key="line">{{ line }}</li></ul>
    <p v-if="closed" role="status" id="closed">The session's pages are closed. Close this tab.</p>
    <p v-else><button type="button" class="room-button primary" id="close-page" @click="close()">
      Close this page</button> <span class="room-faint">It stays open until you close it, even after a
      reload.</span></p>
  </section>
  <section v-else-if="s.state === 'ended'" class="room-card room-report" id="saving">
    <h2>Saving</h2><p>Writing the participant file and correcting its clocks.</p>
  </section>

  <div class="room-grid">
    <div class="room-column">
      <section class="room-card room-form" v-show="s.state === 'consent' || s.asked"
        aria-label="Questionnaire and consent"><slot name="form"></slot></section>
      <section class="room-card"><h2>Machine</h2><slot name="machine"></slot></section>
      <section class="room-card room-cameras" v-show="s.cameras"><slot name="cameras"></slot></section>
      <section class="room-card" v-show="s.state !== 'ended'" aria-label="Notes and hints">
        <form v-for="field in words" :key="field.order" class="room-words"
          @submit.prevent="send(field)">
          <label :for="field.order + '-field'">{{ field.label }} <kbd aria-hidden="true">{{ field.key }}</kbd></label>
          <input :id="field.order + '-field'" v-model="field.text" autocomplete="off"
            :data-draft="s.who + ' ' + field.order" data-held=""
            :maxlength="field.most">
          <button class="room-button" :id="'order-' + field.order" type="submit">Send</button>
        </form>
      </section>
    </div>
    <div class="room-column">
      <section class="room-card" aria-label="Controls and joints">
        <div v-for="group in s.bars" :key="group.title" class="room-bars">
          <h2>{{ group.title }}</h2>
          <p v-if="group.none" class="room-faint">{{ group.none }}</p>
          <div v-for="bar in group.bars" :key="bar.name" class="room-bar" :class="bar.level">
            <span>{{ bar.name }}</span>
            <span class="room-track" aria-hidden="true"><span class="room-zero"
              :style="{left: bar.zero + '%'}"></span><span class="room-fill"
              :style="{left: bar.from + '%', width: bar.width + '%'}"></span></span>
            <span class="room-value" :id="bar.ident">{{ bar.text }}</span>
          </div>
        </div>
      </section>
      <section class="room-card" v-show="s.performance"><h2>Performance</h2>
        <p class="room-lines" id="performance" role="status">{{ s.performance }}</p></section>
      <section class="room-card"><h2>Latest movements</h2>
        <p v-if="!s.measures.length" class="room-faint">The tasks of this study have no measures.</p>
        <template v-else>
          <label class="room-field">Measure <select id="measure" v-model="measure">
            <option v-for="m in s.measures" :key="m.name" :value="m.name">{{ m.label }}</option>
          </select></label>
          <Chart :option="measured" :label="said"/>
          <p class="room-faint" id="movements">{{ said }}</p>
        </template>
      </section>
      <section class="room-card room-log"><h2>Events</h2>
        <div class="room-filter"><label class="room-field">Show <select id="filter" v-model="kind">
          <option value="">all events</option>
          <option v-for="k in s.kinds" :key="k">{{ k }}</option></select></label>
          <label class="room-field">Find <input id="find" v-model="find" autocomplete="off"></label></div>
        <div id="events" class="room-scroll" tabindex="0" role="log" aria-label="Events">
          <p v-if="!listed.length" class="room-faint">No events to show yet.</p>
          <details v-for="e in listed" :key="e.n" class="room-event" :class="[e.level, e.kind]">
            <summary><time>{{ e.time }}</time> {{ e.text }}</summary><pre>{{ e.raw }}</pre></details>
        </div>
      </section>
    </div>
    <div class="room-column">
      <section class="room-card" id="streams"><h2>Streams</h2>
        <p class="room-faint">{{ s.noStreams }}</p>
        <div v-for="one in s.streams" :key="one.label" class="room-stream" :class="one.level">
          <svg viewBox="0 0 90 24" role="img" :aria-label="'rate of ' + one.label">
            <path :d="trace(one.trace)"/></svg>
          <span><strong>{{ one.label }}</strong> {{ one.words }}
            <span v-for="line in one.lines" :key="line" class="room-line">{{ line }}</span>
            <button v-for="a in one.answers" :key="a.ident" type="button" class="room-button"
              :id="a.ident" @click="press(a)">{{ a.label }}</button></span>
        </div>
      </section>
      <details class="room-card" id="settings" v-show="s.state !== 'ended' && s.settings.length">
        <summary>Cues and sounds</summary>
        <section v-for="one in s.settings" :key="one.name"><h3>{{ one.name }} <span class="room-faint">{{ one.use }}</span></h3>
          <div v-for="c in one.controls" :key="c.ident" class="room-slider">
            <label :for="'setting-' + c.ident" :title="c.about">{{ c.key }}</label>
            <input v-if="c.kind === 'range'" type="range" :id="'setting-' + c.ident" :min="c.low"
              :max="c.high" :step="c.step" :value="c.now" :aria-valuetext="valued(c)"
              @change="set(c, $event.target.value)">
            <select v-else :id="'setting-' + c.ident" :value="String(c.now)"
              @change="set(c, $event.target.value)">
              <option v-for="choice in c.choices" :key="choice">{{ choice }}</option></select>
            <output v-if="c.kind === 'range'" :id="'now-' + c.ident" :class="{changed: c.now !== c.protocol}">{{ valued(c) }}</output>
          </div>
        </section>
      </details>
      <details class="room-card" id="raw"><summary>Internals</summary>
        <p class="room-faint" id="facts">{{ s.facts }}</p>
        <p v-for="question in s.questions" :key="question.ident" :id="question.ident" class="room-question">{{ question.text }}</p>
        <p v-if="!s.late.length" class="room-faint">Waiting for frames from the session.</p>
        <template v-else><Chart :option="lateness" :label="s.lateText"/>
        <p class="room-faint" id="lateness">{{ s.lateText }}</p></template>
      </details>
    </div>
  </div>

  <dialog ref="sure" class="room-dialog" aria-labelledby="sure-asks">
    <p id="sure-asks">{{ asked?.asks }}</p>
    <p><button type="button" class="room-button danger" :id="asked ? asked.ident + '-sure' : 'sure'"
      @keydown.space.prevent @keyup.space.prevent @click="sure()">{{ asked?.label }}</button>
      <button type="button" class="room-button" id="sure-not" @click="$refs.sure.close()">Cancel</button></p>
  </dialog>
  <dialog ref="keys" class="room-dialog" aria-labelledby="keys-title">
    <h2 id="keys-title">Keys</h2>
    <dl class="room-keys"><template v-for="k in [...s.buttons, ...keys]" :key="k.key">
      <dt><kbd>{{ k.key }}</kbd></dt><dd>{{ k.label ?? k.does }}</dd></template></dl>
    <p><button type="button" class="room-button primary" @click="$refs.keys.close()">Close</button></p>
  </dialog>
</div>`,
  props: { first: Object, keys: Array },
  data() {
    return {
      s: this.first, kind: "", find: "", measure: "", told: "", asked: null, closed: false,
      wall: new URLSearchParams(location.search).has("wall"),
      waiting: {}, count: 0,
      words: [
        { order: "note", label: "Note", key: "N", text: "", most: 4000 },
        { order: "hint", label: "Hint to the operator", key: "H", text: "", most: 500 },
      ],
    };
  },
  computed: {
    mark() { return { ok: "✓", warn: "!", bad: "✕" }[this.s.lamp.level]; },
    dangerous() { return this.s.buttons.filter((b) => b.danger); },
    listed() {
      const words = this.find.toLowerCase();
      return this.s.events.filter((e) => (!this.kind || e.kind === this.kind) &&
        (!words || (e.text + e.raw).toLowerCase().includes(words)));
    },
    points() { return this.s.results[this.measure] ?? { mine: [], before: [], cohort: null }; },
    measured() {
      const { mine, before, cohort } = this.points, [low, median, high] = cohort ?? [];
      const dots = (name, values, from, color) => ({ name, type: "scatter", symbolSize: 7, itemStyle: { color },
        data: values.map((v, n) => [from + n + 1, v]) });
      const others = cohort && {
        markArea: { silent: true, itemStyle: { color: "var(--band)" }, data: [[{ yAxis: low }, { yAxis: high }]] },
        markLine: { silent: true, symbol: "none", label: { show: false }, lineStyle: { color: "var(--mine)" }, data: [{ yAxis: median }] },
      };
      return { ...axes("trial, of all sessions", this.s.measures.find((m) => m.name === this.measure)?.label, {}, (cohort ?? []).slice(0, 3)),
        series: [{ ...dots("this session", mine, before.length, "var(--mine)"), ...others }, dots("earlier", before, 0, "var(--before)")] };
    },
    said() {
      const { mine, before, cohort } = this.points;
      const unit = this.s.measures.find((m) => m.name === this.measure)?.unit ?? "";
      const newest = mine.length ? `latest ${short(mine.at(-1))} ${unit}` : "no movement yet";
      const own = before.length ? ` · this participant earlier: ${before.length}` : "";
      const others = cohort
        ? ` · cohort of ${cohort[3]}: median ${short(cohort[1])} ${unit}, interquartile range shaded`
        : " · no cohort to compare with yet";
      return newest + own + others;
    },
    lateness() {
      const line = (name, of) => ({ name, type: "line", symbol: "none", emphasis: { disabled: true }, lineStyle: { color: "var(--fill)" },
        data: this.s.late.map((band, at) => [(at - this.s.late.length) / 2, band[of]]) });
      const tick = { silent: true, symbol: "none", lineStyle: { color: "var(--bad)" }, label: { show: false }, data: [{ yAxis: this.s.tickMs }] };
      return { ...axes("s before now", "late, ms", {}, [0, 2 * this.s.tickMs]), series: [{ ...line("worst", 1), markLine: tick }, line("median", 0)] };
    },
  },
  watch: {
    "s.measures": { immediate: true, handler(now) {
      if (now.length && !now.some((m) => m.name === this.measure)) this.measure = now[0].name;
    } },
  },
  mounted() {
    addEventListener("keydown", this.key);
    this.timer = setInterval(this.again, AGAIN_MS);
  },
  beforeUnmount() {
    removeEventListener("keydown", this.key);
    clearInterval(this.timer);
  },
  methods: {
    show(part) { Object.assign(this.s, part); },
    taken(ident, why) {
      const field = this.waiting[ident]?.field;
      if (field && !why && field.text.trim() === this.waiting[ident].text) {
        field.text = "";
        document.getElementById(`${field.order}-field`).dataset.held = ""; // its draft is forgotten
      }
      delete this.waiting[ident];
      this.told = why;
    },
    again() { for (const ident in this.waiting) this.$emit("order", this.waiting[ident].given); },
    give(order, text, field) {
      const ident = `${Date.now()}-${this.count++}`, given = { ident, order, text };
      this.waiting[ident] = { given, text, field };
      this.$emit("order", given);
    },
    press(b) {
      if (b.why) { this.told = `${b.label}: ${b.why}`; return; }
      this.told = "";
      if (!b.asks) { this.give(b.order, b.text); return; }
      this.asked = b;
      this.$nextTick(() => { if (!this.$refs.sure.open) this.$refs.sure.showModal();
        document.getElementById("sure-not").focus(); }); // Space is pressed all day: it cancels
    },
    sure() { this.give(this.asked.order, this.asked.text); this.$refs.sure.close(); },
    send(field) { const text = field.text.trim(); if (text) this.give(field.order, text, field); },
    end(f) { return f.buttons.length ? this.dangerous.filter((b) => b.order === "end").map((b) => ({ ...b, ident: `end-${f.ident}` })) : []; },
    set(c, value) { this.give("setting", `${c.place}=${value}`); },
    close() { this.closed = true; this.$emit("close"); },
    open(which) { if (!this.$refs[which].open) this.$refs[which].showModal(); },
    key(e) {
      if (e.ctrlKey || e.altKey || e.metaKey || e.repeat) return;
      if (TYPES_IN.has(e.target.tagName) || e.target.isContentEditable) return;
      if (this.$refs.sure.open || this.$refs.keys.open) return;
      const pressable = e.target.tagName === "BUTTON" || e.target.tagName === "SUMMARY";
      if (e.key === " " && pressable) return;
      const key = e.key === " " ? "Space" : e.key.toUpperCase();
      const b = this.s.buttons.find((one) => one.key.toUpperCase() === key.toUpperCase());
      if (b && this.s.state !== "ended") this.press(b);
      else if (key === "?") this.open("keys");
      else if (GOES_TO[key]) document.querySelector(GOES_TO[key])?.focus();
      else if (key === "F") this.cues();
      else if (key === "D") this.theme();
      else if (key === "W") this.wall = !this.wall;
      else return;
      e.preventDefault();
    },
    theme() { labcraneTheme(); },
    cues() {
      const cues = document.getElementById("settings");
      cues.open = true;
      cues.querySelector("input, select")?.focus();
    },
    valued(c) { return typeof c.now === "number" ? `${short(c.now)} ${c.unit}`.trim() : String(c.now); },
    trace(values) {
      const known = values.filter((v) => v !== null);
      if (known.length < 2) return "M0,12L90,12";
      const high = Math.max(...known) || 1;
      return "M" + values.map((v, at) =>
        `${(at * 90 / (values.length - 1)).toFixed(1)},${(22 - 20 * (v ?? 0) / high).toFixed(1)}`).join("L");
    },
  },
};
