// Plots of the dock: envelopes of all ticks over the last seconds, or every tick of a capture; currents as bars.
{
  const KEPT_S = 60, AXES = ["α", "β", "γ"];
  const each = (key) => AXES.map((name, axis) => ({key: `${key}${axis}`, name, axis}));
  const PANES = {
    angles: {unit: "°", least: 0.1, series: () =>
      [...each("ref").map((line) => ({...line, name: "", dash: true})), ...each("q")]},
    ...Object.fromEntries(AXES.map((name, axis) => [name, {unit: "°", least: 0.1, series: () =>
      [{key: `q${axis}`, name: "actual", axis}, {key: `ref${axis}`, name: "desired", colour: bench.fixed.desired, dash: true}]}])),
    error: {unit: "mrad", least: 0.1, series: () => each("error")},
    torque: {unit: "N·m", least: 0.01, series: () => each("torque")},
    currents: {unit: "A", least: 0.1, series: () => bench.selected.length
      ? bench.selected.map((group, place) => ({key: `current${group}`, name: `${group}:`, colour: bench.fixed.selected[place]}))
      : [{key: "currents", name: "all groups", colour: bench.fixed.plain, spread: true}]},
    temperature: {unit: "°C", least: 0.1, series: () => [{key: "temperature", name: "warmest", colour: bench.fixed.plain}]},
    groups: {unit: "A"},
  };

  // The rows that the dock shows: those of the last minute, or those of a capture.
  const live = {number: [], t: [], bounds: {}};
  const view = {window: 10, end: null, cursor: null, marks: null, paused: false};
  const plots = bench.plots = {PANES, AXES, KEPT_S, live, view, shown: live};

  plots.take = (header) => {
    const {run, count, columns} = header, numbers = header.column(0), times = header.column(1);
    if (header.fixed) Object.assign(live, {number: [], t: [], bounds: {}});
    if (!count) return;
    const from = live.number.findIndex((number) => number >= numbers[0]);
    const kept = from < 0 ? live.number.length : from;
    const drop = live.t.findIndex((t) => t >= times[count - 1] - KEPT_S), first = drop < 0 ? kept : Math.min(drop, kept);
    const joined = (old, added) => [...old.slice(first, kept), ...added];
    live.number = joined(live.number, numbers);
    live.t = joined(live.t, times);
    columns.forEach((key, place) => {
      const old = live.bounds[key] ?? [[], []];
      live.bounds[key] = old.map((values, bound) => joined(values, header.column(2 + 2 * place + bound)));
    });
    // The last bin may not be complete yet. Another query, of a group that was selected meanwhile, stays.
    if (bench.query === header.query) bench.query = {run, after: live.number[live.number.length - 2] ?? ""};
  };

  plots.range = () => {
    const {t, event_s} = plots.shown, last = t[t.length - 1];
    if (event_s !== undefined && view.end === null) return [t[0], last];
    const end = view.end ?? Math.max(last ?? 0, view.window);
    return [end - view.window, end];
  };

  // Index of the first time that is not before a value.
  const first = (t, value) => {
    let [low, high] = [0, t.length];
    while (low < high) { const middle = (low + high) >> 1; if (t[middle] < value) low = middle + 1; else high = middle; }
    return low;
  };

  const step = (span, most) => {
    const raw = span / Math.max(1, most), power = 10 ** Math.floor(Math.log10(raw));
    return [1, 2, 5, 10].find((factor) => factor * power >= raw) * power;
  };

  // Round numbers of an axis: at least two, also on a short axis.
  const ticks = (low, high, most) => {
    const count = (by) => Math.floor(high / by) - Math.ceil(low / by) + 1;
    let by = step(high - low, most);
    while (count(by) < 2) by = step(by, 2.6);  // the next of 1, 2 and 5
    return {by, values: Array.from({length: count(by)}, (_, place) => (Math.ceil(low / by) + place) * by)};
  };

  const label = (value, by) => {
    if (Math.abs(value) >= 1e5) return value.toExponential(1);
    const digits = Math.max(0, Math.min(6, -Math.floor(Math.log10(by) + 1e-9)));
    return value.toFixed(digits).replace(/^-(?=[0.]*$)/, "");
  };

  // Draw one plot; `size` is the height of its text in pixels.
  plots.draw = (pane, fixedRange) => {
    const canvas = pane.querySelector("canvas"), ratio = devicePixelRatio;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== width * ratio || canvas.height !== height * ratio) {
      [canvas.width, canvas.height] = [width * ratio, height * ratio];
    }
    const paint = canvas.getContext("2d"), style = getComputedStyle(pane), size = parseFloat(style.fontSize);
    paint.setTransform(ratio, 0, 0, ratio, 0, 0);
    paint.clearRect(0, 0, width, height);
    paint.font = `${0.9 * size}px sans-serif`;
    const ink = {text: style.color, grid: style.getPropertyValue("--mantine-color-default-border")};
    const area = {left: 4.2 * size, top: 0.7 * size, right: width - 0.5 * size, bottom: height - 1.4 * size};
    const show = pane.dataset.pane === "groups" ? bars : curves, legend = pane.querySelector(".values");
    legend.innerHTML = show({pane, paint, area, size, ink, fixedRange});
    // The plot does not become higher and lower with the width of the numbers.
    legend.style.minHeight = `${legend.offsetHeight}px`;
  };

  const curves = (plot) => {
    const {pane, paint, area, size, ink} = plot, {least: span, series} = PANES[pane.dataset.pane];
    const [start, end] = plots.range(), {t, event_s} = plots.shown;
    const lines = series().filter(({key}) => plots.shown.bounds[key]).map((line) => (
      {...line, colour: line.colour ?? bench.fixed.axes[line.axis], bounds: plots.shown.bounds[line.key]}));
    const [from, to] = [Math.max(0, first(t, start) - 1), Math.min(t.length, first(t, end) + 1)];
    let [low, high] = extremes(lines.map(({bounds}) => bounds), from, to);
    const margin = Math.max(0.06 * (high - low), (span - (high - low)) / 2);
    [low, high] = plot.fixedRange ?? [low - margin, high + margin];
    const x = (value) => area.left + (value - start) / (end - start) * (area.right - area.left);
    const y = levels(plot, low, high);
    times(plot, start, end, x);
    paint.save();
    paint.beginPath();
    paint.rect(area.left, area.top, area.right - area.left, area.bottom - area.top);
    paint.clip();
    for (const {bounds, colour, dash} of lines) envelope(paint, plots.columns(t, bounds, from, to, x), colour, y, dash);
    upright(plot, x, event_s, [4, 3]);
    upright(plot, x, view.cursor, []);
    view.marks?.forEach((value, place) => upright(plot, x, value, [8, 2], "AB"[place]));
    paint.restore();
    pane.scale = {start, end, left: area.left, right: area.right, low, high};
    return legend(lines, t, to, Math.max(high - low, 1e-3) / 300);
  };

  const extremes = (all, from, to) => {
    let [low, high] = [Infinity, -Infinity];
    for (const [least, most] of all) {
      for (let i = from; i < to; i++) { if (least[i] < low) low = least[i]; if (most[i] > high) high = most[i]; }
    }
    return low <= high ? [low, high] : [-1, 1];
  };

  // Values at the pointer as the range of one bin; at two cursors, with the difference; else those of the last bin.
  const legend = (lines, t, to, by) => {
    const at = (value) => Math.max(0, Math.min(t.length, first(t, value + 1e-9)) - 1);
    const middle = ({bounds: [least, most]}, place) => (least[place] + most[place]) / 2;
    const text = (line) => {
      const [least, most] = line.bounds;
      if (view.marks) {
        const [a, b] = view.marks.map((value) => middle(line, at(value)));
        return Number.isNaN(b - a) || b === undefined ? "–" : `${label(a, by)} → ${label(b, by)}, Δ ${label(b - a, by)}`;
      }
      const place = view.cursor === null ? to - 1 : at(view.cursor);
      if (least[place] === undefined || Number.isNaN(least[place])) return "–";
      const [a, b] = [label(least[place], by), label(most[place], by)];
      return view.cursor === null && !line.spread ? label(middle(line, place), by) : a === b ? b : `${a}…${b}`;
    };
    const dashed = lines.some(({name, bounds: [least]}) => !name && !Number.isNaN(least[to - 1])) ? " <i>desired: dashed</i>" : "";
    return lines.filter(({name}) => name).map((line) =>
      `<span style="border-bottom:2px solid ${line.colour}">${line.name} ${text(line)}</span>`).join(" ") + dashed;
  };

  // Numbers and lines of the vertical axis; returns the place of a value.
  const levels = ({paint, area, size, ink}, low, high) => {
    const y = (value) => area.bottom - (value - low) / (high - low) * (area.bottom - area.top);
    const {by, values} = ticks(low, high, (area.bottom - area.top) / (2.2 * size));
    Object.assign(paint, {fillStyle: ink.text, strokeStyle: ink.grid, lineWidth: 1, textAlign: "right", textBaseline: "middle"});
    paint.beginPath();
    for (const value of values) {
      paint.moveTo(area.left, y(value));
      paint.lineTo(area.right, y(value));
      paint.fillText(label(value, by), area.left - 4, y(value));
    }
    paint.stroke();
    return y;
  };

  // Numbers and lines of the time axis.
  const times = ({paint, area, size}, start, end, x) => {
    const room = area.right - area.left, last = end - (end - start) * 1.8 * size / room;
    const {by, values} = ticks(start, last, room / (5 * size));
    Object.assign(paint, {textAlign: "center", textBaseline: "top"});
    paint.beginPath();
    for (const value of values) {
      paint.moveTo(x(value), area.top);
      paint.lineTo(x(value), area.bottom);
      paint.fillText(label(value, by), x(value), area.bottom + 4);
    }
    paint.stroke();
    paint.fillText("s", area.right - 0.4 * size, area.bottom + 4);
  };

  const upright = ({paint, area, size, ink}, x, value, dash, name = "") => {
    if (value === null || value === undefined) return;
    Object.assign(paint, {strokeStyle: ink.text, fillStyle: ink.text, lineWidth: 1, textAlign: "left", textBaseline: "top"});
    paint.setLineDash(dash);
    paint.beginPath();
    paint.moveTo(x(value), area.top);
    paint.lineTo(x(value), area.bottom);
    paint.stroke();
    paint.setLineDash([]);
    paint.fillText(name, x(value) + 0.3 * size, area.top);
  };

  // Bounds of all bins in each column of pixels: no extreme is lost, and no line suggests a wave that is not there.
  plots.columns = (t, [least, most], from, to, x) => {
    const found = [];
    let gap = false;
    for (let i = from; i < to; i++) {
      if (Number.isNaN(least[i])) { gap = true; continue; }
      const at = Math.round(x(t[i])), last = found[found.length - 1];
      if (last?.at === at) { last.low = Math.min(last.low, least[i]); last.high = Math.max(last.high, most[i]); }
      else found.push({at, low: least[i], high: most[i], gap});
      gap = false;
    }
    return found;
  };

  const envelope = (paint, found, colour, y, dash) => {
    Object.assign(paint, {fillStyle: colour, strokeStyle: colour, lineWidth: dash ? 1 : 1.6});
    paint.setLineDash(dash ? [5, 4] : []);
    for (let begin = 0, end; begin < found.length; begin = end) {
      end = begin + 1;
      while (end < found.length && !found[end].gap) end++;
      const part = found.slice(begin, end);
      paint.beginPath();
      for (const {at, high} of part) paint.lineTo(at, y(high));
      if (dash) { paint.stroke(); continue; }  // a desired value has no ripple
      for (const {at, low} of part.reverse()) paint.lineTo(at, y(low));
      paint.closePath();
      paint.globalAlpha = 0.45;
      paint.fill();
      paint.globalAlpha = 1;
      paint.stroke();
    }
    paint.setLineDash([]);
  };

  // Present current of each group, on the scale of the last seconds; the limit is a dashed line where the scale has it.
  const bars = (plot) => {
    const {pane, paint, area, size, ink} = plot, {current_A, limit_A, failed} = bench.header;
    const {t, bounds} = live, from = first(t, t[t.length - 1] - view.window);
    const past = t.length ? extremes([bounds.currents], from, t.length) : [0];
    const now = Math.max(...current_A.map(Math.abs)), peak = Math.max(now, ...past.map(Math.abs));
    const most_A = Math.max(1.08 * peak, limit_A / 200, 0.01);  // the noise of a sensor stays small
    const [low, high] = plot.fixedRange ?? [-most_A, most_A];
    area.bottom -= 0.35 * size;  // room for the marks of groups
    const y = levels(plot, low, high), wide = (area.right - area.left) / current_A.length;
    Object.assign(paint, {textAlign: "center", textBaseline: "top"});
    const every = Math.ceil(step(current_A.length, (area.right - area.left) / (2.2 * size)));
    for (let group = 0; (group + 0.5) * wide < area.right - area.left - 3.8 * size; group += every) {
      paint.fillText(group, area.left + (group + 0.5) * wide, area.bottom + 0.5 * size);
    }
    paint.textAlign = "right";
    paint.fillText("group", area.right, area.bottom + 0.5 * size);
    paint.save();
    paint.beginPath();
    paint.rect(area.left, area.top, area.right - area.left, area.bottom - area.top + 0.35 * size);
    paint.clip();
    current_A.forEach((current, group) => {
      const at = bench.selected.indexOf(group), left = area.left + group * wide, bad = failed.includes(group);
      paint.fillStyle = bad ? bench.fixed.failed : at < 0 ? bench.fixed.plain : bench.fixed.selected[at];
      paint.fillRect(left + 1, y(0), Math.max(1, wide - 2), y(current) - y(0));
      if (bad || at >= 0) paint.fillRect(left + 1, area.bottom + 2, Math.max(1, wide - 2), 0.3 * size);
    });
    paint.strokeStyle = ink.text;
    paint.setLineDash([6, 4]);
    paint.beginPath();
    for (const limit of [-limit_A, limit_A]) { paint.moveTo(area.left, y(limit)); paint.lineTo(area.right, y(limit)); }
    paint.stroke();
    paint.restore();
    pane.scale = {left: area.left, wide, low, high};
    const digits = peak < 0.995 ? 3 : 2, window = +view.window.toPrecision(2);
    return `<span>largest now ${now.toFixed(digits)},</span><span>in ${window} s ${peak.toFixed(digits)},</span>
      <span>limit ±${+limit_A.toPrecision(3)}</span>`;
  };
}
