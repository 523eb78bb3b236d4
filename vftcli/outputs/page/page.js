// The live part of a page. Until its #data is unpacked, if ever, the drawings stay.
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

// ---- Tables that sort, commands to copy.
const sortBy = (head) => {
	const column = head.cellIndex, body = head.closest("table").tBodies[0], down = head.ariaSort === "ascending" ? -1 : 1;
	const rows = [...body.rows].map((row) => {
		const text = row.cells[column].textContent.trim(), sign = text[1] ? "✗△–✓".indexOf(text[0]) : -1;
		return { row, text, size: !column ? NaN : sign < 0 ? parseFloat(text.match(/\d[\d.]*/)) : sign };
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

// ---- Numbers, colours, and what every drawing is made of.
const seconds = (t) => `${t.toFixed(2)} s`;
const minus = (text) => text.replace("-", "−");
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
	for (const name of document.styleSheets[0].cssRules[0].style) css[name.slice(2)] = css[`var(${name})`] = style.getPropertyValue(name).trim();
};
const paint = (colour) => css[colour] || colour;
// A path through points, broken at null.
const path = (points, stroke, width = 1, dash = []) => {
	let drawn = false;
	c.beginPath();
	for (const point of points) {
		if (point) c[drawn ? "lineTo" : "moveTo"](...point);
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
	Object.assign(drawing, { width, height, pen: width * height ? canvas.getContext("2d") : null });
	Object.assign(canvas, { width: round(width * devicePixelRatio), height: round(height * devicePixelRatio) });
	ask(LINES);
}).observe(canvas);
// Draw on it, where it is shown.
const begin = ({ pen }) => {
	(c = pen)?.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
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
	// The last sample before a time that has one behind it.
	before(t) {
		let low = 0, high = this.t.length - 1;
		while (high - low > 1) { const middle = (low + high) >> 1; if (this.t[middle] <= t) low = middle; else high = middle; }
		return low;
	}
	index(t) { const low = this.before(t); return low + (t - this.t[low] >= this.t[low + 1] - t); }
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
			this.put(from + (to - from) * (1 - (1 - share) ** 3));
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
		const up = ticks(...ends[panel], max(3.6, tall / 34)), across = ticks(...this.clock.view, max(2, wide / 90));
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
		for (let i = this.clock.before(view[0]); i < t.length && t[max(i - 1, 0)] <= view[1]; i++) {
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
			// Three digits of the largest, as far as the steps of the data go, and no negative nought.
			const step = data.steps[line.low[this.panel]], digits = clamp(2 - floor(log10(max(size, step))), 0, max(0, ceil(-log10(step) - .1)));
			const text = (x) => minus((+x.toFixed(digits) + 0).toFixed(digits));
			return name + text(low) + (high - low > .005 * size ? `…${text(high)}` : "") + (isNaN(half) ? "" : ` ± ${text(half)}`);
		});
		return texts[0] ? `${texts.join(" · ")} ${this.chart.units[this.panel]}` : "";
	}
	// Hover looks, a click goes there, a drag zooms; a finger scrubs.
	listen() {
		const { box, clock, chosen } = this, isMouse = (e) => e.pointerType === "mouse";
		let from = null;
		on(box, "pointerdown", (e) => {
			if (e.button) return;
			from = e.offsetX;
			box.setPointerCapture(e.pointerId);
		});
		on(box, "pointermove", (e) => {
			const x = e.offsetX;
			if (!isMouse(e)) return from !== null && clock.go(this.time(x));
			if (from !== null && abs(x - from) > 5) chosen.hidden = false;
			Object.assign(chosen.style, { left: `${min(x, from)}px`, width: `${abs(x - from)}px` });
			clock.look = this.time(x);
			ask(LOOKS);
		});
		on(box, "pointerup", (e) => {
			const ends = [from, e.offsetX].map((x) => this.time(x)), dragged = !chosen.hidden;
			chosen.hidden = true;
			if (from === null) return;
			from = null;
			if (dragged) clock.zoom(min(...ends), max(...ends));
			else clock.go(ends[1]);
			clock.look = dragged || !isMouse(e) ? null : ends[1];
		});
		on(box, "pointercancel pointerleave", () => { from = clock.look = null; chosen.hidden = true; ask(LOOKS); });
		on(box, "dblclick", () => clock.zoom());
		onWheel(box, (factor, e) => clock.magnify(factor, this.time(e.offsetX)));
	}
}

