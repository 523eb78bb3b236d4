// The live part of a page. Until its #data is unpacked, or where it cannot be, the drawings stay.
const $ = (query, at = document) => at.querySelector(query);
const $$ = (query, at = document) => [...at.querySelectorAll(query)];
const on = (target, names, act, how) => names.split(" ").forEach((name) => target.addEventListener(name, act, how));
const { abs, ceil, cos, floor, hypot, log10, max, min, round, sin } = Math;
const clamp = (x, low, high) => min(max(x, low), high);
// A button's space is its own.
const onKeys = (place, acts) => on(place, "keydown", (e) => {
	const act = acts[e.key] || acts[e.key.toLowerCase()];
	if (!act || e.ctrlKey || e.metaKey || e.altKey || (e.key === " " && e.target.closest("button, summary, a"))) return;
	e.preventDefault();
	e.stopPropagation();
	act();
});

// ---- Tables that sort, commands to copy, links into folded parts, paper.
const sortBy = (head) => {
	const column = head.cellIndex, body = head.closest("table").tBodies[0], down = head.ariaSort === "ascending" ? -1 : 1;
	const rows = [...body.rows].map((row) => {
		const text = row.cells[column].textContent.trim(), sign = text[1] ? "✗△–✓".indexOf(text[0]) : -1;
		return { row, text, size: !column ? NaN : sign < 0 ? parseFloat(text.replace(/^\D+(?=\d)/, "")) : sign };
	});
	// What is unknown comes last.
	rows.sort((a, b) => isNaN(a.size) - isNaN(b.size) || down * (isNaN(a.size) ? a.text.localeCompare(b.text) : a.size - b.size));
	for (const other of head.parentNode.cells) other.ariaSort = null;
	head.ariaSort = down > 0 ? "ascending" : "descending";
	body.append(...rows.map(({ row }) => row));
};
for (const head of $$(".sorts thead th")) {
	head.tabIndex = 0;
	on(head, "click", () => sortBy(head));
	onKeys(head, { Enter: () => sortBy(head), " ": () => sortBy(head) });
}
for (const copy of $$("button.copy")) on(copy, "click", async () => {
	const command = copy.previousElementSibling;
	getSelection().selectAllChildren(command);
	copy.textContent = await navigator.clipboard?.writeText(command.textContent).then(() => "copied", () => 0) || "selected";
	setTimeout(() => { copy.textContent = "copy"; }, 1500);
});
const reveal = () => $(":target")?.closest("details")?.setAttribute("open", "");
on(window, "hashchange", reveal);
reveal();
let folded = [];
on(window, "beforeprint", () => { folded = $$("details:not([open])"); for (const each of folded) each.open = true; });
on(window, "afterprint", () => { for (const each of folded) each.open = false; });

