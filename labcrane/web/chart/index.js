// Chart: ECharts with named axes, values under the pointer, and the colours of the page.
import { echarts } from "nicegui-echart";

const axis = { type: "value", scale: true, nameTextStyle: { color: "var(--faint)" },
  axisLine: { show: true, lineStyle: { color: "var(--faint)" } },
  axisLabel: { color: "var(--faint)", hideOverlap: true }, splitLine: { lineStyle: { color: "var(--rule)" } } };

export const short = (value) => String(Number(Number(value).toPrecision(4)));

// The vertical axis holds what is marked in the chart, too, of which ECharts takes no account.
export const axes = (across, up, between = {}, marked = []) => ({
  animation: false, tooltip: { trigger: "axis", confine: true, valueFormatter: short },
  grid: { left: 60, right: 16, top: 28, bottom: 40 },
  xAxis: { ...axis, name: across, nameLocation: "middle", nameGap: 24, ...between },
  yAxis: { ...axis, name: up, nameTextStyle: { ...axis.nameTextStyle, align: "left", padding: [0, 0, 0, -50] },
    ...(marked.length && { min: ({ min }) => Math.min(min, ...marked), max: ({ max }) => Math.max(max, ...marked) }) },
});

export const Chart = {
  props: { option: Object, label: String, group: String },
  emits: ["go"],
  template: `<div class="chart" role="img" :aria-label="label"></div>`,
  mounted() {
    this.chart = echarts.init(this.$el, null, { renderer: "svg" });
    if (this.group) echarts.connect(this.chart.group = this.group); // one pointer over all of them
    this.chart.getZr().on("click", (e) => this.$emit("go", this.chart.convertFromPixel({ xAxisIndex: 0 }, e.offsetX)));
    this.sized = new ResizeObserver(() => this.chart.resize());
    this.sized.observe(this.$el);
    this.$watch("option", (option) => this.chart.setOption(option, true), { immediate: true });
  },
  beforeUnmount() { this.sized.disconnect(); this.chart.dispose(); },
};