// ---- What is seen, as CSV or as PNG.
const csvOf = (plots) => {
	const { chart, clock } = plots[0], [low, high] = clock.view, heads = ["t [s]"], columns = [];
	for (const plot of plots) for (const line of chart.lines) if (line.shown) {
		for (const [part, name] of line.columns) {
			heads.push(`${chart.panels[plot.panel]} ${name} [${chart.units[plot.panel]}]`);
			columns.push((i) => plot.value(line, i)[part]);
		}
	}
	const lines = Array.from(clock.t, (t, i) => t > low - 1e-9 && t < high + 1e-9 && [t.toFixed(4), ...columns.map((of) => (isNaN(of(i)) ? "" : +of(i).toPrecision(6)))]);
	return new Blob([[`# ${data.about}`, heads, ...lines.filter(Boolean), ""].join("\n")], { type: "text/csv" });
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
	return new Promise((done) => sheet.toBlob(done));
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
const placed = ([R, p], v) => add(p, turn(R, v));
// Hue, saturation, darkest and lightest.
const METALS = { link: [210, 15, 56, 96], joint: [208, 24, 28, 64], hit: [22, 88, 32, 68], perhaps: [25, 80, 52, 87] };
const shade = ([hue, part, dark, bright], light) => `hsl(${hue} ${part}% ${round(dark + clamp(light, 0, 1) * (bright - dark))}%)`;
class Arm {
	zoom = 1;
	constructor(clock) {
		Object.assign(this, stage.view, { clock, canvas: $("#arm canvas") });
		this.every = ceil(clock.t.length / 3000);
		this.swept = [...clock.t].filter((_, i) => !(i % this.every)).map((t) => this.poses(t).at(-1)[1]);
		this.listen();
		watch(this, this.canvas);
	}
	// Rotations and origins of the base, of every link and of the flange; between samples a joint goes on evenly.
	poses(t) {
		const { t: times, gaps } = this.clock, i = this.clock.before(t), j = i + 1, found = [[[1, 0, 0, 0, 1, 0, 0, 0, 1], [0, 0, 0]]];
		const share = gaps.has(j) ? +(t >= times[j]) : clamp((t - times[i]) / (times[j] - times[i]), 0, 1) || 0;
		stage.chain.forEach(([turned, moved], k) => {
			const [from, to = from] = [i, j].map((at) => rows[stage.q[k]]?.[at]), angle = from + share * (to - from) || 0, x = cos(angle), y = sin(angle);
			found.push([product(product(found[k][0], turned), [x, -y, 0, y, x, 0, 0, 0, 1]), placed(found[k], moved)]);
		});
		return found;
	}
	// Place on the canvas, depth, pixels a metre there.
	seen(point) {
		const [x, y, depth] = turn(this.eye, add(point, this.centre, -1)), near = this.scale * this.zoom / (1 + depth / (4.2 * this.reach));
		return [this.width / 2 + near * x, this.height / 2 - near * y, depth, near];
	}
	draw() {
		if (!begin(this)) return;
		const { width, height, yaw, pitch } = this, t = this.clock.now, contact = contactAt(t), frames = this.poses(t), [cy, sy, cp, sp] = [cos(yaw), sin(yaw), cos(pitch), sin(pitch)];
		this.eye = [cy, sy, 0, -sy * sp, cy * sp, cp, -sy * cp, cy * cp, -sp];
		this.scale = .92 * min(width / this.span[0], height / this.span[1]);
		c.clearRect(0, 0, width, height);
		const metal = (frame, own) => METALS[contact?.frames.includes(frame) ? contact.sure ? "hit" : "perhaps" : own];
		const parts = stage.shapes.map(([frame, a, b, radius, own]) => {
			const ends = [a, b].map((end) => placed(frames[frame], end)), seen = ends.map((end) => this.seen(end));
			return { frame, ends, seen, radius, metal: metal(frame, own), depth: seen[0][2] + seen[1][2] };
		});
		this.ground(parts);
		this.trace(t);
		const drawn = parts.filter(({ frame }) => !stage.surfaces[frame]);
		stage.surfaces.forEach((surface, frame) => surface && drawn.push(...this.triangles(surface.map((row) => rows[row]), frames[frame], metal(frame, "link"))));
		for (const part of drawn.sort((a, b) => b.depth - a.depth)) part.colour ? this.triangle(part) : this.capsule(part);
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
	capsule({ seen: [[ax, ay, , near], [bx, by]], radius, metal }) {
		const r = radius * near, [dx, dy] = [bx - ax + .01, by - ay], side = r / hypot(dx, dy) * (2 * dx > dy ? 1 : -1); // lit from upper left
		const light = c.createLinearGradient(ax + dy * side, ay - dx * side, ax - dy * side, ay + dx * side);
		for (const share of [0, 1]) light.addColorStop(share, shade(metal, 1 - share));
		for (const [colour, wide] of [[css.card, 2 * r + 2.4], [light, 2 * r]]) path([[ax, ay], [ax + dx, by]], colour, wide);
	}
	// A line of its colour closes the seam to its neighbour.
	triangle({ seen, colour }) {
		c.fillStyle = c.strokeStyle = colour;
		c.lineWidth = .8;
		c.beginPath();
		for (const [x, y] of seen) c.lineTo(x, y);
		c.closePath();
		c.fill();
		c.stroke();
	}
	// Those of a link that face the eye.
	triangles([x, y, z, ...faces], frame, metal) {
		const corners = Array.from(x, (_, i) => this.seen(placed(frame, [x[i], y[i], z[i]]))), found = [];
		faces[0].forEach((_, k) => {
			const seen = faces.map((corner) => corners[corner[k]]), [a, b, c] = seen, [ux, uy, uz] = add(b, a, -1), [vx, vy, vz] = add(c, a, -1);
			const right = uy * vz - uz * vy, down = uz * vx - ux * vz, ahead = (ux * vy - uy * vx) / a[3], light = .2 - (.4 * right + .6 * down + .6 * ahead) / hypot(right, down, ahead);
			if (ahead < 0) found.push({ seen, depth: 2 / 3 * (a[2] + b[2] + c[2]), colour: shade(metal, light) });
		});
		return found;
	}
	// On the flange the force has its direction of the moment, elsewhere that of the peak.
	arrow(contact, frames, t) {
		const { size, half } = forceAt(contact, t), { wrench, most } = stage, at = this.clock.index(t), [R] = frames.at(-1), [a, b] = contact.spot.map((k) => frames[k][1]);
		if (!size) return;
		const force = wrench && a === b && at !== contact.i ? wrench.rows.map((row) => rows[row][at]) : [], strong = hypot(...force);
		const along = strong > 1e-9 ? (wrench.flange ? turn(R, force) : force).map((x) => x / strong) : contact.along, tip = add(a, add(b, a, -1), .5);
		const reach = (newtons) => this.reach * (.14 + .6 * clamp(newtons / most, 0, 1)), end = (newtons) => this.seen(add(tip, along, -reach(newtons)));
		const [x, y, ahead] = this.seen(tip), [u, v, behind, near] = end(size), long = hypot(x - u, y - v) || 1, dx = (x - u) / long, dy = (y - v) / long;
		const beside = (back, out) => [x - back * dx + out * dy, y - back * dy - out * dx], wide = Math.tan(contact.cone) * reach(size) * near;
		area([[x, y], beside(long, wide), beside(long, -wide)], css.band);
		c.beginPath();
		c.ellipse(u, v, wide * abs(ahead - behind) / reach(size), wide, Math.atan2(dy, dx), 0, 7);
		c.fill();
		path([end(max(size - half, 0)), end(size + half)], css.pale, 9);
		path([[u, v], beside(9, 0)], css.force, 3.2, contact.sure && contact.cone ? [] : [7, 6]);
		area([beside(13, 5.5), [x, y], beside(13, -5.5)], css.force);
		write(contact.sized ? `${round(size)} N` : contact.force, clamp(u - 24 * dx, 30, this.width - 30), clamp(v - 18 * dy, 14, this.height - 60), css.force, 14, "center", css.card);
	}
	axes() {
		const corner = [this.width - 44, this.height - 34];
		[..."xyz"].forEach((name, k) => {
			const along = [22 * this.eye[k], -22 * this.eye[k + 3]];
			path([corner, add(corner, along)], css.mute, 1.2);
			write(name, ...add(corner, along, 1.45));
		});
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
		const turns = (yaw, pitch) => () => this.turned(yaw, pitch);
		onKeys(canvas, { ArrowLeft: turns(.12, 0), ArrowRight: turns(-.12, 0), ArrowUp: turns(0, .1), ArrowDown: turns(0, -.1), "+": () => this.nearer(1.15), "-": () => this.nearer(1 / 1.15), 0: () => this.reset() });
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
	if (!contact) return stage.none;
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
		const [low, high] = this.clock.view, inside = stage.contacts.filter(({ peak }) => peak >= low && peak <= high);
		let placed = [];
		const fits = (at, half) => !placed.some(([other, room]) => abs(at - other) <= half + room) && placed.push([at, half]);
		for (const { number: name, start, stop, weak } of inside) {
			const x = this.x((max(start, low) + min(stop, high)) / 2);
			if (fits(x, 4 * `${name}`.length + 1.5)) write(name, x, 9, weak ? css.mute : css.ink, 12);
		}
		placed = [];
		for (const { peak, size, half: band, sized, force, band: words, weak, load } of inside.sort((a, b) => b.sized - a.sized || b.size - a.size)) {
			if (!size || load) continue;
			const x = this.x(peak), y = this.y(size), text = `${force} ${words}`.replace(" N", ""), half = 3.4 * text.length + 2, middle = clamp(x, LEFT + half, LEFT + this.wide - half);
			for (const [colour, wide] of [[weak ? css.mute : css.force, 8], [css.card, 4.4]]) path([[x, y], [x + .01, y]], colour, wide);
			if (fits(middle, half)) write(text, middle, max(this.y(size + band) - 10, 25), weak ? css.mute : css.ink, 12);
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
		for (const one of contacts) {
			const here = one === contact, row = one.rows[0];
			if (here === !!row.ariaCurrent) continue;
			for (const each of one.rows) each.ariaCurrent = here ? "true" : null;
			const list = row.closest(".list"), top = row.offsetTop - 40;
			if (here && abs(top - list.scrollTop - list.clientHeight / 2) > list.clientHeight / 2 - 60) list.scrollTop = top;
		}
	};
	for (const contact of contacts) {
		contact.rows = $$(`[data-contact="${contact.number}"]`);
		on(contact.rows[0], "click", (e) => { e.preventDefault(); go(contact); });
	}
	on(slider, "input", () => clock.go(+slider.value));
	const to = (samples, more = 0) => () => clock.go((clock.t[clock.index(clock.head) + samples] ?? clock.head) + more);
	onKeys(slider, { ArrowLeft: to(-1), ArrowDown: to(-1), ArrowRight: to(1), ArrowUp: to(1), PageUp: to(0, 1), PageDown: to(0, -1) });
	for (const [id, act] of Object.entries({ play: run, previous: () => hop(-1), next: () => hop(1), reset: () => arm.reset() })) on($(`#${id}`), "click", act);
	on(speed, "click", () => {
		clock.speed = { 1: .25, .25: .1, .1: 4, 4: 1 }[clock.speed];
		speed.textContent = `${clock.speed} ×`;
	});
	onKeys(window, { " ": run, n: () => hop(1), p: () => hop(-1), "+": () => clock.magnify(.67), "-": () => clock.magnify(1.5), Escape: () => clock.zoom() });
	// Scrolled away, the arm docks, until it is closed there.
	let shut = false;
	const settle = (seen) => {
		dock.hidden = seen || shut || innerWidth < 1100;
		(dock.hidden ? home : dock).prepend(view);
		ask(LOOKS);
	};
	new IntersectionObserver(([each]) => settle(each.isIntersecting)).observe(home);
	on($("#undock"), "click", () => { shut = true; settle(); });
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
		const onStage = stage && chart.key === "force", place = $(`[data-of="${chart.key}"]`);
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
