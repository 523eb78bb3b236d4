"use strict";
// The large charts of a vftcli page: uPlot draws them, this hands it what the page holds.
(() => {
  const element = document.getElementById("data");
  if (!element) return;
  const specs = JSON.parse(element.textContent);
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
  const values = ({ low, step, points }) =>
    Array.from(new Int16Array(bytes(points)), (k) => (k === -32768 ? null : low + step * (k + 32767)));
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const node = (tag, className, text) => {
    const made = document.createElement(tag);
    made.className = className;
    made.textContent = text;
    return made;
  };
  const button = (text, pressed, action) => {
    const made = node("button", "", text);
    made.type = "button";
    if (pressed !== undefined) made.setAttribute("aria-pressed", pressed);
    made.addEventListener("click", () => action(made));
    return made;
  };
  const ink = (colour) => (colour === "ink" ? css("--ink") : colour === "reference" ? css("--reference") : colour);
  const number = (value, unit) => (value == null ? "" : ` ${value.toPrecision(4).replace("-", "−")} ${unit}`);

  const font = "13px system-ui, sans-serif";
  const texts = (marks, unit) => marks.map((value, k) => `${Number(value.toPrecision(10))}`.replace("-", "−") + (unit && k === marks.length - 1 ? ` ${unit}` : ""));

  class Large {
    constructor(place, spec) {
      this.place = place; this.spec = spec; this.panel = 0;
      this.shown = spec.series.map((series) => series.shown);
      this.small = document.querySelector(`.multiples[data-of="${spec.key}"]`);
      this.panels = this.row("Show");
      this.legend = this.row("Lines");
      this.plot = node("div", "plot", "");
      this.plot.tabIndex = 0;
      this.plot.setAttribute("role", "img");
      this.plot.addEventListener("keydown", (event) => this.key(event));
      const help = "Drag to zoom in, double-click for the whole span; with the keyboard + − ← → Home.";
      place.append(this.panels, this.legend, this.plot, node("p", "cap help", help));
      spec.panels.forEach((name, k) => this.panels.append(button(name, k === 0, () => this.choose(k))));
      spec.series.forEach((series, k) => this.legend.append(this.entry(series, k)));
      if (this.small) for (const figure of this.small.children)
        figure.addEventListener("click", () => this.choose(Number(figure.dataset.panel)));
      new ResizeObserver(() => this.fit()).observe(place);
    }
    row(name) {
      const made = node("div", "row", "");
      made.setAttribute("role", "group");
      made.setAttribute("aria-label", name);
      return made;
    }
    entry(series, k) {
      const made = button(series.name, this.shown[k], () => {
        this.shown[k] = !this.shown[k];
        made.setAttribute("aria-pressed", this.shown[k]);
        this.draw();
      });
      const drawn = document.createElementNS("http://www.w3.org/2000/svg", "svg");
      drawn.setAttribute("class", "swatch");
      drawn.setAttribute("viewBox", "0 0 26 8");
      const line = document.createElementNS("http://www.w3.org/2000/svg", "path");
      line.setAttribute("d", "M0 4H26");
      line.style.cssText = `stroke:${series.colour[0] === "#" ? series.colour : `var(--${series.colour})`};stroke-width:2;stroke-dasharray:${series.dash.join(" ")}`;
      drawn.append(line);
      made.prepend(drawn);
      made.append(node("span", "now", ""));
      return made;
    }
    choose(panel) {
      this.panel = panel;
      this.draw();
    }
    key(event) {
      const { min, max } = this.chart.scales.x, middle = (min + max) / 2, half = (max - min) / 2;
      const moves = { "+": [middle, half / 1.5], "-": [middle, half * 1.5], ArrowLeft: [middle - half / 4, half], ArrowRight: [middle + half / 4, half] };
      if (event.key === "Home") this.chart.setScale("x", this.whole());
      else if (moves[event.key]) {
        const [at, reach] = moves[event.key], { min: first, max: last } = this.whole();
        this.chart.setScale("x", { min: Math.max(first, at - reach), max: Math.min(last, at + reach) });
      } else return;
      event.preventDefault();
    }
    whole() {
      const x = this.chart.data[0];
      return { min: x[0], max: x[x.length - 1] };
    }
    // uPlot wants one column of x for all lines: it joins those that have their own.
    table() {
      const tables = [], drawn = [{}], bands = [];
      this.spec.series.forEach((series, k) => {
        if (!this.shown[k]) return;
        const line = series.lines[this.panel], x = Array.from(new Float32Array(bytes(line.x))), y = values(line.y);
        const stroke = ink(series.colour), columns = [y];
        drawn.push({ label: series.name, stroke, width: series.colour === "reference" ? 4 : series.leads ? 2 : 1.3, dash: series.dash, points: { show: false }, entry: k });
        for (const [ribbon, fill] of [[line.half, `${stroke}30`], [line.quiet, css("--unseen")]]) {
          if (!ribbon) continue;
          const half = values(ribbon), at = drawn.length, edge = (sign) => y.map((v, i) => (v === null || half[i] === null ? null : v + sign * half[i]));
          columns.push(edge(1), edge(-1));
          for (let i = 0; i < 2; i++) drawn.push({ stroke: "transparent", points: { show: false } });
          bands.push({ series: [at, at + 1], fill });
        }
        tables.push([x, ...columns]);
      });
      return { data: tables.length ? uPlot.join(tables) : [[0, 1]], drawn, bands };
    }
    fit() {
      const width = this.place.clientWidth;
      if (!width) return;
      if (!this.chart) this.draw();
      else if (width !== this.chart.width) this.chart.setSize({ width, height: 320 });
    }
    draw() {
      const width = this.place.clientWidth;
      if (!width) return;
      const { data, drawn, bands } = this.table(), unit = this.spec.units[this.panel];
      const kept = this.chart && { ...this.chart.scales.x };
      if (this.chart) this.chart.destroy();
      const axis = { font, stroke: css("--mute"), grid: { stroke: css("--line"), width: 1 }, ticks: { stroke: css("--line"), width: 1 } };
      this.chart = new uPlot({
        width, height: 320, series: drawn, bands, legend: { show: false },
        scales: { x: { time: false } },
        axes: [{ ...axis, size: 34, values: (chart, marks) => texts(marks, this.spec.unit) }, { ...axis, size: 66, label: unit, labelSize: 20, labelFont: font, values: (chart, marks) => texts(marks) }],
        cursor: { y: false, drag: { x: true, y: false }, focus: { prox: 30 } },
        hooks: { drawClear: [(chart) => this.under(chart)], setCursor: [(chart) => this.read(chart)] },
      }, data, this.plot);
      if (kept) this.chart.setScale("x", { min: kept.min, max: kept.max });
      [...this.panels.children].forEach((made, k) => made.setAttribute("aria-pressed", k === this.panel));
      if (this.small) [...this.small.children].forEach((figure, k) => figure.classList.toggle("chosen", k === this.panel));
      this.plot.setAttribute("aria-label", `${this.spec.title}, ${this.spec.panels[this.panel]} in ${unit}`);
    }
    under(chart) {
      const { ctx, bbox } = chart, place = (value, scale) => chart.valToPos(value, scale, true);
      ctx.save();
      ctx.beginPath(); ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height); ctx.clip();
      ctx.fillStyle = css("--contact");
      for (const [start, stop] of this.spec.spans)
        ctx.fillRect(place(start, "x"), bbox.top, Math.max(place(stop, "x") - place(start, "x"), 1), bbox.height);
      const band = this.spec.band && this.spec.band[this.panel];
      if (band) {
        ctx.fillStyle = css("--unseen");
        ctx.fillRect(bbox.left, place(band, "y"), bbox.width, place(-band, "y") - place(band, "y"));
      }
      ctx.restore();
    }
    read(chart) {
      const at = chart.cursor.idx;
      for (const made of this.legend.children) made.lastChild.textContent = "";
      chart.series.forEach((series, k) => {
        if (series.entry === undefined || at === null || at === undefined) return;
        // A joined line has no value of its own between its samples: the one before it is read.
        let i = at;
        while (i > 0 && chart.data[k][i] === undefined) i--;
        this.legend.children[series.entry].lastChild.textContent = number(chart.data[k][i], this.spec.units[this.panel]);
      });
    }
  }
  const made = [...document.querySelectorAll(".large")].map((place) => new Large(place, specs.find((spec) => spec.key === place.dataset.chart)));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => made.forEach((each) => each.chart && each.draw()));
  // Printed, everything is open, as far as the style sheet cannot say so.
  let closed = [];
  addEventListener("beforeprint", () => { closed = [...document.querySelectorAll("details:not([open])")]; closed.forEach((each) => { each.open = true; }); });
  addEventListener("afterprint", () => closed.forEach((each) => { each.open = false; }));
  // A link to a row or a section that is folded away opens it.
  const reveal = () => { const target = location.hash && document.getElementById(location.hash.slice(1)); const folded = target && target.closest("details"); if (folded) folded.open = true; };
  addEventListener("hashchange", reveal);
  reveal();
})();
