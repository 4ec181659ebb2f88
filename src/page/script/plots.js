// Plots: values under the pointer, zoom. An axis is {pixels: [at low, at high], range: [low, high], log, label}.
const parts = label => { const m = /^(.*?)\s*\[(.*)\]$/.exec(label || ''); return m ? {name: m[1], unit: m[2]} : {name: label || '', unit: ''}; };

// Axes
const toValue = (axis, pixel) => {
  const [p, r] = [axis.pixels, axis.range], t = (pixel - p[0]) / (p[1] - p[0]);
  return axis.log ? r[0] * Math.pow(r[1] / r[0], t) : r[0] + t * (r[1] - r[0]);
};
const toPixel = (axis, value) => {
  const [p, r] = [axis.pixels, axis.range];
  return p[0] + (p[1] - p[0]) * (axis.log ? Math.log(value / r[0]) / Math.log(r[1] / r[0]) : (value - r[0]) / (r[1] - r[0]));
};
const plain = (v, step) => (Math.abs(v) >= 1e6 && step >= 1) || (Math.abs(v) < 1e-4 && Math.abs(v) > step)
  ? v.toExponential(clamp(Math.ceil(Math.log10(Math.abs(v) / step)), 0, 6)) : v.toFixed(decimalsOf(step));
// Curves are drawn to a tenth of a pixel: no more digits than that are known.
const asText = (axis, pixel) => plain(toValue(axis, pixel), Math.abs(toValue(axis, pixel + 0.1) - toValue(axis, pixel)) || 1);
const low = axis => Math.min(...axis.pixels), high = axis => Math.max(...axis.pixels);

/** Numbers along an axis. */
function tics(axis, wanted) {
  const [a, b] = axis.range, found = [];
  if (axis.log) {
    const factors = b / a < 1000 ? [1, 2, 5] : [1];
    for (let e = Math.floor(Math.log10(a)); e <= Math.log10(b); ++e)
      for (const f of factors) { const v = f * Math.pow(10, e); if (v >= a && v <= b) found.push([v, String(+v.toPrecision(3))]); }
    if (found.length > 1) return found;
    found.length = 0;
  }
  const raw = (b - a) / wanted, power = Math.pow(10, Math.floor(Math.log10(raw)));
  const step = [1, 2, 5, 10].find(f => f * power >= raw) * power;
  for (let k = Math.ceil(a / step - 1e-9); k * step <= b + 1e-9 * step; ++k) found.push([k * step, plain(k * step, step)]);
  return found;
}

/** What was drawn of a series [px]: [x, y, number of the piece]. A bar is one point: its middle and its end. */
function pointsOf(group, series, plot) {
  const points = [];
  const drawn = [...group.querySelectorAll('path,polygon')].map(e => e.getAttribute('d') || e.getAttribute('points'));
  drawn.flatMap(text => text.replace(/h0/g, '').split('M')).forEach((text, piece) => {
    const n = (text.match(/-?\d+\.?\d*/g) || []).map(Number);
    if (!n.length) return;
    if (series.style === 'bars') {
      const xs = n.filter((v, k) => k % 2 === 0), ys = n.filter((v, k) => k % 2);
      const base = plot.y.log ? plot.y.pixels[0] : toPixel(plot.y, 0);
      points.push([(Math.min(...xs) + Math.max(...xs)) / 2, ys.reduce((a, b) => Math.abs(b - base) > Math.abs(a - base) ? b : a)]);
    } else {
      for (let k = 0; k + 1 < n.length; k += 2) points.push([n[k], n[k + 1], piece]);
    }
  });
  // Loops and clouds are no functions of x.
  const alongX = !['dots', 'points'].includes(series.style) &&
    (series.style === 'band' || series.style === 'bars' || points.every((p, k) => !k || p[0] >= points[k - 1][0] - 0.2));
  return {points, alongX};
}