// ---- Numbers, colours, and what every drawing is made of.
const seconds = (t) => `${t.toFixed(2)} s`;
const minus = (text) => text.replace("-", "−");
// Three digits of the largest, as far as the steps of the data go, and no negative nought.
const number = (x, size, step) => {
	const digits = clamp(2 - floor(log10(max(size, step))), 0, max(0, ceil(-log10(step) - .1)));
	return minus((+x.toFixed(digits) + 0).toFixed(digits));
};
const ticks = (low, high, count) => {
	const width = (high - low) / count, power = 10 ** floor(log10(width)), found = [];
	const step = [1, 2, 5, 10].find((s) => width <= 1.4 * s * power) * power;
	for (let k = ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
	return { found, digits: max(0, -floor(log10(step) + 1e-9)) };
};
const css = {};
let c = null; // what is drawn on
const readStyle = () => {
	const style = getComputedStyle(document.documentElement);
	css.font = getComputedStyle(document.body).fontFamily;
	for (const name of "paper card ink mute line force band pale touch stripe weak unseen hatch reference zero".split(" ")) css[name] = style.getPropertyValue(`--${name}`).trim();
};
const paint = (colour) => css[/^var\(--(\w+)/.exec(colour)?.[1]] || colour;
// A path through points, broken at null.
const path = (points, stroke, width = 1, dash = []) => {
	let drawn = false;
	c.beginPath();
	for (const point of points) {
		if (point) c[drawn ? "lineTo" : "moveTo"](point[0], point[1]);
		drawn = !!point;
	}
	Object.assign(c, { strokeStyle: stroke, lineWidth: width, lineCap: dash[0] ? "butt" : "round", lineJoin: "round" });
	c.setLineDash(dash);
	if (stroke) c.stroke();
};
const area = (points, colour) => { path(points); c.fillStyle = colour; c.fill(); };
const write = (text, x, y, colour = css.mute, size = 11.5, align = "center", rim = null) => {
	Object.assign(c, { font: `${size > 11.5 ? 650 : 400} ${size}px ${css.font}`, textAlign: align, textBaseline: "middle", fillStyle: colour, strokeStyle: rim, lineWidth: 4 });
	if (rim) c.strokeText(text, x, y);
	c.fillText(text, x, y);
};
const fill = (colour, x, y, width, height) => { c.fillStyle = colour; c.fillRect(x, y, width, height); };
const within = ([x, y, width, height], draw) => { c.save(); c.beginPath(); c.rect(x, y, width, height); c.clip(); draw(); c.restore(); };
// Keep a drawing's canvas as large as its place.
const watch = (drawing, canvas) => new ResizeObserver(([{ contentRect: { width, height } }]) => {
	Object.assign(drawing, { width, height, pen: width && height ? canvas.getContext("2d") : null });
	Object.assign(canvas, { width: round(width * devicePixelRatio), height: round(height * devicePixelRatio) });
	ask(LINES);
}).observe(canvas);
// Draw on it, where it is shown.
const begin = ({ pen }) => {
	c = pen;
	c?.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
	return c;
};

// The plain wheel scrolls the page.
const onWheel = (place, act) => on(place, "wheel", (e) => {
	if (!e.ctrlKey && document.activeElement !== place) return;
	e.preventDefault();
	act(1.2 ** Math.sign(e.deltaY), e);
}, { passive: false });

// ---- Time: what is seen of it, the moment played, the one looked at.
const LOOKS = 1, LINES = 2, still = matchMedia("(prefers-reduced-motion: reduce)"), clocks = [];
let asked = 0, before = 0, data = null, rows = [];
const ask = (what) => { if (!asked) requestAnimationFrame(frame); asked |= what; };
const frame = (time) => {
	const what = asked;
	asked = 0;
	for (const clock of clocks) {
		const goes = clock.step(time);
		for (const plot of clock.plots) plot.draw(what | asked);
		clock.moved?.();
		if (goes) ask(LOOKS);
	}
	before = time;
};
class Clock {
	plots = []; buttons = []; look = null; speed = 1; running = false; way = null;
	constructor({ t: [low, high], gaps }) {
		let sum = 0;
		const t = rows[low].map((ticks, i) => (sum += ticks + rows[high][i])), first = t[0], last = t.at(-1);
		Object.assign(this, { t, first, last, head: first, view: [first, last], gaps: new Set(gaps) });
	}
	get now() { return this.look ?? this.head; }
	index(t) {
		let low = 0, high = this.t.length - 1;
		while (high - low > 1) { const middle = (low + high) >> 1; if (this.t[middle] <= t) low = middle; else high = middle; }
		return t - this.t[low] < this.t[high] - t ? low : high;
	}
	go(t, glide) {
		this.look = this.way = null;
		t = clamp(t, this.first, this.last);
		if (glide && !still.matches && !this.running) this.way = { from: this.head, to: t, start: performance.now() };
		else this.put(t);
		ask(LOOKS);
	}
	put(t) {
		const [low, high] = this.view;
		this.head = t;
		if (t < low || t > high) this.zoom(t - (high - low) / 2, t + (high - low) / 2);
	}
	zoom(low = this.first, high = this.last) {
		const all = this.last - this.first, width = clamp(high - low, 8 * all / this.t.length, all), start = clamp((low + high - width) / 2, this.first, this.last - width);
		this.view = [start, start + width];
		for (const button of this.buttons) button.hidden = width === all;
		ask(LINES);
	}
	magnify(factor, at = this.now) { const [low, high] = this.view; this.zoom(at - (at - low) * factor, at + (high - at) * factor); }
	step(time) {
		if (this.way) {
			const { from, to, start } = this.way, share = clamp((time - start) / 320, 0, 1);
			if (share === 1) this.way = null;
			this.put(share === 1 ? to : from + (to - from) * (1 - (1 - share) ** 3));
		}
		if (this.running) {
			this.put(min(this.head + min(time - before, 100) / 1000 * this.speed, this.last));
			this.running = this.head < this.last;
		}
		return this.way || this.running;
	}
}

// ---- A panel of a chart, over its still drawing.
const LEFT = 44; // room for numbers
class Plot {
	top = 8;
	constructor(figure, chart, panel) {
		Object.assign(this, { chart, panel, clock: chart.clock });
		for (const part of ["box", "sheet", "cursor", "chosen", "tip", "head"]) this[part] = $(`.${part}`, figure);
		this.clock.plots.push(this);
		this.listen();
		watch(this, this.sheet);
	}
	x(t) { return LEFT + (t - this.clock.view[0]) * this.pace; }
	y(value) { const [low, high] = this.chart.ends[this.panel]; return this.top + (high - value) / (high - low) * this.tall; }
	time(x) { const [low, high] = this.clock.view; return clamp(low + (x - LEFT) / this.pace, low, high); }
	draw(what) {
		const [low, high] = this.clock.view;
		if (!begin(this)) return;
		Object.assign(this, { wide: this.width - LEFT - 10, tall: this.height - this.top - 20 });
		this.pace = this.wide / (high - low || 1);
		if (what & LINES) this.lines();
		const x = this.x(this.clock.now);
		this.cursor.style.transform = `translateX(${x}px)`;
		this.cursor.hidden = abs(x - LEFT - this.wide / 2) > this.wide / 2 + 1;
		this.look(x);
	}
	look() { if (this.head) this.head.textContent = this.reading(); }
	under() {}
	over() {}
	lines() {
		const { top, wide, tall, chart: { spans, felt, band, lines, ends }, panel } = this, room = [LEFT, top, wide, tall];
		c.clearRect(0, 0, this.width, this.height);
		within(room, () => {
			this.under();
			spans.forEach(([start, stop], k) => fill(css[felt?.[k].weak ? "weak" : "stripe"], this.x(start), top, max(this.x(stop) - this.x(start), 1), tall));
			if (band?.[panel]) fill(css.unseen, LEFT, this.y(band[panel]), wide, this.y(-band[panel]) - this.y(band[panel]));
		});
		const up = ticks(...ends[panel], max(2, tall / 34)), across = ticks(...this.clock.view, max(2, wide / 90));
		for (const value of up.found) {
			const y = round(this.y(value)) + .5;
			path([[LEFT, y], [LEFT + wide, y]], abs(value) < 1e-12 ? css.zero : css.line);
			write(minus(value.toFixed(up.digits)), LEFT - 6, y, css.mute, 11.5, "right");
		}
		across.found.forEach((value, k) => write(value.toFixed(across.digits) + (across.found[k + 1] ? "" : " s"), min(this.x(value), this.width - 18), top + tall + 12));
		within(room, () => lines.forEach((line) => line.shown && this.line(line)));
		this.over();
	}
	row(line, part) { return line[part] && rows[line[part][this.panel]]; }
	line(line) {
		const { t, gaps, view } = this.clock, [low, spread, half] = ["low", "spread", "half"].map((part) => this.row(line, part)), points = [], edges = [];
		const ribbon = () => {
			c.globalAlpha = edges[0]?.listed ? .18 : 1;
			if (edges[1]) area([...edges.map((e) => [e.x, e.above]), ...edges.map((e) => [e.x, e.below]).reverse()], edges[0].listed ? paint(line.colour) : css.unseen);
			c.globalAlpha = 1;
			edges.length = 0;
		};
		for (let i = max(this.clock.index(view[0]) - 1, 0); i < t.length && t[max(i - 1, 0)] <= view[1]; i++) {
			const k = min(floor(i / line.every), low.length - 1), x = this.x(t[i]), foot = low[k], peak = foot + (spread?.[k] || 0);
			if (gaps.has(i) || isNaN(foot)) { points.push(null); ribbon(); }
			if (isNaN(foot)) continue;
			points.push([x, this.y(peak)]);
			if (peak > foot) points.push([x, this.y(foot)]);
			if (!half || isNaN(half[i])) { ribbon(); continue; }
			const listed = !line.quiet || this.chart.spans.some(([start, stop]) => t[i] >= start && t[i] <= stop);
			const edge = { x, listed, above: this.y(peak + half[i]), below: this.y(foot - half[i]) };
			if (edges[0]?.listed === !listed) { edges.push(edge); ribbon(); }
			edges.push(edge);
		}
		ribbon();
		path(points, paint(line.colour), line.broad ? 5 : line.leads ? 1.8 : 1.3, line.dash);
	}
	// A line's value at a sample: both ends where a stretch holds several.
	value(line, i = this.clock.index(this.clock.now)) {
		const row = this.row(line, "low"), k = min(floor(i / line.every), row.length - 1);
		return { low: row[k], high: row[k] + (this.row(line, "spread")?.[k] || 0), half: this.row(line, "half")?.[i] ?? NaN };
	}
	reading() {
		const shown = this.chart.lines.filter((line) => line.shown && !isNaN(this.value(line).low)).sort((a, b) => b.leads - a.leads);
		const texts = shown.map((line) => {
			const { low, high, half } = this.value(line), size = max(abs(low), abs(high), half || 0), name = line.leads || !shown[1] ? "" : `${line.name.replace(/ \(.*/, "")} `;
			const text = (x) => number(x, size, data.steps[line.low[this.panel]]);
			return name + text(low) + (high - low > .005 * size ? `…${text(high)}` : "") + (isNaN(half) ? "" : ` ± ${text(half)}`);
		});
		return texts[0] ? `${texts.join(" · ")} ${this.chart.units[this.panel]}` : "";
	}
	// Hover looks, a click goes there, a drag zooms; a finger scrubs.
	listen() {
		const { box, clock, chosen } = this, place = (e) => e.clientX - box.getBoundingClientRect().left, isMouse = (e) => e.pointerType === "mouse";
		let from = null;
		on(box, "pointerdown", (e) => {
			if (e.button) return;
			from = place(e);
			box.setPointerCapture(e.pointerId);
		});
		on(box, "pointermove", (e) => {
			const x = place(e);
			if (!isMouse(e)) return from !== null && clock.go(this.time(x));
			if (from !== null && abs(x - from) > 5) chosen.hidden = false;
			Object.assign(chosen.style, { left: `${min(x, from)}px`, width: `${abs(x - from)}px` });
			clock.look = this.time(x);
			ask(LOOKS);
		});
		on(box, "pointerup", (e) => {
			const x = place(e), start = from, dragged = !chosen.hidden;
			from = null;
			chosen.hidden = true;
			if (start === null) return;
			if (dragged) clock.zoom(this.time(min(x, start)), this.time(max(x, start)));
			else clock.go(this.time(x));
			clock.look = dragged || !isMouse(e) ? null : this.time(x);
		});
		on(box, "pointercancel pointerleave", () => { from = clock.look = null; chosen.hidden = true; ask(LOOKS); });
		on(box, "dblclick", () => clock.zoom());
		onWheel(box, (factor, e) => clock.magnify(factor, this.time(place(e))));
	}
}

// ---- What the reader takes along: what is seen, as CSV or as PNG.
const csvOf = (plots) => {
	const { chart, clock } = plots[0], [low, high] = clock.view, heads = ["t [s]"], columns = [];
	for (const plot of plots) for (const line of chart.lines) if (line.shown) {
		const name = `${chart.panels[plot.panel]} ${line.name}`.replace(/[",\n]/g, " ");
		for (const [part, words] of [["low", line.spread ? " min" : ""], line.spread && ["high", " max"], line.half && ["half", " ±"]].filter(Boolean)) {
			heads.push(`${name}${words} [${chart.units[plot.panel]}]`);
			columns.push((i) => plot.value(line, i)[part]);
		}
	}
	const lines = [...clock.t.keys()].filter((i) => clock.t[i] >= low - 1e-9 && clock.t[i] <= high + 1e-9).map((i) => [clock.t[i].toFixed(4), ...columns.map((of) => (isNaN(of(i)) ? "" : +of(i).toPrecision(6)))]);
	return new Blob([[`# ${data.about}`, heads, ...lines, ""].join("\n")], { type: "text/csv" });
};
const pngOf = (plots) => {
	const ratio = devicePixelRatio, { width, height } = plots[0], sheet = document.createElement("canvas"), wide = plots[1] ? 2 : 1;
	sheet.width = ratio * wide * width;
	sheet.height = ratio * (54 + ceil(plots.length / wide) * (height + 26));
	c = sheet.getContext("2d");
	c.scale(ratio, ratio);
	fill(css.paper, 0, 0, sheet.width, sheet.height);
	let at = 12;
	write(document.title, at, 16, css.ink, 14, "left");
	for (const { name, shown, colour } of plots[0].chart.lines) if (shown) {
		write(name, at, 38, paint(colour), 12, "left");
		at += c.measureText(name).width + 16;
	}
	plots.forEach(({ chart, panel, sheet: drawn }, k) => {
		const x = k % wide * width, y = 54 + floor(k / wide) * (height + 26);
		write(`${chart.panels[panel]} [${chart.units[panel]}]`, x + 12, y + 12, css.ink, 12, "left");
		c.drawImage(drawn, x, y + 24, width, height);
	});
	return new Promise((done) => { sheet.toBlob(done); });
};
const openTools = (chart, plots, tools) => {
	const whole = $(".whole", tools), log = document.title.split(" – ").at(-1).replace(/[^\w-]+/g, "_");
	chart.clock.buttons.push(whole);
	on(whole, "click", () => chart.clock.zoom());
	$$(".chip", tools).forEach((chip, k) => on(chip, "click", () => { chip.ariaPressed = chart.lines[k].shown = !chart.lines[k].shown; ask(LINES); }));
	for (const [ending, make] of Object.entries({ csv: csvOf, png: pngOf })) on($(`.${ending}`, tools), "click", async () => {
		const href = URL.createObjectURL(await make(plots));
		Object.assign(document.createElement("a"), { href, download: `${log}_${chart.key}.${ending}` }).click();
		setTimeout(() => URL.revokeObjectURL(href), 1000);
	});
};

// ---- The arm in three dimensions.
const turn = (R, v) => [0, 3, 6].map((k) => R[k] * v[0] + R[k + 1] * v[1] + R[k + 2] * v[2]);
const add = (a, b, k = 1) => a.map((x, i) => x + k * b[i]);
const product = (A, B) => A.map((_, k) => [0, 1, 2].reduce((sum, j) => sum + A[k - k % 3 + j] * B[3 * j + k % 3], 0));
// Poses of the base, of every link and of the flange in base axes: rotation and origin.
const posesOf = (chain, q) => {
	let R = [1, 0, 0, 0, 1, 0, 0, 0, 1], p = [0, 0, 0];
	const found = [[R, p]];
	chain.rotation.forEach((turned, j) => {
		const x = cos(q[j]), y = sin(q[j]);
		p = add(p, turn(R, chain.translation[j]));
		R = product(product(R, turned), [x, -y, 0, y, x, 0, 0, 0, 1]);
		found.push([R, p]);
	});
	return [...found, [product(R, chain.flange_rotation), add(p, turn(R, chain.flange_translation))]];
};
class Arm {
	zoom = 1;
	constructor(clock) {
		Object.assign(this, { clock, ...stage.view, canvas: $("#arm canvas") });
		this.every = ceil(clock.t.length / 3000);
		this.swept = [...clock.t].filter((_, i) => i % this.every === 0).map((t) => this.poses(t).at(-1)[1]);
		this.listen();
		watch(this, this.canvas);
	}
	// Between two samples a joint goes on evenly.
	poses(t) {
		const { t: times, gaps } = this.clock, near = this.clock.index(t), i = times[near] > t && near ? near - 1 : near, j = min(i + 1, times.length - 1);
		const share = gaps.has(j) || j === i ? 0 : clamp((t - times[i]) / (times[j] - times[i]), 0, 1);
		return posesOf(stage.chain, stage.q.map((row) => rows[row][i] + share * (rows[row][j] - rows[row][i] || 0)));
	}
	// Place on the canvas, depth, pixels a metre there.
	seen(point) {
		const [x, y, z] = add(point, this.centre, -1), [cy, sy, cp, sp] = [cos(this.yaw), sin(this.yaw), cos(this.pitch), sin(this.pitch)];
		const ahead = cy * y - sy * x, depth = cp * ahead - sp * z, near = this.scale * this.zoom / (1 + depth / (4.2 * this.reach));
		return [this.width / 2 + near * (cy * x + sy * y), this.height / 2 - near * (sp * ahead + cp * z), depth, near];
	}
	draw() {
		if (!begin(this)) return;
		const { width, height } = this, t = this.clock.now, contact = contactAt(t), frames = this.poses(t);
		this.scale = .92 * min(width / this.span[0], height / this.span[1]);
		c.clearRect(0, 0, width, height);
		const parts = stage.shapes.map(([frame, a, b, radius, joint]) => {
			const [R, p] = frames[frame], ends = [a, b].map((end) => add(p, turn(R, end)));
			return { ends, radius, joint, hit: contact?.frames.includes(frame), depth: this.seen(ends[0])[2] + this.seen(ends[1])[2] };
		});
		this.ground(parts);
		this.trace(t);
		for (const part of parts.sort((a, b) => b.depth - a.depth)) this.link(part, contact && !contact.sure);
		this.axes();
		if (contact?.force) this.arrow(contact, frames, t);
	}
	ground(parts) {
		const far = ceil(5.2 * this.reach), end = far / 4;
		for (let k = -far; k <= far; k++) {
			c.globalAlpha = 1 - abs(k) / (far + 1);
			path([[k / 4, -end, 0], [k / 4, end, 0], null, [-end, k / 4, 0], [end, k / 4, 0]].map((p) => p && this.seen(p)), css.line);
		}
		c.globalAlpha = 1;
		path(parts.flatMap(({ ends }) => [null, ...ends.map(([x, y]) => this.seen([x, y, 0]))]), css.unseen, 1.6 * parts[0].radius * this.seen([0, 0, 0])[3]);
	}
	// The flange's way: amber in contacts, blue where it was a moment ago.
	trace(t) {
		const seen = this.swept.map((point) => this.seen(point)), part = (...ends) => seen.slice(...ends.map((at, k) => k + floor(this.clock.index(at) / this.every)));
		path(seen, css.zero);
		for (const { start, stop } of stage.contacts) path(part(start, stop), css.touch, 2);
		path(part(t - 1.2, t), css.force, 2);
	}
	link({ ends, radius, joint, hit }, several) {
		const [[ax, ay, , near], [bx, by]] = ends.map((end) => this.seen(end)), r = radius * near, length = hypot(bx - ax, by - ay);
		let [nx, ny] = length > 1 ? [(ay - by) / length * r, (bx - ax) / length * r] : [-r, 0];
		if (nx + 2 * ny > 0) [nx, ny] = [-nx, -ny]; // lit from upper left
		const light = c.createLinearGradient(ax + nx, ay + ny, ax - nx, ay - ny);
		const colours = hit ? several ? ["#ffd9bd", "#f2a673", "#c47a45"] : ["#ff9d5c", "#e0610f", "#9c3c05"] : joint ? ["#8da3b8", "#5f7990", "#334a5e"] : ["#fdfefe", "#d5dbe1", "#8d98a4"];
		colours.forEach((colour, k) => light.addColorStop(k / 2, colour));
		for (const [colour, wide] of [[css.card, 2 * r + 2.4], [light, 2 * r]]) path([[ax, ay], [bx + .01, by]], colour, wide);
	}
	// On the flange the force has its direction of the moment, elsewhere that of the peak.
	arrow(contact, frames, t) {
		const { size, half } = forceAt(contact, t), { wrench, most } = stage, at = this.clock.index(t), [R] = frames.at(-1), [a, b] = contact.spot.map((k) => frames[k][1]);
		if (!size) return;
		const force = wrench && a === b && at !== contact.i ? wrench.rows.map((row) => rows[row][at]) : [], strong = hypot(...force);
		const along = strong > 1e-9 ? (wrench.flange ? turn(R, force) : force).map((x) => x / strong) : contact.along, tip = add(a, add(b, a, -1), .5);
		const reach = (newtons) => this.reach * (.14 + .6 * clamp(newtons / most, 0, 1)), end = (newtons) => this.seen(add(tip, along, -reach(newtons)));
		const [x, y, ahead] = this.seen(tip), [u, v, behind, near] = end(size), long = hypot(x - u, y - v) || 1, dx = (x - u) / long, dy = (y - v) / long;
		// The cone, if any.
		const wide = Math.tan(contact.cone) * reach(size) * near;
		area([[x, y], [u - wide * dy, v + wide * dx], [u + wide * dy, v - wide * dx]], css.band);
		c.beginPath();
		c.ellipse(u, v, wide * abs(ahead - behind) / reach(size), wide, Math.atan2(dy, dx), 0, 7);
		c.fill();
		path([end(max(size - half, 0)), end(size + half)], css.pale, 9);
		path([[u, v], [x - 9 * dx, y - 9 * dy]], css.force, 3.2, contact.sure && contact.cone ? [] : [7, 6]);
		area([[x - 13 * dx - 5.5 * dy, y - 13 * dy + 5.5 * dx], [x, y], [x - 13 * dx + 5.5 * dy, y - 13 * dy - 5.5 * dx]], css.force);
		write(contact.sized ? `${round(size)} N` : contact.force, clamp(u - 24 * dx, 30, this.width - 30), clamp(v - 18 * dy, 14, this.height - 14), css.force, 14, "center", css.card);
	}
	axes() {
		const [x, y, , near] = this.seen(this.centre), corner = [this.width - 44, this.height - 34];
		for (const [k, name] of [..."xyz"].entries()) {
			const [u, v] = this.seen(add(this.centre, [0, 1, 2].map((j) => +(j === k) * 22 / near))), [dx, dy] = [u - x, v - y];
			path([corner, add(corner, [dx, dy])], css.mute, 1.2);
			write(name, ...add(corner, [dx, dy], 1.45));
		}
	}
	move(change) { Object.assign(this, change); ask(LOOKS); }
	turned(yaw, pitch) { this.move({ yaw: this.yaw + yaw, pitch: clamp(this.pitch + pitch, -.2, 1.5) }); }
	nearer(factor) { this.move({ zoom: clamp(this.zoom * factor, .4, 5) }); }
	reset() { this.move({ ...stage.view, zoom: 1 }); }
	listen() {
		const { canvas } = this, held = new Map(), apart = (a, b) => hypot(a.clientX - b.clientX, a.clientY - b.clientY) || 1;
		on(canvas, "pointerdown", (e) => { held.set(e.pointerId, e); canvas.setPointerCapture(e.pointerId); });
		on(canvas, "pointerup pointercancel", (e) => held.delete(e.pointerId));
		on(canvas, "pointermove", (e) => {
			const old = held.get(e.pointerId), other = [...held.values()].find((each) => each.pointerId !== e.pointerId);
			if (!old) return;
			if (other) this.nearer(apart(e, other) / apart(old, other));
			else this.turned((old.clientX - e.clientX) * .008, e.pointerType === "mouse" ? (e.clientY - old.clientY) * .008 : 0);
			held.set(e.pointerId, e);
		});
		onWheel(canvas, (factor) => this.nearer(1 / factor));
		const turns = (yaw, pitch) => () => this.turned(yaw, pitch), zooms = (factor) => () => this.nearer(factor);
		onKeys(canvas, { ArrowLeft: turns(.12, 0), ArrowRight: turns(-.12, 0), ArrowUp: turns(0, .1), ArrowDown: turns(0, -.1), "+": zooms(1.15), "-": zooms(1 / 1.15), 0: () => this.reset() });
	}
}

// ---- The stage: one moment in the arm, the list, the force and the number.
let stage = null, forceLine = null;
const contactAt = (t) => stage.contacts.find((c) => t >= c.start - 1e-9 && t <= c.stop + 1e-9);
// At the peak it is the contact's number, elsewhere the line's.
const forceAt = (contact, t) => {
	const i = clocks[0].index(t), line = i !== contact.i && forceLine?.plot.value(forceLine, i);
	return line ? { size: line.high, half: line.half } : contact;
};
const wordsAt = (t) => {
	const contact = contactAt(t);
	if (!contact) return [stage.least ? `< ${stage.least}` : "–", "", stage.none];
	const { size, half } = forceAt(contact, t);
	if (clocks[0].index(t) === contact.i || !contact.sized || !size) return [contact.force || "unknown", contact.band, contact.words];
	return [`${round(size)}`, `± ${round(half)} N`, contact.words];
};
class ForcePlot extends Plot {
	top = 34;
	under() {
		const { height } = this;
		for (const [start, stop] of stage.free) within([this.x(start), 0, this.x(stop) - this.x(start), height], () => {
			for (let x = this.x(start) - height; x < this.x(stop); x += 8) path([[x, height], [x + height, 0]], css.hatch);
		});
		if (stage.floor) fill(css.unseen, 0, this.y(stage.floor), this.width, height);
		for (const at of stage.stops) path([[this.x(at), 0], [this.x(at), height]], css.mute, 1, [4, 3]);
	}
	// Numbers above, sizes at the peaks where there is room, the hardest first.
	over() {
		const [low, high] = this.clock.view, inside = stage.contacts.filter(({ peak }) => peak >= low && peak <= high), placed = [];
		let last = 0;
		for (const { number: name, start, stop, weak } of inside) {
			const x = this.x((max(start, low) + min(stop, high)) / 2), half = 4 * `${name}`.length + 3;
			if (x - half < last) continue;
			last = x + half;
			write(name, x, 9, weak ? css.mute : css.ink, 12);
		}
		for (const { peak, size, half: band, sized, force, band: words, weak, load } of inside.sort((a, b) => b.sized - a.sized || b.size - a.size)) {
			if (!size || load) continue;
			const x = this.x(peak), y = this.y(size), text = `${force} ${words}`.replace(" N", ""), half = 3.4 * text.length + 2, middle = clamp(x, LEFT + half, LEFT + this.wide - half);
			path([[x, y], [x + .01, y]], weak ? css.mute : css.force, 8);
			path([[x, y], [x + .01, y]], css.card, 4.4);
			if (placed.some(([at, room]) => abs(at - middle) <= half + room)) continue;
			placed.push([middle, half]);
			write(text, middle, max(this.y(size + band) - 10, 25), weak ? css.mute : css.ink, 12);
		}
	}
	look(x) {
		const { tip, clock: { now, look } } = this, [force, band, words] = wordsAt(now);
		tip.hidden = look === null;
		if (tip.hidden) return;
		tip.textContent = `${seconds(now)} · ${contactAt(now)?.name || words} · ${force} ${band}`;
		tip.style.transform = `translateX(${clamp(x + 10, 0, this.width - tip.offsetWidth)}px)`;
	}
}
const openStage = () => {
	const clock = clocks[0], arm = new Arm(clock), { contacts } = stage, at = (c) => clock.t[c.i], go = (contact) => contact && clock.go(at(contact), true);
	const [view, slider, play, speed, dock, home] = ["#arm .view", "#slider", "#play", "#speed", "#dock", "#arm"].map((query) => $(query));
	const hop = (by) => {
		const from = clock.way?.to ?? clock.head, ahead = contacts.filter((c) => by * (at(c) - from) > 1e-6);
		go(by > 0 ? ahead[0] : ahead.at(-1));
	};
	const run = () => {
		clock.go(clock.head < clock.last ? clock.head : clock.first);
		clock.running = !clock.running;
	};
	clock.moved = () => {
		const t = clock.now, contact = contactAt(t), [force, band, words] = wordsAt(t);
		arm.draw();
		$("b", view).firstChild.data = `${force} `;
		$("i", view).textContent = band;
		$("span", view).textContent = words;
		$("#clock").textContent = seconds(t);
		slider.value = t;
		slider.ariaValueText = `${seconds(t)}, ${force} ${band} ${words}`;
		play.textContent = clock.running ? "❚❚" : "▶";
		play.ariaLabel = clock.running ? "Pause" : "Play";
		for (const { rows: [row, ...why], number: name } of contacts) {
			const here = name === contact?.number;
			if (here === !!row.ariaCurrent) continue;
			for (const each of [row, ...why]) each.ariaCurrent = here ? "true" : null;
			const list = row.closest(".list"), top = row.offsetTop - 40;
			if (here && abs(top - list.scrollTop - list.clientHeight / 2) > list.clientHeight / 2 - 60) list.scrollTop = top;
		}
	};
	for (const contact of contacts) {
		contact.rows = $$(`[data-contact="${contact.number}"]`);
		on(contact.rows[0], "click", (e) => { e.preventDefault(); go(contact); });
	}
	on(slider, "input", () => clock.go(+slider.value));
	const to = (samples, more = 0) => () => clock.go(clock.t[clamp(clock.index(clock.head) + samples, 0, clock.t.length - 1)] + more);
	onKeys(slider, { ArrowLeft: to(-1), ArrowDown: to(-1), ArrowRight: to(1), ArrowUp: to(1), PageUp: to(0, 1), PageDown: to(0, -1) });
	on(play, "click", run);
	on(speed, "click", () => {
		clock.speed = { 1: .25, .25: .1, .1: 4, 4: 1 }[clock.speed];
		speed.textContent = `${clock.speed} ×`;
	});
	on($("#previous"), "click", () => hop(-1));
	on($("#next"), "click", () => hop(1));
	on($("#reset"), "click", () => arm.reset());
	onKeys(window, { " ": run, n: () => hop(1), p: () => hop(-1), "+": () => clock.magnify(.67), "-": () => clock.magnify(1.5), Escape: () => clock.zoom() });
	// Scrolled away, the arm docks, until it is closed there.
	let shut = false;
	const settle = (away) => {
		dock.hidden = !away || shut || innerWidth < 1100;
		(dock.hidden ? home : dock).prepend(view);
		ask(LOOKS);
	};
	new IntersectionObserver(([{ isIntersecting: there }]) => settle(!there)).observe(home);
	on($("#undock"), "click", () => { shut = true; settle(true); });
	clock.go(clock.t[stage.first]);
	self.vftcli = { clock, arm, rows, data }; // for tests
};

// ---- The data: int16 as zigzag differences, all high bytes first, deflated.
const unpack = async ({ blob, steps, sizes }) => {
	const packed = Uint8Array.from(atob(blob), (x) => x.charCodeAt(0));
	const stream = new Response(packed).body.pipeThrough(new DecompressionStream("deflate-raw"));
	const planes = new Uint8Array(await new Response(stream).arrayBuffer()), words = planes.length / 2;
	let place = 0;
	return sizes.map((size, k) => {
		let value = 0;
		return new Float64Array(size).map(() => {
			const word = (planes[place] << 8) | planes[words + place++];
			value = ((value + ((word >>> 1) ^ -(word & 1))) << 16) >> 16;
			return value === -32768 ? NaN : value * steps[k];
		});
	});
};
const open = async () => {
	data = JSON.parse($("#data").textContent);
	rows = await unpack(data);
	readStyle();
	clocks.push(...data.clocks.map((each) => new Clock(each)));
	stage = data.stage;
	for (const chart of data.charts) {
		const onStage = stage && chart.key === "force", place = onStage ? $(".time") : $$(".chart").find((each) => each.dataset.of === chart.key);
		if (!place) continue;
		chart.clock = clocks[chart.clock];
		const plots = $$("figure", place).map((figure, k) => new (onStage ? ForcePlot : Plot)(figure, chart, k));
		openTools(chart, plots, place);
		if (onStage) {
			chart.felt = stage.contacts;
			forceLine = Object.assign(chart.lines.find((line) => line.leads), { plot: plots[0] });
		}
		if (chart.key === "wrench" && stage) stage.wrench &&= { ...stage.wrench, rows: chart.lines.find((line) => line.leads).low };
	}
	if (stage) openStage();
	document.documentElement.classList.add("js");
	on(matchMedia("(prefers-color-scheme: dark)"), "change", () => { readStyle(); ask(LINES); });
	ask(LINES);
};
if ($("#data") && self.DecompressionStream) open();
