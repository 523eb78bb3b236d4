"use strict";
// Draws the charts of a vftcli report: lines over time or frequency, linked zoom, read-out, legend.
(() => {
  const element = document.getElementById("data");
  if (!element) return;
  const data = JSON.parse(element.textContent);
  const floats = (text) => {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  };
  for (const chart of [...data.charts, ...(data.wrenches || []), ...data.responses])
    for (const series of chart.series)
      series.lines = series.lines.map((line) => ({ x: floats(line.x), y: floats(line.y), half: line.half && floats(line.half) }));

  const nyquist = (() => {
    const first = data.responses.length && data.responses[0].series[0];
    return first ? first.lines[0].x[first.lines[0].x.length - 1] : 1;
  })();
  const whole = { time: data.span, frequency: [0.01, nyquist] };
  const state = { joint: 0, hidden: new Set(), view: { ...whole }, cursor: { time: null, frequency: null } };
  const charts = [];
  const label = (j) => (data.labels ? data.labels[j] : `J${j + 1}`);
  const unit = (spec, j) => (spec.units ? spec.units[j] : spec.unit);
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const node = (tag, className, text) => {
    const made = document.createElement(tag);
    if (className) made.className = className;
    if (text !== undefined) made.textContent = text;
    return made;
  };

  // ---- numbers -------------------------------------------------------------------------------
  const step = (span, count) => {
    const raw = span / Math.max(count, 1), power = 10 ** Math.floor(Math.log10(raw));
    const lead = raw / power;
    return (lead <= 1 ? 1 : lead <= 2 ? 2 : lead <= 5 ? 5 : 10) * power;
  };
  const ticks = (low, high, count) => {
    const width = step(high - low, count), list = [];
    for (let k = Math.ceil(low / width - 1e-9); k * width <= high + width * 1e-9; k++) list.push(k * width);
    return { list, digits: Math.max(0, -Math.floor(Math.log10(width) + 1e-9)) };
  };
  const text = (value, digits) => {
    if (Math.abs(value) >= 1e6) return value.toExponential(1).replace("-", "−");
    return (value.toFixed(digits) === (-0).toFixed(digits) ? (0).toFixed(digits) : value.toFixed(digits)).replace("-", "−");
  };
  const significant = (value) => {
    if (!Number.isFinite(value)) return "–";
    return (Math.abs(value) >= 1e5 || (value && Math.abs(value) < 1e-3) ? value.toExponential(2) : value.toPrecision(4)).replace("-", "−");
  };
  const below = (x, value) => { // first index with x >= value
    let low = 0, high = x.length;
    while (low < high) { const mid = (low + high) >> 1; if (x[mid] < value) low = mid + 1; else high = mid; }
    return low;
  };

  // ---- one chart -----------------------------------------------------------------------------
  class Chart {
    constructor(spec, parent, joint) {
      this.spec = spec; this.joint = joint; this.axis = spec.log ? "frequency" : "time";
      this.small = joint !== undefined;
      this.figure = node("figure", "chart");
      const caption = node("figcaption");
      this.title = node("b"); this.note = node("span");
      caption.append(this.title, this.note);
      this.area = node("div", "area");
      this.canvas = node("canvas"); this.over = node("canvas", "over");
      this.over.tabIndex = this.small ? -1 : 0;
      this.over.setAttribute("role", "img");
      this.area.append(this.canvas, this.over);
      this.figure.append(caption, this.area);
      parent.append(this.figure);
      this.height = Math.round((this.small ? 130 : 170) * (this.small ? 1 : spec.height));
      this.listen();
      new ResizeObserver(() => this.draw()).observe(this.area);
    }
    get at() { return this.spec.at !== undefined ? this.spec.at : this.small ? this.joint : state.joint; }
    lines() {
      return this.spec.series.filter((s) => !state.hidden.has(s.name)).map((s) => ({ ...s, line: s.lines[this.at] }));
    }
    fraction(x) {
      const [a, b] = state.view[this.axis];
      return this.spec.log ? Math.log(x / a) / Math.log(b / a) : (x - a) / (b - a);
    }
    value(fraction) {
      const [a, b] = state.view[this.axis];
      return this.spec.log ? a * (b / a) ** fraction : a + fraction * (b - a);
    }
    left(x) { return this.box.l + this.fraction(x) * this.box.w; }
    top(y) { return this.box.t + this.box.h * (1 - (y - this.low) / (this.high - this.low)); }
    bounds(lines) {
      const [a, b] = state.view[this.axis];
      let low = Infinity, high = -Infinity;
      for (const series of lines) {
        const { line } = series, half = this.half(series);
        const from = Math.max(0, below(line.x, a) - 1), to = Math.min(line.x.length, below(line.x, b) + 2);
        for (let k = from; k < to; k++) {
          const y = line.y[k], wide = half ? half[k] : 0;
          if (Number.isFinite(y + wide)) { if (y - wide < low) low = y - wide; if (y + wide > high) high = y + wide; }
        }
      }
      const band = this.spec.band && this.spec.band[this.at];
      if (band) { low = Math.min(low, -band); high = Math.max(high, band); }
      if (this.spec.lowest !== undefined) low = Math.max(low, this.spec.lowest);
      if (!(high >= low)) { low = -1; high = 1; }
      const room = Math.max((high - low) * 0.06, Math.abs(high) * 1e-6, 1e-6);
      this.low = low - room; this.high = high + room;
    }
    draw() {
      const width = this.area.clientWidth;
      if (!width) return;
      const ratio = window.devicePixelRatio || 1;
      for (const canvas of [this.canvas, this.over]) {
        canvas.width = Math.round(width * ratio); canvas.height = Math.round(this.height * ratio);
        canvas.style.height = `${this.height}px`;
      }
      const lines = this.lines(), c = this.canvas.getContext("2d");
      c.scale(ratio, ratio);
      this.bounds(lines);
      this.box = { l: this.small ? 46 : 62, t: 6, w: 0, h: this.height - (this.small ? 28 : 42) };
      this.box.w = width - this.box.l - 10;
      this.heading();
      this.axes(c);
      c.save();
      c.beginPath(); c.rect(this.box.l, this.box.t, this.box.w, this.box.h); c.clip();
      this.band(c);
      for (const item of lines) this.ribbon(c, item);
      for (const item of lines) if (!item.leads) this.trace(c, item);
      for (const item of lines) if (item.leads) this.trace(c, item); // on top of the others
      c.restore();
      this.hover();
    }
    heading() {
      this.title.textContent = this.small ? label(this.joint) : this.spec.at !== undefined ? this.spec.title : `${this.spec.title}, ${label(this.at)}`;
      const band = this.spec.band && this.spec.band[this.at];
      this.note.textContent = this.small ? "" : band ? `grey: ${this.spec.bandLabel}, ${significant(band)} ${unit(this.spec, this.at)}` : "";
      this.figure.classList.toggle("chosen", this.small && this.joint === state.joint);
      this.over.setAttribute("aria-label", `${this.title.textContent} [${unit(this.spec, this.at)}]`);
    }
    axes(c) {
      const { l, t, w, h } = this.box, soft = css("--soft"), grid = css("--grid");
      c.font = `${this.small ? 11 : 12}px ${getComputedStyle(document.body).fontFamily}`;
      c.lineWidth = 1; c.strokeStyle = grid; c.fillStyle = soft;
      const y = ticks(this.low, this.high, this.small ? 3 : Math.round(h / 34));
      c.textAlign = "right"; c.textBaseline = "middle";
      for (const value of y.list) {
        const at = Math.round(this.top(value)) + 0.5;
        c.strokeStyle = Math.abs(value) < 1e-12 ? soft : grid;
        c.beginPath(); c.moveTo(l, at); c.lineTo(l + w, at); c.stroke();
        c.fillText(text(value, y.digits), l - 6, at);
      }
      c.strokeStyle = grid; c.textAlign = "center"; c.textBaseline = "top";
      for (const { value, label } of this.xticks()) {
        const at = Math.round(this.left(value)) + 0.5;
        c.beginPath(); c.moveTo(at, t); c.lineTo(at, t + h); c.stroke();
        if (label) c.fillText(label, Math.min(Math.max(at, l + 8), l + w - 8), t + h + 5);
      }
      c.strokeStyle = css("--line"); c.strokeRect(l + 0.5, t + 0.5, w - 1, h - 1);
      if (this.small) return;
      c.fillText(this.spec.log ? "frequency [Hz]" : "time [s]", l + w / 2, t + h + 22);
      c.save(); c.translate(13, t + h / 2); c.rotate(-Math.PI / 2); c.textBaseline = "middle";
      c.fillText(`[${unit(this.spec, this.at)}]`, 0, 0); c.restore();
    }
    xticks() {
      const [a, b] = state.view[this.axis];
      if (!this.spec.log || b / a < 8) {
        const x = ticks(a, b, Math.round(this.box.w / (this.small ? 70 : 110)));
        return x.list.map((value) => ({ value, label: text(value, x.digits) }));
      }
      const list = [];
      for (let power = Math.floor(Math.log10(a)); power <= Math.log10(b); power++)
        for (let lead = 1; lead < 10; lead++) {
          const value = lead * 10 ** power;
          if (value >= a * 0.999 && value <= b * 1.001) list.push({ value, label: lead === 1 ? String(Number(value.toPrecision(3))) : "" });
        }
      return list;
    }
    band(c) {
      const half = this.spec.band && this.spec.band[this.at];
      if (!half) return;
      c.fillStyle = css("--band");
      c.fillRect(this.box.l, this.top(half), this.box.w, this.top(-half) - this.top(half));
    }
    half(series) { return this.small ? null : series.line.half; }
    ribbon(c, series) { // the 95 % band about an estimate
      const half = this.half(series), { line } = series;
      if (!half) return;
      const [a, b] = state.view[this.axis];
      const from = Math.max(0, below(line.x, a) - 1), to = Math.min(line.x.length, below(line.x, b) + 1);
      c.fillStyle = series.colour; c.globalAlpha = 0.13;
      let begin = -1;
      const fill = (end) => {
        if (begin >= 0 && end > begin) {
          c.beginPath();
          for (let k = begin; k < end; k++) c.lineTo(this.left(line.x[k]), this.top(line.y[k] + half[k]));
          for (let k = end - 1; k >= begin; k--) c.lineTo(this.left(line.x[k]), this.top(line.y[k] - half[k]));
          c.fill();
        }
        begin = -1;
      };
      for (let k = from; k < to; k++) {
        if (!Number.isFinite(line.y[k] + half[k])) fill(k); else if (begin < 0) begin = k;
      }
      fill(to); c.globalAlpha = 1;
    }
    trace(c, { line, colour, dashed, leads }) {
      const [a, b] = state.view[this.axis], ink = colour === "ink";
      const from = Math.max(0, below(line.x, a) - 1), to = Math.min(line.x.length, below(line.x, b) + 1);
      c.strokeStyle = ink ? css("--ink") : colour;
      c.lineWidth = this.small ? 1 : leads ? 2.2 : 1.3;
      c.globalAlpha = ink && this.spec.series.length > 1 ? 0.62 : 1; // the reference lies under the estimates
      c.lineJoin = "round"; c.setLineDash(dashed ? [7, 5] : []);
      c.beginPath();
      let pen = false;
      for (let k = from; k < to; k++) {
        const y = line.y[k];
        if (!Number.isFinite(y)) { pen = false; continue; }
        const px = this.left(line.x[k]), py = this.top(y);
        if (pen) c.lineTo(px, py); else { c.moveTo(px, py); pen = true; }
      }
      c.stroke(); c.setLineDash([]); c.globalAlpha = 1;
    }

    // ---- the pointer -------------------------------------------------------------------------
    listen() {
      const place = (event) => {
        const box = this.over.getBoundingClientRect();
        return Math.min(1, Math.max(0, (event.clientX - box.left - this.box.l) / this.box.w));
      };
      if (this.small) {
        this.figure.addEventListener("click", () => choose(this.joint));
        return;
      }
      this.over.addEventListener("pointerdown", (event) => {
        if (event.pointerType === "touch" || event.button > 1) return;
        this.over.setPointerCapture(event.pointerId);
        const fraction = place(event);
        this.drag = { from: fraction, to: fraction, pan: event.shiftKey || event.button === 1, view: [...state.view[this.axis]] };
        event.preventDefault(); this.over.focus({ preventScroll: true });
      });
      this.over.addEventListener("pointermove", (event) => {
        const fraction = place(event);
        if (this.drag && this.drag.pan) { this.pan(this.drag.view, this.drag.from - fraction); return; }
        if (this.drag) this.drag.to = fraction;
        state.cursor[this.axis] = this.value(fraction);
        this.pointed = true; hoverAll();
      });
      this.over.addEventListener("pointerup", () => {
        const drag = this.drag; this.drag = null;
        if (drag && !drag.pan && Math.abs(drag.to - drag.from) * this.box.w > 5)
          look(this.axis, [this.value(Math.min(drag.from, drag.to)), this.value(Math.max(drag.from, drag.to))]);
        else hoverAll();
      });
      this.over.addEventListener("pointercancel", () => { this.drag = null; });
      this.over.addEventListener("pointerleave", () => { this.pointed = false; state.cursor[this.axis] = null; hoverAll(); });
      this.over.addEventListener("dblclick", () => look(this.axis, whole[this.axis]));
      this.over.addEventListener("wheel", (event) => {
        if (!event.ctrlKey && !event.shiftKey) return;
        event.preventDefault();
        if (event.ctrlKey) this.zoom(place(event), event.deltaY > 0 ? 1.25 : 0.8);
        else this.pan(state.view[this.axis], (event.deltaY || event.deltaX) > 0 ? 0.1 : -0.1);
      }, { passive: false });
      this.over.addEventListener("keydown", (event) => {
        const act = {
          ArrowLeft: () => this.pan(state.view[this.axis], -0.1), ArrowRight: () => this.pan(state.view[this.axis], 0.1),
          "+": () => this.zoom(0.5, 0.67), "=": () => this.zoom(0.5, 0.67), "-": () => this.zoom(0.5, 1.5),
          Home: () => look(this.axis, whole[this.axis]), Escape: () => look(this.axis, whole[this.axis]),
        }[event.key];
        if (act) { event.preventDefault(); act(); }
      });
    }
    zoom(about, factor) {
      look(this.axis, [this.value(about - about * factor), this.value(about + (1 - about) * factor)]);
    }
    pan(view, by) {
      const kept = state.view[this.axis];
      state.view[this.axis] = view;
      const shifted = [this.value(by), this.value(1 + by)];
      state.view[this.axis] = kept;
      const [low, high] = whole[this.axis];
      if (shifted[0] >= low && shifted[1] <= high) look(this.axis, shifted);
    }
    hover() {
      if (!this.box) return;
      const c = this.over.getContext("2d"), ratio = window.devicePixelRatio || 1, { l, t, w, h } = this.box;
      c.setTransform(ratio, 0, 0, ratio, 0, 0);
      c.clearRect(0, 0, this.over.width, this.over.height);
      if (this.drag && !this.drag.pan) {
        c.fillStyle = css("--band");
        c.fillRect(l + this.drag.from * w, t, (this.drag.to - this.drag.from) * w, h);
      }
      const x = state.cursor[this.axis];
      const seen = x !== null && this.fraction(x) >= 0 && this.fraction(x) <= 1;
      if (seen) {
        const at = Math.round(this.left(x)) + 0.5;
        c.strokeStyle = css("--soft"); c.lineWidth = 1;
        c.beginPath(); c.moveTo(at, t); c.lineTo(at, t + h); c.stroke();
      }
      if (seen && this.pointed && !this.small) this.read(x); else if (this.readout) { this.readout.remove(); this.readout = null; }
    }
    read(x) {
      if (!this.readout) { this.readout = node("div", "readout"); this.area.append(this.readout); }
      const rows = this.lines().map(({ name, line, colour }) => {
        let k = below(line.x, x);
        if (k > 0 && (k === line.x.length || x - line.x[k - 1] < line.x[k] - x)) k--;
        return { name, colour, value: line.y[k] };
      });
      const list = node("table");
      for (const { name, colour, value } of rows) {
        const row = node("tr"), label = node("td", "", name), number = node("td", "", `${significant(value)} ${unit(this.spec, this.at)}`);
        label.style.color = colour === "ink" ? css("--ink") : colour;
        row.append(label, number); list.append(row);
      }
      const where = this.spec.log ? `${significant(x)} Hz` : `${x.toFixed(3)} s`;
      this.readout.replaceChildren(node("div", "", where), list);
      const at = this.left(x), right = at > this.box.l + this.box.w / 2;
      this.readout.style.top = `${this.box.t + 6}px`;
      this.readout.style.left = right ? "" : `${at + 12}px`;
      this.readout.style.right = right ? `${this.area.clientWidth - at + 12}px` : "";
    }
  }

  // ---- the page ------------------------------------------------------------------------------
  const redraw = () => charts.forEach((chart) => chart.draw());
  const hoverAll = () => charts.forEach((chart) => chart.hover());
  const look = (axis, [from, to]) => {
    const [low, high] = whole[axis];
    from = Math.max(from, low); to = Math.min(to, high);
    const least = axis === "time" ? 1e-6 * Math.max(high - low, 1e-3) : from * 1e-3;
    if (to - from > least) state.view[axis] = [from, to];
    redraw();
  };
  const choose = (joint) => {
    state.joint = joint;
    document.querySelectorAll("#joints button").forEach((button, j) => button.setAttribute("aria-pressed", String(j === joint)));
    redraw();
  };
  const swatch = ({ colour, dashed, leads }) => {
    const space = "http://www.w3.org/2000/svg", svg = document.createElementNS(space, "svg"), line = document.createElementNS(space, "line");
    svg.setAttribute("class", "swatch"); svg.setAttribute("viewBox", "0 0 24 8"); svg.setAttribute("aria-hidden", "true");
    for (const [name, value] of [["x1", 0], ["x2", 24], ["y1", 4], ["y2", 4], ["stroke", colour === "ink" ? "currentColor" : colour]]) line.setAttribute(name, value);
    if (dashed) line.setAttribute("stroke-dasharray", "7 4");
    if (leads) line.setAttribute("style", "stroke-width: 3.5");
    svg.append(line);
    return svg;
  };
  const joints = document.getElementById("joints"), legend = document.getElementById("legend");
  for (let j = 0; j < data.joints; j++) {
    const button = node("button", "", label(j));
    button.type = "button"; button.setAttribute("aria-pressed", String(j === 0));
    button.addEventListener("click", () => choose(j));
    joints.append(button);
  }
  for (const series of data.charts[0].series) {
    const button = node("button");
    button.type = "button"; button.setAttribute("aria-pressed", "true");
    button.append(swatch(series), series.name);
    button.addEventListener("click", () => {
      if (!state.hidden.delete(series.name)) state.hidden.add(series.name);
      button.setAttribute("aria-pressed", String(!state.hidden.has(series.name)));
      redraw();
    });
    legend.append(button);
  }
  for (const place of document.querySelectorAll("[data-swatch]")) {
    const series = data.charts[0].series.find((s) => s.name === place.dataset.swatch);
    if (series) place.prepend(swatch(series));
  }
  for (let j = 0; j < data.joints; j++) charts.push(new Chart(data.charts[0], document.getElementById("overview"), j));
  for (const spec of data.charts) charts.push(new Chart(spec, document.getElementById("detail")));
  for (const spec of data.wrenches || []) charts.push(new Chart(spec, document.getElementById("wrenches")));
  for (const spec of data.responses) charts.push(new Chart(spec, document.getElementById("responses")));
  document.getElementById("all").addEventListener("click", () => { look("time", whole.time); look("frequency", whole.frequency); });

  // ---- light and dark ------------------------------------------------------------------------
  const dark = matchMedia("(prefers-color-scheme: dark)"), root = document.documentElement;
  const isDark = () => (root.dataset.theme ? root.dataset.theme === "dark" : dark.matches);
  const button = document.getElementById("theme");
  const name = () => { button.textContent = isDark() ? "light page" : "dark page"; };
  button.addEventListener("click", () => { root.dataset.theme = isDark() ? "light" : "dark"; name(); redraw(); });
  dark.addEventListener("change", () => { name(); redraw(); });
  let kept;
  addEventListener("beforeprint", () => { kept = root.dataset.theme; root.dataset.theme = "light"; redraw(); });
  addEventListener("afterprint", () => { if (kept) root.dataset.theme = kept; else delete root.dataset.theme; redraw(); });
  name();
})();
