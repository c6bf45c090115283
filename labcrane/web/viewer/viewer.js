// Viewer of a recorded session: a timeline, curves and events around a time that the page requests.
// Whatever is asked is asked again until it is answered: a message is lost with its connection.

import { axes, Chart, short } from "labcrane-chart";

const STEP_MS = 60, AGAIN_MS = 2000, SOON_MS = 150, BEHIND_S = 0.1;

export default {
  components: { Chart },
  template: `
<div class="room view">
  <header class="view-head">
    <h1 id="title">{{ about.title }}</h1>
    <p class="room-faint" id="said">{{ about.said }}</p>
    <p v-for="line in about.lacking" :key="line" class="room-question">{{ line }}</p>
    <p v-if="why" class="room-question" role="alert" id="why">{{ why }}</p>
  </header>
  <div class="view-grid">
    <section class="room-card view-machine"><slot name="machine"></slot></section>
    <section class="room-card"><h2>Curves</h2>
      <div v-for="(chart, at) in charts" :key="at" class="view-chart">
        <div class="view-pick"><label class="room-field">Signal {{ at + 1 }} <select :id="'signal-' + at" v-model="chart.signal"
          @change="ask(at)"><option value="">none</option>
          <option v-for="(one, n) in about.signals" :key="n" :value="n">{{ one.label }}{{ one.unit && one.unit !== '1' ? ', ' + one.unit : '' }}</option>
        </select></label>
        <label v-if="chart.signal !== ''" class="room-field">as <select :id="'as-' + at" v-model="chart.as"
          @change="ask(at)"><option value="curve">curve</option><option value="spectrogram">spectrogram</option>
        </select></label></div>
        <div v-show="chart.as === 'spectrogram' && chart.signal !== ''" class="view-spectrum">
          <div class="view-plot"><canvas :id="'spectrum-' + at" width="300" height="128" role="img"
            :aria-label="'spectrogram of signal ' + (at + 1)" @click="into($event, chart)"></canvas>
            <span class="view-now" aria-hidden="true" :style="now(chart)"></span></div>
          <p class="room-faint" :id="'heard-' + at">{{ chart.heard }}</p></div>
        <div v-if="chart.option" class="view-plot" @wheel.prevent="zoom($event)">
          <Chart :option="chart.option" :label="'signal ' + (at + 1)" group="curves" @go="go"/>
          <span class="view-frame" aria-hidden="true"><span class="view-now" :style="now(chart)"></span></span></div>
        <p v-if="chart.option" class="room-faint" :id="'range-' + at"><strong :id="'value-' + at">{{ reading(chart) }}</strong> now · {{ chart.said }}</p>
      </div>
    </section>
  </div>
  <section class="room-card view-time" aria-label="Time">
    <div class="view-controls" role="toolbar" aria-label="Playing">
      <button type="button" class="room-button primary" id="play" @click="play()">{{ playing ? 'Pause' : 'Play' }} <kbd aria-hidden="true">Space</kbd></button>
      <button type="button" class="room-button" id="before" @click="trial(-1)">Trial before</button>
      <button type="button" class="room-button" id="after" @click="trial(1)">Trial after</button>
      <label class="room-field">Speed <select id="speed" v-model.number="speed">
        <option v-for="one in [0.1, 0.25, 0.5, 1, 2, 5, 10, 50]" :key="one" :value="one">{{ one }}×</option></select></label>
      <label class="room-field">Second <input id="second" type="number" min="0" :max="about.length" step="any"
        :value="t.toFixed(2)" @change="go(Number($event.target.value))"></label>
      <label class="room-field">Shown <select id="span" v-model.number="span" @change="go(t); askAll()">
        <option :value="0">all</option><option v-for="one in widths" :key="one" :value="one">{{ Number(one.toPrecision(3)) }} s</option></select></label>
      <strong id="clock">{{ clock(t) }} of {{ clock(about.length) }}</strong>
    </div>
    <input type="range" id="scrub" class="view-scrub" aria-label="Time in seconds" min="0" :max="about.length" step="0.01"
      :value="t" :aria-valuetext="clock(t)" @input="go(Number($event.target.value))">
    <div class="view-plot"><svg class="view-line" viewBox="0 0 600 46" preserveAspectRatio="none" role="img"
      :aria-label="about.trials.length + ' trials and ' + about.events.length + ' events'" @click="into($event)">
      <rect v-for="(one, n) in spans" :key="n" :class="one.kind" :x="one.x" :width="one.width" y="2" height="20"/>
      <rect v-for="(one, n) in holes" :key="'g' + n" class="view-gap" :x="one.x" :width="one.width" y="0" height="46"/>
      <path class="view-ticks" :d="ticks"/>
      <rect v-for="(one, n) in breaks" :key="'b' + n" :class="'view-' + one.kind" :x="one.x" :width="one.width" :y="one.kind === 'lost' ? 35 : 40" height="5"><title>{{ one.text }}</title></rect>
      <rect v-for="(one, n) in marksHere" :key="'m' + n" class="view-mark" :x="one.x" :width="one.width" y="22" height="8"><title>{{ one.text }}</title></rect></svg>
      <span class="view-now" aria-hidden="true" :style="now()"></span></div>
    <p class="room-faint view-legend"><span class="view-swatch success"></span>success
      <span class="view-swatch other"></span>other end <span class="view-swatch approach"></span>not counted
      <span class="view-swatch gap"></span>no frames <span class="view-swatch paused"></span>paused
      <span class="view-swatch lost"></span>controls, feedback or a stream lost
      <span class="view-swatch mark"></span>your marks</p>
  </section>
  <section v-if="about.filmed.length" class="room-card"><h2>Recordings</h2>
    <div class="view-films"><figure v-for="name in about.filmed" :key="name">
      <img v-if="films[name].src" :id="'film-' + name" :src="films[name].src" :data-at="films[name].at" :alt="'picture of ' + name">
      <label v-if="films[name].sound" class="room-field"><input type="checkbox" :id="'hear-' + name" @change="hear(name)"> Hear it</label>
      <audio :id="'sound-' + name"></audio>
      <p v-if="films[name].said" :id="'film-said-' + name" class="view-none">{{ films[name].said }}</p>
      <figcaption class="room-faint">{{ name }}{{ films[name].since === undefined ? '' : ', frame of second ' + films[name].since.toFixed(3) }}</figcaption></figure></div>
  </section>
  <section v-if="about.gaze" class="room-card"><h2>Gaze</h2>
    <p id="looked"><strong>{{ glance.looked || 'no area' }}</strong> <span class="room-faint">is looked at, in the latest picture of the view; the display's delay is not subtracted</span></p>
    <svg id="gaze" class="view-gaze" :viewBox="picture" role="img" :aria-label="'gaze, at ' + (glance.looked || 'no area')">
      <g v-for="a in glance.areas" :key="a.name"><rect :class="{ looked: a.name === glance.looked }" :x="a.box[0]" :y="a.box[1]" :width="a.box[2] - a.box[0]" :height="a.box[3] - a.box[1]"><title>{{ a.name }}</title></rect></g>
      <polyline v-if="glance.trail.length > 1" :points="glance.trail.join(' ')"/>
      <circle v-if="glance.trail.length" :cx="glance.trail.at(-1)[0]" :cy="glance.trail.at(-1)[1]" :r="extent.width / 80"/></svg>
    <div class="view-plot"><svg class="view-lane" viewBox="0 0 600 20" preserveAspectRatio="none" role="img" aria-label="areas looked at over time" @click="into($event, lane)">
      <rect v-for="(one, n) in lookedAt" :key="n" :fill="one.colour" :x="one.x" :width="one.width" y="0" height="20"><title>{{ one.name }}</title></rect></svg>
      <span class="view-now" aria-hidden="true" :style="now(lane)"></span></div>
    <p class="room-faint view-legend"><template v-for="(name, n) in areaNames" :key="name"><span class="view-swatch" :style="{ background: colour(n) }"></span>{{ name }}</template></p>
  </section>
  <section v-if="about.marking" class="room-card"><h2>Annotations</h2>
    <p class="room-faint">They are saved next to the recording and included in exports and the report; the recording is not changed. Write no names.</p>
    <form class="view-controls" @submit.prevent="mark()">
      <label class="room-field view-words">Annotation <input id="mark-text" v-model="words" maxlength="4000" autocomplete="off"></label>
      <button type="button" class="room-button" id="mark-from" :aria-pressed="from !== null" @click="from = from === null ? t : null">{{ from === null ? 'Begin here' : 'Begins at ' + clock(from) }}</button>
      <button type="submit" class="room-button" id="mark-add" :disabled="!words.trim()">{{ from === null ? 'Annotate this moment' : 'Annotate until here' }}</button>
    </form>
    <form class="view-controls" @submit.prevent="define()">
      <label class="room-field">Coder <input id="coder" v-model="coder" maxlength="40" autocomplete="off" size="6"></label>
      <button v-for="one in codes" :key="one.key" type="button" class="room-button" :id="'code-' + one.key" :aria-pressed="one.key in lasting" @click="coded(one.key)">{{ one.name }}{{ one.key in lasting ? ' since ' + clock(lasting[one.key].t) : '' }} <kbd aria-hidden="true">{{ one.key }}</kbd></button>
      <label class="room-field">Key <input id="code-key" v-model="fresh.key" maxlength="1" size="1" autocomplete="off"></label>
      <label class="room-field">annotates <input id="code-name" v-model="fresh.name" maxlength="200" autocomplete="off"></label>
      <label class="room-field"><input type="checkbox" id="code-lasts" v-model="fresh.lasts"> lasts until it is pressed again</label>
      <button type="submit" class="room-button" id="code-add" :disabled="!free()">Add key</button>
    </form>
    <p id="mark-said" role="status" :class="markSaid.startsWith('not kept') ? 'room-question' : 'room-faint'">{{ markSaid }}</p>
    <div id="marks" class="room-scroll" tabindex="0" role="group" aria-label="Annotations">
      <p v-if="!marks.length" class="room-faint">None yet. Go to a moment, press M, and describe what you see.</p>
      <div v-for="m in marks" :key="m.number" class="view-marked">
        <button type="button" class="view-event" @click="go(m.t)"><span>{{ clock(m.t) }}{{ m.to > m.t ? ' to ' + clock(m.to) : '' }}</span> {{ m.text }}{{ m.coder ? ' (' + m.coder + ')' : '' }}</button>
        <button type="button" class="room-button" :aria-label="'Withdraw: ' + m.text" @click="withdraw(m)">Withdraw</button></div></div>
  </section>
  <section class="room-card"><h2>Events</h2>
    <label class="room-field">Find <input id="find" v-model="find" autocomplete="off"></label>
    <div id="events" class="room-scroll" tabindex="0" role="group" aria-label="Events">
      <button v-for="(e, n) in listed" :key="n" type="button" class="view-event" :class="e.level"
        @click="go(e.t)"><span>{{ clock(e.t) }}</span> {{ e.text }}</button></div>
  </section>
</div>`,
  props: { about: Object },
  data() {
    return { open: {}, next: {}, films: Object.fromEntries(this.about.filmed.map((name) => [name, {}])), heard: {}, codes: [...this.about.codes], coder: this.about.coder, lasting: {}, fresh: { key: "", name: "", lasts: false }, why: "", glance: { areas: [], trail: [], looked: "" }, extent: { width: 1, height: 1 }, lane: { names: [], begin: 0, end: 1 }, words: "", from: null, marks: this.about.marks, markSaid: this.about.markSaid, t: 0, speed: 1, span: 0, playing: false, find: "", came: 0, asked: 0,
      charts: [0, 1, 2].map(() => ({ signal: "", option: null, said: "", as: "curve", heard: "", values: null, begin: 0, end: 1 })) };
  },
  computed: {
    begin() { return this.span ? Math.min(Math.max(0, this.t - this.span / 2), Math.max(0, this.about.length - this.span)) : 0; },
    end() { return this.span ? Math.min(this.begin + this.span, this.about.length) : this.about.length; },
    spans() {
      return this.about.trials.filter((one) => one.to >= this.begin && one.from <= this.end).map((one) => ({
        x: this.place(one.from), width: Math.max(0.5, this.place(one.to) - this.place(one.from)),
        kind: !one.counted ? "approach" : one.outcome === "success" ? "success" : "other",
      }));
    },
    widths() { return [...new Set([600, 60, 20, 5, this.span || 5])].sort((one, other) => other - one); },
    bands() { // behind the curves: trials, pauses, losses, and where no frame is
      const band = (from, to, color) => [{ xAxis: from, itemStyle: { color, opacity: 0.2 } }, { xAxis: to }];
      return [...this.about.trials.filter((one) => one.counted).map((one) => band(one.from, one.to, "var(--band)")),
        ...this.about.gaps.map(([from, to]) => band(from, to, "#cc79a7")),
        ...this.about.breaks.map((one) => band(one.from, one.to, one.kind === "lost" ? "#9b1c1c" : "#e69f00"))];
    },
    picture() { return `0 0 ${this.extent.width} ${this.extent.height}`; },
    areaNames() { return [...new Set(this.lane.names.filter(Boolean))].sort(); },
    lookedAt() { // neighbouring steps at one area are one
      const found = [], step = 600 / this.lane.names.length;
      this.lane.names.forEach((name, n) => {
        if (!name) return;
        const last = found.at(-1);
        if (last?.name === name && last.upto === n) { last.width += step; last.upto = n + 1; }
        else found.push({ name, x: n * step, width: step, upto: n + 1, colour: this.colour(this.areaNames.indexOf(name)) });
      });
      return found;
    },
    marksHere() {
      return this.marks.filter((one) => one.to >= this.begin && one.t <= this.end)
        .map((one) => ({ text: one.text, x: this.place(one.t), width: Math.max(1.5, this.place(one.to) - this.place(one.t)) }));
    },
    holes() {
      return this.about.gaps.map(([from, to]) => ({ x: this.place(from), width: Math.max(1, this.place(to) - this.place(from)) }));
    },
    breaks() {
      return this.about.breaks.filter((one) => one.to >= this.begin && one.from <= this.end).map((one) => ({
        kind: one.kind, text: one.text, x: this.place(one.from), width: Math.max(1.5, this.place(one.to) - this.place(one.from)),
      }));
    },
    ticks() {
      return this.about.events.filter((e) => e.t >= this.begin && e.t <= this.end)
        .map((e) => `M${this.place(e.t).toFixed(1)},${e.kind === "notes" ? 24 : 30}V44`).join("");
    },
    listed() {
      const words = this.find.toLowerCase();
      const some = this.about.events.filter((e) => !words || e.text.toLowerCase().includes(words));
      const near = some.findIndex((e) => e.t >= this.t - 5);
      return words ? some.slice(0, 200) : some.slice(Math.max(0, near), Math.max(0, near) + 60);
    },
  },
  mounted() {
    addEventListener("keydown", this.key);
    const first = this.about.signals.findIndex((one) => one.column.startsWith("tip.position"));
    this.charts.forEach((chart, n) => { // the tip's three ways, before anything is chosen
      const at = this.about.signals.findIndex((one) => one.column === `tip.position.${"xyz"[n]}`);
      chart.signal = at >= 0 ? at : n === 0 && first >= 0 ? first : "";
    });
    this.timer = setInterval(this.step, STEP_MS);
    this.asking = setInterval(this.again, AGAIN_MS);
    this.askAll();
    this.go(this.about.at);
  },
  beforeUnmount() { removeEventListener("keydown", this.key); clearInterval(this.timer); clearInterval(this.asking); },
  methods: {
    place(t, { begin, end } = this) { return 600 * (t - begin) / Math.max(1e-9, end - begin); },
    now(shown) { return { transform: `translateX(${this.place(this.t, shown) / 6}%)` }; }, // moved over a curve, which is not painted again
    question(key, about) { // one of a key at a time: the newest is asked when the one before is answered
      const asked = { key, ident: ++this.asked, ...about };
      if (this.open[key]) { this.next[key] = asked; return; }
      this.open[key] = asked;
      this.$emit("asked", asked);
    },
    again() { for (const key in this.open) this.$emit("asked", this.open[key]); },
    answered(key, ident, found) {
      const asked = this.open[key], next = this.next[key];
      if (asked?.ident !== ident) return; // answered before
      delete this.open[key];
      delete this.next[key];
      if (next) { this.open[key] = next; this.$emit("asked", next); }
      this.why = found.failed ?? "";
      if (found.failed === undefined) this.take(asked, found, Boolean(next));
    },
    take(asked, found, outdated) {
      if (asked.kind === "mark") this.marked(asked, found);
      else if (asked.kind === "second") { if (this.about.gaze) this.glanced(found); }
      else if (asked.kind === "picture") this.films[asked.name] = { ...found, at: asked.t };
      else if (outdated) return;
      else if (asked.kind === "sound") this.sounds(asked, found);
      else if (asked.kind === "lane") this.lane = { names: found.lane, begin: asked.begin, end: asked.end };
      else this.curve(asked, found);
    },
    go(t) {
      const before = this.begin;
      this.t = Math.min(Math.max(0, t || 0), this.about.length);
      this.question("second", { kind: "second", t: this.t });
      for (const name of this.about.filmed) this.question(`film ${name}`, { kind: "picture", name, t: this.t });
      if (this.begin !== before) this.askSoon();
    },
    step() {
      const now = performance.now(), passed = (now - this.came) / 1000;
      this.came = now;
      this.listen();
      if (!this.playing) return;
      if (this.t >= this.about.length) { this.playing = false; return; }
      if (this.about.filmed.some((name) => this.open[`film ${name}`]) && Math.abs(this.t - this.seen()) > BEHIND_S) return; // pictures are in step
      this.go(this.t + passed * this.speed);
    },
    hear(name) {
      if (name in this.heard) { document.getElementById(`sound-${name}`).pause(); delete this.heard[name]; }
      else this.heard[name] = NaN; // no piece of sound yet
    },
    listen() { // what is played is heard, a piece at a time
      for (const name in this.heard) {
        const player = document.getElementById(`sound-${name}`), at = this.t - this.heard[name], key = `sound ${name}`;
        if (!this.playing || this.speed < 0.25 || this.speed > 5) player.pause();
        else if (!(at >= 0 && at < this.about.soundLasts)) { if (!this.open[key]) this.question(key, { kind: "sound", name, t: this.t }); }
        else {
          player.playbackRate = this.speed;
          if (Math.abs(player.currentTime - at) > 0.1) player.currentTime = at;
          player.play().catch(() => {}); // it is asked to play at each step
        }
      }
    },
    sounds({ name, t }, { src }) {
      if (!(name in this.heard)) return;
      document.getElementById(`sound-${name}`).src = src;
      this.heard[name] = t;
    },
    play() { this.playing = !this.playing; if (this.playing && this.t >= this.about.length) this.go(0); },
    trial(way) {
      const starts = this.about.trials.filter((one) => one.counted).map((one) => one.from);
      const next = way > 0 ? starts.find((t) => t > this.t + 1e-6) : starts.filter((t) => t < this.t - 0.5).at(-1);
      if (next !== undefined) this.go(next);
    },
    into(e, { begin, end } = this) {
      const box = e.currentTarget.getBoundingClientRect();
      this.go(begin + (end - begin) * (e.clientX - box.left) / box.width);
    },
    zoom({ deltaY }) { // about the time that is shown
      const span = (this.span || this.about.length) * (deltaY < 0 ? 0.8 : 1.25);
      this.span = span < this.about.length ? Math.max(1, span) : 0;
      this.askSoon();
    },
    mark() {
      if (!this.words.trim()) return;
      const other = this.from === null ? this.t : this.from;
      this.change({ t: Math.min(other, this.t), to: Math.max(other, this.t), text: this.words, coder: this.coder });
    },
    free() {
      const { key, name } = this.fresh;
      return key && name.trim() && !this.about.taken.includes(key) && !this.codes.some((one) => one.key === key);
    },
    define() {
      if (!this.free()) return;
      this.codes.push({ ...this.fresh });
      this.fresh = { key: "", name: "", lasts: false };
    },
    seen() { // the time of the picture that is on the screen, which is a little behind while it plays
      const shown = this.playing ? this.about.filmed.map((name) => this.films[name]?.at).filter(Number.isFinite) : [];
      return shown.length ? Math.max(...shown) : this.t;
    },
    coded(key) { // a moment; of what lasts, the beginning is saved at once, and replaced when it ends
      const { name, lasts } = this.codes.find((one) => one.key === key), begun = this.lasting[key];
      const t = this.seen(), said = { t, to: t, text: name, coder: this.coder };
      if (begun && begun.number === null) return; // its beginning is not saved yet
      if (begun) {
        delete this.lasting[key];
        this.change({ ...said, t: Math.min(begun.t, t), to: Math.max(begun.t, t), withdraw: begun.number });
      } else if (lasts) {
        this.lasting[key] = { t, number: null };
        this.change({ ...said, begins: key });
      } else this.change(said);
    },
    withdraw(mark) { this.change({ withdraw: mark.number }); },
    change(what) { this.question(`mark ${this.asked}`, { kind: "mark", ...what }); }, // none replaces another
    marked({ begins, text }, { marks, markSaid, made }) { // what was written stays until it is kept
      if (begins && made) this.lasting[begins].number = made;
      else if (begins) delete this.lasting[begins];
      this.marks = marks;
      this.markSaid = markSaid;
      if (markSaid === "kept" && text === this.words) { this.words = ""; this.from = null; }
    },
    askSoon() { this.soon ??= setTimeout(() => { this.soon = null; this.askAll(); }, SOON_MS); }, // also while it plays
    askAll() {
      this.charts.forEach((_, at) => this.ask(at));
      if (this.about.gaze) this.question("lane", { kind: "lane", begin: this.begin, end: this.end });
    },
    colour(n) { return ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#999999"][n % 8]; },
    glanced(found) {
      this.glance = found;
      const right = [...found.areas.map((a) => a.box[2]), ...found.trail.map((p) => p[0])];
      const below = [...found.areas.map((a) => a.box[3]), ...found.trail.map((p) => p[1])];
      this.extent = { width: Math.max(this.extent.width, ...right), height: Math.max(this.extent.height, ...below) };
    },
    ask(at) {
      const chart = this.charts[at];
      if (chart.signal === "") { chart.option = null; return; }
      const { stream, column } = this.about.signals[chart.signal];
      if (chart.as === "spectrogram") chart.option = null;
      this.question(`chart ${at}`, { kind: chart.as, at, stream, column, begin: this.begin, end: this.end });
    },
    curve({ at, kind, begin, end }, found) {
      if (this.charts[at].signal === "") return; // taken away meanwhile
      Object.assign(this.charts[at], { begin, end });
      if (kind === "spectrogram") this.spectrum(at, found);
      else this.drawn(at, found);
    },
    spectrum(at, { levels, top_hz, most_db, why }) { // faint to loud as black, violet, orange, white
      const canvas = document.getElementById(`spectrum-${at}`), paint = canvas.getContext("2d");
      paint.clearRect(0, 0, canvas.width, canvas.height);
      this.charts[at].heard = why ?? (most_db === null ? "no value here"
        : `up to ${top_hz.toPrecision(4)} Hz, from ${(most_db - 80).toFixed(0)} to ${most_db.toFixed(0)} dB`);
      if (!levels) return;
      const image = paint.createImageData(canvas.width, canvas.height);
      levels.forEach((row, x) => row?.forEach((v, y) => {
        const place = 4 * ((canvas.height - 1 - y) * canvas.width + x), u = v / 255;
        image.data.set([255 * Math.min(1, 2 * u), 255 * Math.max(0, 2 * u - 1),
          255 * (u < 0.5 ? u : Math.max(0, 3 * u - 2, 1 - u)), 255], place);
      }));
      paint.putImageData(image, 0, 0);
    },
    reading({ values, begin, end }) { // of the step that the time is in: a value, or from the lowest to the highest
      if (!values) return "";
      const { low, high, unit } = values;
      const n = Math.min(low.length - 1, Math.floor(low.length * (this.t - begin) / Math.max(1e-9, end - begin)));
      if (n < 0 || low[n] === null || low[n] === undefined) return "no value";
      const [least, most] = [short(low[n]), short(high[n])];
      return `${least === most ? least : `${least} to ${most}`}${unit === "1" ? "" : ` ${unit}`}`;
    },
    drawn(at, { low, high, unit }) {
      const chart = this.charts[at], named = unit === "1" ? "" : unit;
      chart.values = { low, high, unit };
      const known = [...low, ...high].filter((v) => v !== null), data = [];
      let last = Infinity;
      low.forEach((v, n) => { // a step without a value is a gap once there are three in a row
        if (v === null) return;
        const t = chart.begin + (n + 0.5) * (chart.end - chart.begin) / low.length;
        if (n - last > 3) data.push([t, null]);
        data.push([t, v], [t, high[n]]);
        last = n;
      });
      chart.option = { ...axes("s", named, { min: chart.begin, max: chart.end }), series: [{ data, type: "line", symbol: "none", emphasis: { disabled: true },
        lineStyle: { color: "var(--fill)", width: 1.5 }, markArea: { silent: true, data: this.bands } }] };
      chart.said = known.length ? `${short(Math.min(...known))} to ${short(Math.max(...known))} ${named}` : "no value here";
    },
    key(e) {
      const typed = e.target.tagName === "SELECT" || (e.target.tagName === "INPUT" && !["checkbox", "range"].includes(e.target.type));
      if (e.ctrlKey || e.altKey || e.metaKey || typed) return;
      if (this.codes.some((one) => one.key === e.key)) { if (!e.repeat && this.about.marking) this.coded(e.key); e.preventDefault(); return; }
      if (["INPUT", "BUTTON"].includes(e.target.tagName)) return;
      const far = e.shiftKey ? 10 : 1;
      const does = { " ": () => this.play(), ArrowRight: () => this.go(this.t + far), ArrowLeft: () => this.go(this.t - far),
        ".": () => this.go(this.t + 1 / this.about.rate), ",": () => this.go(this.t - 1 / this.about.rate),
        m: () => document.getElementById("mark-text")?.focus(),
        n: () => this.trial(1), b: () => this.trial(-1), Home: () => this.go(0), End: () => this.go(this.about.length) }[e.key];
      if (does) { does(); e.preventDefault(); }
    },
    clock(t) {
      const minutes = Math.floor(t / 60);
      return `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}:${(t % 60).toFixed(2).padStart(5, "0")}`;
    },
  },
};