/** Where a curve is at x: its samples there, or the line between those beside it. */
function curveAt(points, best, x) {
  if (Math.abs(best[0] - x) > 2) {
    const next = points.findIndex(p => p[0] >= x), [a, b] = [points[next - 1], points[next]];
    if (next > 0 && a[2] === b[2]) return [[x, a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0])]];
  }
  return points.filter(p => Math.abs(p[0] - best[0]) <= 0.5);  // thinned to extremes it has two
}

/** A drawing that answers: values under the pointer, zoom. */
class Plot {
  constructor(svg) {
    this.svg = svg;
    this.base = JSON.parse(svg.dataset.plot);
    this.view = {x: this.base.x, y: this.base.y};
    this.groups = [...svg.querySelectorAll('g.series')];
    this.picture = svg.querySelectorAll('g.picture');  // instead of curves too dense to be drawn; the groups have some of their points
    this.readout = document.createElement('div');
    this.readout.className = 'readout controls';
    this.readout.setAttribute('role', 'status');
    this.readout.hidden = true;
    svg.parentNode.classList.add('live');
    svg.after(this.readout);
    svg.setAttribute('tabindex', '0');
    svg.addEventListener('pointermove', e => this.moved(e));
    svg.addEventListener('pointerleave', () => { if (!this.from) this.leave(); });
    svg.addEventListener('blur', () => this.leave());
    svg.addEventListener('pointerdown', e => this.pressed(e));
    svg.addEventListener('pointerup', e => this.released(e));
    svg.addEventListener('pointercancel', () => { this.from = null; this.leave(); });
    svg.addEventListener('dblclick', () => this.show(this.base.x, this.base.y));
    svg.addEventListener('keydown', e => this.typed(e));
  }
  make(tag, attributes, text) {
    const element = document.createElementNS(this.svg.namespaceURI, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    if (text !== undefined) element.textContent = text;
    return element;
  }
  /** Pointer in the drawing's own pixels, kept inside the axes. */
  place(event) {
    const box = this.svg.getBoundingClientRect(), view = this.svg.viewBox.baseVal, {x, y} = this.base;
    return [clamp((event.clientX - box.left) * view.width / box.width, low(x), high(x)),
            clamp((event.clientY - box.top) * view.height / box.height, low(y), high(y))];
  }
  seen(point) {  // a point of the drawing as it was made, where it is shown now
    return [toPixel(this.view.x, toValue(this.base.x, point[0])), toPixel(this.view.y, toValue(this.base.y, point[1]))];
  }
  moved(event) {
    const at = this.place(event);
    if (this.from) this.drag(at); else this.point(at);
  }
  leave() {
    this.cross?.remove();
    this.readout.hidden = true;
  }

  // Values
  point(at) {
    this.leave();
    this.at = at;
    const {x, y} = this.base, base = [toPixel(x, toValue(this.view.x, at[0])), toPixel(y, toValue(this.view.y, at[1]))];
    const names = this.base.categories, category = names && clamp(Math.round(toValue(x, base[0])), 0, names.length - 1);
    if (names) base[0] = toPixel(x, category);
    const dots = [], lines = this.base.levels ? this.levelAt(base) : this.valuesAt(base, dots);
    const {name, unit} = parts(x.label);
    this.readout.textContent = names ? names[category] : `${name} ${asText(x, base[0])} ${unit}`.trim();
    for (const line of lines) this.readout.append(document.createElement('br'), line);
    this.readout.hidden = false;
    const box = this.svg.getBoundingClientRect(), around = this.svg.parentNode.getBoundingClientRect();
    const scale = box.width / this.svg.viewBox.baseVal.width, left = at[0] * scale, wide = this.readout.offsetWidth;
    this.readout.style.left = `${box.left - around.left + (left + wide + 20 < box.width ? left + 12 : Math.max(0, left - wide - 12))}px`;
    this.readout.style.top = `${box.top - around.top + low(y) * scale - 4}px`;
    this.cross = this.make('g', {class: 'cross'});
    this.cross.append(this.make('path', {d: `M${at[0]},${low(y)}V${high(y)}M${low(x)},${at[1]}H${high(x)}`, fill: 'none', stroke: 'var(--mark)', 'stroke-dasharray': '2 3'}));
    for (const [place, colour] of dots) {
      const [cx, cy] = this.seen(place);
      if (cx >= low(x) - 1 && cx <= high(x) + 1 && cy >= low(y) - 1 && cy <= high(y) + 1)
        this.cross.append(this.make('circle', {cx, cy, r: 3.5, fill: `var(${colour})`, stroke: 'var(--page)'}));
    }
    this.svg.append(this.cross);
  }
  valuesAt(at, dots) {
    const {x, y} = this.base, unit = parts(y.label).unit, lines = [];
    this.groups.forEach(group => {
      const series = this.base.series[group.dataset.i];
      const {points, alongX} = group.heftPoints ||= pointsOf(group, series, this.base);
      if (!points.length) return;
      const far = alongX ? p => Math.abs(p[0] - at[0]) : p => Math.hypot(p[0] - at[0], p[1] - at[1]);
      let best = points.reduce((a, b) => far(b) < far(a) ? b : a);
      let near = [best];
      if (series.style === 'steps') near = [points.filter(p => p[0] <= at[0]).pop() || points[0]];
      else if (series.style === 'line' && alongX) near = curveAt(points, best, at[0]);
      else if (alongX) near = points.filter(p => Math.abs(p[0] - best[0]) <= 0.5);
      const ys = near.map(p => p[1]), bottom = Math.max(...ys), top = Math.min(...ys);
      const cut = this.base.cut && (top <= low(y) + 0.2 ? '≥ ' : bottom >= high(y) - 0.2 ? '≤ ' : '') || '';
      const from = asText(y, bottom), to = asText(y, top);
      let text = from === to || cut ? cut + (cut === '≤ ' ? from : to) : `${from} … ${to}`;
      if (unit) text += ` ${unit}`;
      if (!alongX) text += ` at ${asText(x, best[0])} ${parts(x.label).unit}`.trimEnd();
      lines.push((series.label ? `${series.label}: ` : `${parts(y.label).name} `) + text);
      dots.push([[near[0][0], top], series.colour]);
      if (bottom - top > 1) dots.push([[near[0][0], bottom], series.colour]);
    });
    return lines;
  }
  levelAt(at) {
    const point = this.svg.createSVGPoint();
    [point.x, point.y] = at;
    const shown = this.window ? [...this.window.querySelectorAll('g.series')] : this.groups;
    const inside = shown.filter(g => [...g.querySelectorAll('polygon')].some(p => p.isPointInFill(point))).pop();
    const {y} = this.base, up = parts(y.label);
    const lines = [`${up.name} ${asText(y, at[1])} ${up.unit}`.trim()];
    if (inside) lines.push(`${this.base.levels[inside.dataset.i]} ${this.base.value}`.trim());
    return lines;
  }

  // Zoom
  pressed(event) {
    if (event.button) return;
    this.from = this.place(event);
    this.svg.setPointerCapture(event.pointerId);
  }
  drag(at) {
    this.frameOfDrag?.remove();
    const {x0, x1, y0, y1} = this.dragged(at);
    this.frameOfDrag = this.make('rect', {x: x0, y: y0, width: x1 - x0, height: y1 - y0, fill: 'var(--mark)', 'fill-opacity': 0.2});
    this.svg.append(this.frameOfDrag);
  }
  /** A drag along one axis keeps the range of the other. */
  dragged(at) {
    const [a, b] = this.from, {x, y} = this.base, flat = Math.abs(at[1] - b) < 12, narrow = !flat && Math.abs(at[0] - a) < 12;
    return {x0: narrow ? low(x) : Math.min(a, at[0]), x1: narrow ? high(x) : Math.max(a, at[0]),
            y0: flat ? low(y) : Math.min(b, at[1]), y1: flat ? high(y) : Math.max(b, at[1])};
  }
  released(event) {
    if (!this.from) return;
    const {x0, x1, y0, y1} = this.dragged(this.place(event)), {x, y} = this.view;
    this.from = null;
    this.frameOfDrag?.remove();
    if (x1 - x0 < 6) return;
    this.show({...x, range: [toValue(x, x0), toValue(x, x1)]}, {...y, range: [toValue(y, y1), toValue(y, y0)]});
  }
  zoomAbout(factor, shift = 0) {
    const {x, y} = this.view, middle = this.at ? this.at[0] : (x.pixels[0] + x.pixels[1]) / 2;
    const ends = x.pixels.map(p => middle + (p - middle) * factor + shift * (x.pixels[1] - x.pixels[0]));
    const range = ends.map((p, k) => clamp(toValue(x, p), ...this.base.x.range));
    if (range[1] > range[0]) this.show({...x, range}, factor > 1 && range.every((v, k) => v === this.base.x.range[k]) ? this.base.y : y);
  }
  /** Shows a part of the drawing: the curves in a window of their own, with an axis of its own. */
  show(x, y) {
    // Curves are known to a tenth of a pixel; a thousandfold enlargement shows nothing more.
    const share = (view, base) => Math.abs(toPixel(base, view.range[1]) - toPixel(base, view.range[0])) / Math.abs(base.pixels[1] - base.pixels[0]);
    if (share(x, this.base.x) < 1e-3 || share(y, this.base.y) < 1e-3) return;
    this.leave();
    this.view = {x, y};
    for (const part of ['window', 'axes', 'notes']) this[part]?.remove();
    this.window = null;
    const whole = x.range.every((v, k) => v === this.base.x.range[k]) && y.range.every((v, k) => v === this.base.y.range[k]);
    this.svg.classList.toggle('zoomed', !whole);
    if (whole) return;
    const b = this.base, [left, top] = [low(b.x), low(b.y)], [wide, tall] = [high(b.x) - left, high(b.y) - top];
    const [x0, x1] = x.range.map(v => toPixel(b.x, v)), [y1, y0] = y.range.map(v => toPixel(b.y, v));
    this.window = this.make('svg', {x: left, y: top, width: wide, height: tall, viewBox: `${x0} ${y0} ${x1 - x0} ${y1 - y0}`, preserveAspectRatio: 'none', class: 'window'});
    for (const group of [...this.picture, ...this.groups]) this.window.append(group.cloneNode(true));
    this.axes = this.make('g', {class: 'axes'});
    this.drawAxes(x, y);
    this.notes = this.make('svg', {x: left, y: top, width: wide, height: tall, viewBox: `${left} ${top} ${wide} ${tall}`});
    if (b.levels) this.drawMap(x, y);
    this.svg.append(this.axes, this.window, this.notes);
  }
  /** Frames and places of a map over it, the key of its colours beside it. */
  drawMap(x, y) {
    const {levels, tints, borders = [], frames = [], places = [], value} = this.base, right = high(x), bottom = high(y), wide = right - low(x);
    const add = (parent, tag, attributes, text) => parent.append(this.make(tag, attributes, text));
    const ink = '#101418', tall = (bottom - low(y)) / levels.length;  // on colours that are the same on any ground
    levels.forEach((text, k) => add(this.axes, 'rect', {x: right + 0.025 * wide, y: bottom - (k + 1) * tall, width: 0.025 * wide, height: tall + 0.5, fill: tints[k]}));
    borders.forEach((text, k) => add(this.axes, 'text', {x: right + 0.058 * wide, y: bottom - (k + 1) * tall + 4, fill: 'var(--ink)'}, text));
    add(this.axes, 'text', {x: right + 0.02 * wide, y: low(y) - 10, fill: 'var(--ink)'}, value);
    for (const f of frames) {
      const [x0, x1] = f.x.map(v => toPixel(x, v)), [y1, y0] = f.y.map(v => toPixel(y, v));
      add(this.notes, 'rect', {x: x0, y: y0, width: x1 - x0, height: y1 - y0, fill: 'none', stroke: ink, 'stroke-width': 1.8, ...(f.dashed && {'stroke-dasharray': '6 4'})});
      add(this.notes, 'text', {x: x0 + 5, y: y0 + 18, fill: ink}, f.label);
    }
    for (const p of places) {
      const cx = toPixel(x, p.x), cy = toPixel(y, p.y);
      add(this.notes, 'circle', {cx, cy, r: 8.5, fill: '#ffffff', stroke: ink});
      add(this.notes, 'text', {x: cx, y: cy + 4, 'text-anchor': 'middle', fill: ink}, p.label);
    }
  }
  drawAxes(x, y) {
    const [left, right, top, bottom] = [low(x), high(x), low(y), high(y)];
    const add = (tag, attributes, text) => this.axes.append(this.make(tag, attributes, text));
    const path = (d, colour, more) => add('path', {d, fill: 'none', stroke: `var(${colour})`, ...more});
    const word = (px, py, text, anchor, colour = '--ink') => add('text', {x: px, y: py, 'text-anchor': anchor, fill: `var(${colour})`}, text);
    const names = this.base.categories?.map((text, k) => [k, text]).filter(([k]) => k >= x.range[0] && k <= x.range[1]);
    for (const [value, text] of names || tics(x, right - left > 600 ? 9 : 5)) {
      const px = toPixel(x, value);
      if (!names) path(`M${px},${top}V${bottom}`, '--grid');
      path(`M${px},${bottom}v4.5`, '--ink');
      word(px, bottom + 26, text, 'middle');
    }
    for (const [value, text] of tics(y, 5)) {
      const py = toPixel(y, value);
      path(`M${left},${py}H${right}`, '--grid');
      path(`M${left},${py}h-4.5`, '--ink');
      word(left - 13, py + 4, text, 'end');
    }
    for (const mark of this.base.marks || []) {
      const upright = 'x' in mark, axis = upright ? x : y, p = toPixel(axis, upright ? mark.x : mark.y);
      if (!(p >= low(axis) && p <= high(axis))) continue;
      path(upright ? `M${p},${top}V${bottom}` : `M${left},${p}H${right}`, '--mark', {'stroke-dasharray': '4 3'});
      if (upright) word(p + 4, top + 12, mark.label, 'start', '--mark'); else word(right - 4, p - 4, mark.label, 'end', '--mark');
    }
    path(`M${left},${top}V${bottom}H${right}`, '--ink');
    word(Math.max(2, left - 25), top - 10, y.label, 'start');
    word((left + right) / 2, bottom + 48, x.label, 'middle');
  }
  typed(event) {
    const wide = high(this.base.x) - low(this.base.x), at = this.at || [(low(this.base.x) + high(this.base.x)) / 2, low(this.base.y)];
    const way = {ArrowLeft: -1, ArrowRight: 1}[event.key];
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    if (way && event.shiftKey) this.zoomAbout(1, 0.1 * way);
    else if (way) this.point([clamp(at[0] + 0.01 * wide * way, low(this.base.x), high(this.base.x)), at[1]]);
    else if (event.key === '+' || event.key === '=') this.zoomAbout(0.5);
    else if (event.key === '-') this.zoomAbout(2);
    else if (event.key === 'Escape' || event.key === '0') { this.show(this.base.x, this.base.y); this.leave(); }
    else return;
    event.preventDefault();
  }
}

document.querySelectorAll('svg[data-plot]').forEach(svg => new Plot(svg));
help('Plots: point at one to read its values; drag to enlarge, double-click for the whole. By keys: Tab to it, ← → to read, + − to enlarge, Shift ← → to move, Esc for the whole.');
