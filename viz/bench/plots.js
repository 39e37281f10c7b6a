// Plot dock: envelopes of all ticks over the last seconds, or every tick of a capture; currents as bars.
{
  const KEPT_S = 60, WINDOWS = [2, 5, 10, 30, 60], AXES = ["α", "β", "γ"];
  const each = (key) => AXES.map((name, axis) => ({key: `${key}${axis}`, name, axis}));
  const PANES = {
    ...Object.fromEntries(AXES.map((name, axis) => [name, {unit: "°", least: 0.1, series: () =>
      [{key: `q${axis}`, name: "actual", axis}, {key: `ref${axis}`, name: "desired", colour: bench.fixed.desired, thin: true}]}])),
    error: {unit: "mrad", least: 0.1, series: () => each("error")},
    torque: {unit: "N·m", least: 0.01, series: () => each("torque")},
    currents: {unit: "A", least: 0.1, series: () => bench.selected.length
      ? bench.selected.map((group, place) => ({key: `current${group}`, name: `${group}:`, colour: bench.fixed.selected[place]}))
      : [{key: "currents", name: "all", colour: bench.fixed.plain, spread: true}]},
    temperature: {unit: "°C", least: 0.1, series: () => [{key: "temperature", name: "warmest", colour: bench.fixed.plain}]},
  };
  const LEVELS = Object.entries({"error_rad": ["error", "mrad", 1e-3], "q_rad": ["angle", "°", Math.PI / 180],
    "torque_command_Nm": ["torque", "N·m", 1]}).flatMap(([signal, [name, unit, factor]]) =>
    AXES.map((axis, entry) => ({signal, entry, factor, label: `${name} ${axis}, ${unit}`})));

  // The rows that the dock shows: those of the last minute, or those of a capture.
  const live = {number: [], t: [], bounds: {}}, view = {window: 10, end: null, cursor: null, hidden: new Set()};
  let shown = live, dock, panes, due = false, warm = false;
  bench.plots = {live, view, get shown() { return shown; }, range: () => range(), columns: (...all) => columns(...all)};

  const take = (header) => {
    const {run, count, columns} = header, numbers = header.column(0), times = header.column(1);
    if (header.fixed) Object.assign(live, {number: [], t: [], bounds: {}});
    if (count) {
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
      warm = live.bounds.temperature[1].some((value) => !Number.isNaN(value));
    }
    if (!view.paused) draw();
  };

  const range = () => {
    if (shown.event_s !== undefined && view.end === null) return [shown.t[0], shown.t[shown.t.length - 1]];
    const end = view.end ?? Math.max(shown.t[shown.t.length - 1] ?? 0, view.window);
    return [end - view.window, end];
  };

  const first = (t, value) => {
    let [low, high] = [0, t.length];
    while (low < high) { const middle = (low + high) >> 1; if (t[middle] < value) low = middle + 1; else high = middle; }
    return low;
  };

  const step = (span, most) => {
    const raw = span / Math.max(1, most), power = 10 ** Math.floor(Math.log10(raw));
    return [1, 2, 5, 10].find((factor) => factor * power >= raw) * power;
  };
  const label = (value, by) => Math.abs(value) >= 1e5 ? value.toExponential(1) : value.toFixed(Math.max(0, Math.min(6, -Math.floor(Math.log10(by) + 1e-9)))).replace(/^-(?=[0.]*$)/, "");

  const visible = () => Object.keys(PANES).filter((name) => !view.hidden.has(name) && (name !== "temperature" || warm));

  const arrange = () => {
    const names = visible(), {clientWidth, clientHeight} = panes, fits = (n) => clientWidth / n >= 150;
    const cells = names.length + 1, rows = fits(cells) || clientHeight < 130 ? 1 : 2, columns = Math.ceil(cells / rows);
    panes.style.gridTemplate = `repeat(${rows}, 1fr) / repeat(${columns}, 1fr)`;
    const wanted = [...names, "bars"].join();
    if (panes.dataset.names === wanted) return;
    panes.dataset.names = wanted;
    panes.replaceChildren(...[...names, "bars"].map((name) =>
      bench.element(`<div class="pane" data-pane="${name}"><canvas></canvas><div class="values"></div></div>`)));
  };

  const draw = () => {
    if (due || !bench.fixed) return;
    due = true;
    requestAnimationFrame(() => {
      due = false;
      arrange();
      const tops = [...panes.children].map(legendHeight);
      [...panes.children].forEach((pane, place) => {
        const canvas = pane.firstChild, ratio = devicePixelRatio, [width, height] = [pane.clientWidth, pane.clientHeight];
        if (canvas.width !== width * ratio || canvas.height !== height * ratio) {
          [canvas.width, canvas.height] = [width * ratio, height * ratio];
        }
        const paint = canvas.getContext("2d"), style = getComputedStyle(dock), size = parseFloat(style.fontSize);
        paint.setTransform(ratio, 0, 0, ratio, 0, 0);
        paint.clearRect(0, 0, width, height);
        paint.font = `${0.9 * size}px sans-serif`;
        const ink = {text: style.color, grid: style.getPropertyValue("--mantine-color-default-border")};
        const area = {left: 3.6 * size, top: tops[place] + 0.5 * size, right: width - 0.5 * size, bottom: height - 1.3 * size};
        if (pane.dataset.pane === "bars") bars(paint, area, size, ink, pane);
        else plot(paint, area, size, ink, pane);
      });
      if ([...panes.children].some((pane, place) => legendHeight(pane) !== tops[place])) draw();
    });
  };

  // Lines that the legend of a pane needs; it does not become lower while only its numbers change.
  const legendHeight = (pane) => {
    const legend = pane.lastChild, key = [pane.clientWidth, legend.children.length, view.cursor === null].join();
    const height = Math.max(legend.offsetHeight, pane.legend?.key === key ? pane.legend.height : 0);
    pane.legend = {key, height};
    return height;
  };

  const plot = (paint, area, size, ink, pane) => {
    const {unit, least: span, series} = PANES[pane.dataset.pane], [start, end] = range(), {t} = shown;
    const lines = series().filter(({key}) => shown.bounds[key]).map((line) => (
      {...line, colour: line.colour ?? bench.fixed.axes[line.axis], bounds: shown.bounds[line.key]}));
    const [from, to] = [Math.max(0, first(t, start) - 1), Math.min(t.length, first(t, end) + 1)];
    let [low, high] = [Infinity, -Infinity];
    for (const {bounds: [least, most]} of lines) {
      for (let i = from; i < to; i++) { if (least[i] < low) low = least[i]; if (most[i] > high) high = most[i]; }
    }
    if (!(low <= high)) [low, high] = [-1, 1];
    const margin = Math.max(0.06 * (high - low), (span - (high - low)) / 2);
    [low, high] = [low - margin, high + margin];
    const x = (value) => area.left + (value - start) / (end - start) * (area.right - area.left);
    const y = (value) => area.bottom - (value - low) / (high - low) * (area.bottom - area.top);
    grid(paint, area, size, ink, {start, end, low, high, x, y});
    paint.save();
    paint.beginPath();
    paint.rect(area.left, area.top, area.right - area.left, area.bottom - area.top);
    paint.clip();
    for (const {bounds, colour, thin} of lines) band(paint, columns(t, bounds, from, to, x), colour, y, thin);
    for (const [value, dash] of [[shown.event_s, [4, 3]], [view.cursor, []]]) {
      if (value === null || value === undefined) continue;
      paint.strokeStyle = ink.text;
      paint.lineWidth = 1;
      paint.setLineDash(dash);
      paint.beginPath();
      paint.moveTo(x(value), area.top);
      paint.lineTo(x(value), area.bottom);
      paint.stroke();
    }
    paint.restore();
    paint.setLineDash([]);
    const at = view.cursor === null ? Math.min(to, t.length) - 1 : Math.max(0, Math.min(t.length, first(t, view.cursor + 1e-9)) - 1);
    const value = ({bounds: [least, most], spread}) => {
      if (at < 0 || least[at] === undefined) return "–";
      const by = Math.max(high - low, 1e-3) / 100, [a, b] = [label(least[at], by), label(most[at], by)];
      return view.cursor === null && !spread ? label((least[at] + most[at]) / 2, by) : a === b ? b : `${a}…${b}`;
    };
    pane.lastChild.innerHTML = `<b>${pane.dataset.pane}, ${unit}</b> ` + lines.map((line) =>
      `<span style="border-bottom:2px solid ${line.colour}">${line.name} ${value(line)}</span>`).join(" ");
    pane.scale = {start, end, left: area.left, right: area.right};
  };

  const grid = (paint, area, size, ink, {start, end, low, high, x, y}) => {
    paint.fillStyle = ink.text;
    paint.strokeStyle = ink.grid;
    paint.lineWidth = 1;
    paint.beginPath();
    // At least two numbers, also in a low plot.
    const labels = (by) => Math.floor(high / by) - Math.ceil(low / by) + 1;
    let by = step(high - low, (area.bottom - area.top) / (2.2 * size));
    while (labels(by) < 2) by = step(by, 2.6);  // the next of 1, 2 and 5
    paint.textAlign = "right";
    paint.textBaseline = "middle";
    for (let value = Math.ceil(low / by) * by; value <= high; value += by) {
      paint.moveTo(area.left, y(value));
      paint.lineTo(area.right, y(value));
      paint.fillText(label(value, by), area.left - 4, y(value));
    }
    const every = step(end - start, (area.right - area.left) / (3.5 * size));
    paint.textAlign = "center";
    paint.textBaseline = "top";
    for (let value = Math.ceil(start / every) * every; value <= end; value += every) {
      paint.moveTo(x(value), area.top);
      paint.lineTo(x(value), area.bottom);
      if (x(value) < area.right - size) paint.fillText(label(value, every), x(value), area.bottom + 3);
    }
    paint.stroke();
    paint.textAlign = "left";
    paint.fillText("s", area.right - 0.4 * size, area.bottom + 3);
  };

  // Bounds of all bins in each column of pixels: no extreme is lost, and no line suggests a wave that is not there.
  const columns = (t, [least, most], from, to, x) => {
    const found = [];
    for (let i = from; i < to; i++) {
      if (Number.isNaN(least[i])) continue;
      const at = Math.round(x(t[i])), last = found[found.length - 1];
      if (last?.at === at) { last.low = Math.min(last.low, least[i]); last.high = Math.max(last.high, most[i]); }
      else found.push({at, low: least[i], high: most[i]});
    }
    return found;
  };

  const band = (paint, found, colour, y, thin) => {
    if (!found.length) return;
    paint.beginPath();
    for (const {at, high} of found) paint.lineTo(at, y(high));
    for (const {at, low} of found.reverse()) paint.lineTo(at, y(low));
    paint.closePath();
    paint.fillStyle = paint.strokeStyle = colour;
    paint.lineWidth = thin ? 1 : 1.6;
    paint.globalAlpha = 0.45;
    paint.fill();
    paint.globalAlpha = 1;
    paint.stroke();
  };

  const bars = (paint, area, size, ink, pane) => {
    const {current_A, limit_A, failed} = bench.header, limit = limit_A || Math.max(...current_A.map(Math.abs), 1);
    area.top += 0.4 * size;  // half of the height of its number
    const middle = (area.top + area.bottom) / 2, half = (area.bottom - area.top) / 2, wide = (area.right - area.left) / current_A.length;
    paint.fillStyle = ink.text;
    paint.strokeStyle = ink.grid;
    paint.textAlign = "right";
    paint.textBaseline = "middle";
    paint.beginPath();
    for (const share of [-1, 0, 1]) {
      paint.moveTo(area.left, middle - share * half);
      paint.lineTo(area.right, middle - share * half);
      paint.fillText((share * limit).toPrecision(2), area.left - 4, middle - share * half);
    }
    paint.stroke();
    paint.textAlign = "center";
    paint.textBaseline = "top";
    const every = Math.max(1, step(current_A.length, (area.right - area.left) / (2 * size)));
    for (let group = 0; group < current_A.length; group += every) {
      paint.fillText(group, area.left + (group + 0.5) * wide, area.bottom + 0.35 * size);
    }
    current_A.forEach((current, group) => {
      const at = bench.selected.indexOf(group), left = area.left + group * wide;
      const height = -half * Math.max(-1, Math.min(1, current / limit)), bad = failed.includes(group);
      paint.fillStyle = bad ? bench.fixed.failed : at < 0 ? bench.fixed.plain : bench.fixed.selected[at];
      paint.fillRect(left + 1, middle, Math.max(1, wide - 2), height);
      if (bad || at >= 0) paint.fillRect(left + 1, area.bottom + 2, Math.max(1, wide - 2), 0.3 * size);
    });
    const peak = Math.max(...current_A.map(Math.abs)).toFixed(2);
    pane.lastChild.innerHTML = `<b>groups, A</b> <i>peak ${peak}</i>`;
    pane.scale = {left: area.left, wide};
  };

  const tools = () => {
    const options = (values, text) => values.map((value, place) => `<option value="${place}">${text(value)}</option>`).join("");
    return `<div class="tools">
      <span class="tight">window <select data-do="window">${options(WINDOWS, (s) => `${s} s`)}</select>
      <button data-do="pause" aria-pressed="false" title="pause the display">freeze</button><button data-do="in" title="zoom in">+</button><button
      data-do="out" title="zoom out">−</button></span>
      <span class="tight">${Object.keys(PANES).map((name) => `<button data-show="${name}" aria-pressed="true">${name}</button>`).join("")}</span>
      <span class="tight">capture <select data-do="on">${["off", "level", "fault", "saturation"].map((on) => `<option>${on}</option>`).join("")}</select>
      <select data-do="signal">${options(LEVELS, ({label}) => label)}</select><select data-do="edge"><option>rising</option><option>falling</option></select>
      <input data-do="level" type="number" value="5" step="any" title="level"></span>
      <span class="tight">pre-trigger <input data-do="before" type="number" value="0.2" min="0" step="0.1"> s, length
      <input data-do="length" type="number" value="1" min="0.01" step="0.1"> s
      <button data-do="arm">arm</button><span data-capture></span>
      <button data-do="captured" aria-pressed="false" hidden>show</button><button data-do="csv" hidden>CSV</button></span></div>`;
  };

  const build = () => {
    dock = bench.element(`<div id="bench-dock"><div class="edge"></div>${tools()}<div class="panes"></div></div>`);
    document.body.append(dock);
    panes = dock.querySelector(".panes");
    const find = (name) => dock.querySelector(`[data-do=${name}]`), press = (button, on) => button.setAttribute("aria-pressed", on);
    find("window").value = WINDOWS.indexOf(view.window);
    const zoom = (factor, at = null) => {
      const [start, end] = range(), middle = at ?? end, window = Math.max(0.02, Math.min(KEPT_S, factor * view.window));
      view.end = view.end === null && at === null && shown === live ? null : middle + (end - middle) * window / (end - start);
      view.window = window;
      draw();
    };
    const pause = (on) => {
      view.paused = on;
      view.end = on ? range()[1] : null;
      press(find("pause"), on);
      draw();
    };
    const capture = async (on) => {
      if (on) {
        const header = await bench.fetch("/capture.data", {groups: bench.selected.join()});
        const bounds = Object.fromEntries(header.columns.map((key, place) => [key, [header.column(2 + 2 * place), header.column(3 + 2 * place)]]));
        shown = {t: header.column(1), bounds, event_s: header.event_s};
        view.window = header.count ? shown.t[header.count - 1] - shown.t[0] : 1;
      } else {
        shown = live;
        view.window = WINDOWS[find("window").value] ?? 10;
      }
      press(find("captured"), on);
      find("captured").textContent = on ? "live" : "show";
      pause(on);
      view.end = null;
      draw();
    };
    const actions = {
      pause: () => pause(!view.paused), in: () => zoom(0.5), out: () => zoom(2), captured: () => capture(shown === live), csv: save,
      arm: () => {
        const {signal, entry, factor} = LEVELS[find("signal").value];
        bench.send("capture", {on: find("on").value, signal, entry, level: factor * find("level").value, edge: find("edge").value,
          before_s: +find("before").value, length_s: +find("length").value});
        if (shown !== live) capture(false);
      },
    };
    dock.addEventListener("click", ({target}) => {
      actions[target.tagName === "BUTTON" ? target.dataset.do : ""]?.();
      const {show} = target.dataset;
      if (show) {
        view.hidden[view.hidden.has(show) ? "delete" : "add"](show);
        press(target, !view.hidden.has(show));
        draw();
      }
      if (target.tagName === "BUTTON") target.blur();
    });
    const choose = () => {
      for (const name of ["signal", "edge", "level"]) find(name).hidden = find("on").value !== "level";
    };
    find("on").addEventListener("change", choose);
    choose();
    find("window").addEventListener("change", ({target}) => { view.window = WINDOWS[target.value]; view.end = null; pause(false); target.blur(); });
    bench.listeners.push(({capture: [state, t_s]}) => {
      const at = t_s === null ? "" : ` at ${t_s.toFixed(3)} s`;
      dock.querySelector("[data-capture]").textContent = state === "off" ? "" : state + at;
      for (const name of ["captured", "csv"]) find(name).hidden = state !== "complete";
    });
    pointer(zoom, draw);
    edge();
    new ResizeObserver(draw).observe(dock);
  };

  const save = async () => {
    const header = await bench.fetch("/capture.data", {groups: bench.selected.join()});
    const keys = header.columns.map((key, place) => [key, header.column(2 + 2 * place)]);
    const rows = Array.from(header.column(1), (t, row) => [t, ...keys.map(([, values]) => values[row])].join());
    const file = new Blob([["t_s", ...header.columns].join() + "\n" + rows.join("\n") + "\n"], {type: "text/csv"});
    const link = bench.element(`<a download="capture.csv"></a>`);
    link.href = URL.createObjectURL(file);
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1e3);
  };

  // Cursor, zoom by the wheel, pan by dragging, groups by a click on their bars.
  const pointer = (zoom, draw) => {
    let drag = null;
    const paneOf = ({target}) => target.closest?.(".pane");
    const time = ({start, end, left, right}, box, x) => start + (x - box.x - left) / (right - left) * (end - start);
    const timeIn = (pane, x) => time(pane.scale, pane.getBoundingClientRect(), x);
    const group = (pane, x) => Math.floor((x - pane.getBoundingClientRect().x - pane.scale.left) / pane.scale.wide);
    panes.addEventListener("pointermove", (event) => {
      const pane = paneOf(event);
      if (!pane?.scale) return;
      if (pane.dataset.pane === "bars") {
        const at = group(pane, event.clientX);
        return bench.showTip(at in bench.header.current_A ? bench.text(at) : "", event.clientX, event.clientY);
      }
      if (drag) view.end = drag.end + drag.t - time(drag.scale, drag.box, event.clientX);
      view.cursor = drag ? null : timeIn(pane, event.clientX);
      draw();
    });
    panes.addEventListener("pointerleave", () => { view.cursor = null; bench.showTip(""); draw(); });
    panes.addEventListener("pointerdown", (event) => {
      const pane = paneOf(event);
      if (!pane?.scale || event.button) return;
      if (pane.dataset.pane === "bars") {
        const at = group(pane, event.clientX);
        if (at in bench.header.current_A) bench.select(at);
        return draw();
      }
      drag = {scale: {...pane.scale}, box: pane.getBoundingClientRect(), t: timeIn(pane, event.clientX), end: range()[1]};
      panes.setPointerCapture(event.pointerId);
    });
    panes.addEventListener("pointerup", () => { drag = null; });
    panes.addEventListener("wheel", (event) => {
      const pane = paneOf(event);
      if (pane?.scale?.end === undefined) return;
      event.preventDefault();
      zoom(event.deltaY < 0 ? 0.8 : 1.25, timeIn(pane, event.clientX));
    }, {passive: false});
    panes.addEventListener("dblclick", () => { view.end = null; draw(); });
  };

  const edge = () => {
    const handle = dock.querySelector(".edge");
    handle.addEventListener("pointerdown", ({pointerId}) => handle.setPointerCapture(pointerId));
    handle.addEventListener("pointermove", ({clientY, buttons}) => {
      if (!buttons) return;
      const height = Math.max(90, Math.min(0.7 * innerHeight, innerHeight - clientY));
      document.documentElement.style.setProperty("--dock", `${height}px`);
    });
  };

  addEventListener("DOMContentLoaded", () => { build(); bench.listeners.push(take); });
}
