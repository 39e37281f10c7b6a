// Dock of the page: one to four plots that the user chooses, their layout, cursors, scales, and the capture.
{
  const {plots} = bench, {PANES, AXES, KEPT_S, live, view} = plots;
  const WINDOWS = [2, 5, 10, 30, 60], MOST = 4, KEY = "spheretwin-bench", FILL = ["angles", "error", "groups", "torque"];
  const LEVELS = Object.entries({"error_rad": ["error", "mrad", 1e-3], "q_rad": ["angle", "°", Math.PI / 180],
    "torque_command_Nm": ["torque", "N·m", 1]}).flatMap(([signal, [name, unit, factor]]) =>
    AXES.map((axis, entry) => ({signal, entry, factor, label: `${name} ${axis}, ${unit}`})));

  let dock, panes, due = false;
  // Quantity and fixed scale of each plot, in their order; height of the dock, pixels.
  let layout = {panes: FILL.slice(0, innerWidth < 1200 ? 2 : 3).map((show) => ({show, range: null})), height: null};

  // A browser may deny the storage; then the layout is that of the page.
  const remember = () => {
    try { localStorage.setItem(KEY, JSON.stringify({...layout, window: view.window})); } catch { /* not remembered */ }
  };
  const recall = () => {
    try {
      const {panes: stored, height, window} = JSON.parse(localStorage.getItem(KEY));
      const valid = stored.filter(({show}) => Object.hasOwn(PANES, show)).slice(0, MOST).map(({show, range}) => (
        {show, range: Array.isArray(range) && range.every(Number.isFinite) && range[0] < range[1] ? range : null}));
      if (valid.length) layout = {panes: valid, height: Number.isFinite(height) ? height : null};
      if (WINDOWS.includes(window)) view.window = window;
    } catch { /* nothing remembered, or not by this page */ }
  };

  const options = (values) => values.map((text, value) => `<option value="${value}">${text}</option>`).join("");
  const names = Object.entries(PANES).map(([name, {unit}]) => `<option value="${name}">${name}, ${unit}</option>`).join("");

  const tools = () => `<div class="tools">
    <span class="tight" role="group" aria-label="number of plots">plots ${[1, 2, 3, 4].map((count) =>
      `<button data-count="${count}" aria-pressed="false">${count}</button>`).join("")}</span>
    <span class="tight"><label>window <select data-do="window">${options(WINDOWS.map((s) => `${s} s`))}</select></label>
    <button data-do="pause" aria-pressed="false" title="pause the display">freeze</button><button data-do="in"
    title="zoom in" aria-label="zoom in">+</button><button data-do="out" title="zoom out" aria-label="zoom out">−</button></span>
    <span class="tight"><button data-do="marks" aria-pressed="false" title="two cursors that you drag, and the difference">cursors</button>
    <span data-marks hidden>${["A", "B"].map((name) =>
      `<label>${name} <input data-mark type="number" step="any"> s</label> `).join("")}<span data-difference></span></span></span>
    <span class="tight"><label>capture <select data-do="on">${["off", "level", "fault", "saturation"].map((on) =>
      `<option>${on}</option>`).join("")}</select></label>
    <select data-do="signal" aria-label="signal of the capture">${options(LEVELS.map(({label}) => label))}</select><select
    data-do="edge" aria-label="edge of the capture"><option>rising</option><option>falling</option></select>
    <input data-do="level" type="number" value="5" step="any" aria-label="level of the capture" title="level"></span>
    <span class="tight"><label>pre-trigger <input data-do="before" type="number" value="0.2" min="0" step="0.1"> s,</label>
    <label>length <input data-do="length" type="number" value="1" min="0.01" step="0.1"> s</label>
    <button data-do="arm">arm</button><span data-capture></span>
    <button data-do="captured" aria-pressed="false" hidden>show</button><button data-do="csv" hidden>CSV</button></span></div>`;

  const find = (name) => dock.querySelector(`[data-do=${name}]`);
  const press = (button, on) => button.setAttribute("aria-pressed", on);

  const draw = () => {
    if (due || !bench.fixed) return;
    due = true;
    requestAnimationFrame(() => {
      due = false;
      [...panes.children].forEach((pane, place) => plots.draw(pane, layout.panes[place].range));
    });
  };

  // The plots side by side, or in two rows where they would be narrow.
  const fit = () => {
    const count = layout.panes.length, rows = count > 2 && panes.clientWidth / count < 260 && panes.clientHeight > 300 ? 2 : 1;
    panes.style.gridTemplate = `repeat(${rows}, minmax(0, 1fr)) / repeat(${Math.ceil(count / rows)}, minmax(0, 1fr))`;
    for (const legend of panes.querySelectorAll(".values")) legend.style.minHeight = "";
    draw();
  };

  const build = () => {
    panes.replaceChildren(...layout.panes.map(({show, range}, place) => {
      const pane = bench.element(`<section class="pane" data-pane="${show}" aria-label="plot ${place + 1}"><div class="head">
        <span class="grip" draggable="true" title="drag onto another plot: they change places">⠿</span>
        <select aria-label="quantity of plot ${place + 1}">${names}</select>
        <button data-scale aria-pressed="${!range}" title="vertical scale: automatic, or fixed">auto</button>
        ${["least", "greatest"].map((end) => `<input data-end type="number" step="any" aria-label="${end} value of plot ${place + 1}"
          ${range ? "" : "hidden"}>`).join("")}</div>
        <div class="values"></div><canvas role="img" aria-label="${show} over time"></canvas></section>`);
      pane.querySelector("select").value = show;
      range?.forEach((value, end) => { pane.querySelectorAll("[data-end]")[end].value = value; });
      return pane;
    }));
    for (const button of dock.querySelectorAll("[data-count]")) press(button, +button.dataset.count === layout.panes.length);
    remember();
    fit();
  };

  const resize = (count) => {
    const shown = layout.panes.map(({show}) => show);
    const more = [...FILL, ...Object.keys(PANES)].filter((name) => !shown.includes(name)).map((show) => ({show, range: null}));
    layout.panes = [...layout.panes, ...more].slice(0, count);
    build();
  };

  // Show a quantity in a plot; a plot that has it already takes the former one.
  const choose = (place, show) => {
    const other = layout.panes.findIndex((pane) => pane.show === show);
    if (other >= 0) return exchange(place, other);
    layout.panes[place] = {show, range: null};
    build();
  };
  const exchange = (one, other) => {
    [layout.panes[one], layout.panes[other]] = [layout.panes[other], layout.panes[one]];
    build();
  };

  const placeOf = (target) => [...panes.children].indexOf(target.closest?.(".pane"));
  const setScale = (place, range) => { layout.panes[place].range = range; build(); };
  const rounded = (value) => +value.toPrecision(3);

  const zoom = (factor, at = null) => {
    const [start, end] = plots.range(), middle = at ?? end, window = Math.max(0.02, Math.min(KEPT_S, factor * view.window));
    view.end = view.end === null && at === null && plots.shown === live ? null : middle + (end - middle) * window / (end - start);
    view.window = window;
    draw();
  };
  const pause = (on) => {
    view.paused = on;
    view.end = on ? plots.range()[1] : null;
    press(find("pause"), on);
    draw();
  };

  // Two cursors, a third of the window from its ends; they rest, and so does the display.
  const setMarks = (marks) => {
    view.marks = marks;
    press(find("marks"), marks !== null);
    dock.querySelector("[data-marks]").hidden = !marks;
    if (marks) {
      if (!view.paused) pause(true);
      dock.querySelectorAll("[data-mark]").forEach((input, place) => {
        if (input !== document.activeElement) input.value = marks[place].toFixed(3);
      });
      dock.querySelector("[data-difference]").textContent = `Δ ${(marks[1] - marks[0]).toFixed(3)} s`;
    }
    draw();
  };
  const newMarks = () => { const [start, end] = plots.range(); return [1, 2].map((third) => start + third * (end - start) / 3); };

  const capture = async (on) => {
    if (on) {
      const header = await fetchCapture();
      const bounds = Object.fromEntries(header.columns.map((key, place) => [key, [header.column(2 + 2 * place), header.column(3 + 2 * place)]]));
      plots.shown = {t: header.column(1), bounds, event_s: header.event_s};
      view.window = header.count ? plots.shown.t[header.count - 1] - plots.shown.t[0] : 1;
    } else {
      plots.shown = live;
      view.window = WINDOWS[find("window").value] ?? 10;
    }
    press(find("captured"), on);
    find("captured").textContent = on ? "live" : "show";
    setMarks(null);
    pause(on);
    view.end = null;
    draw();
  };
  const fetchCapture = () => bench.fetch("/capture.data", {groups: bench.selected.join()});

  const arm = () => {
    const {signal, entry, factor} = LEVELS[find("signal").value];
    bench.send("capture", {on: find("on").value, signal, entry, level: factor * find("level").value, edge: find("edge").value,
      before_s: +find("before").value, length_s: +find("length").value});
    if (plots.shown !== live) capture(false);
  };

  const save = async () => {
    const header = await fetchCapture();
    const keys = header.columns.map((key, place) => [key, header.column(2 + 2 * place)]);
    const rows = Array.from(header.column(1), (t, row) => [t, ...keys.map(([, values]) => values[row])].join());
    const file = new Blob([["t_s", ...header.columns].join() + "\n" + rows.join("\n") + "\n"], {type: "text/csv"});
    const link = bench.element(`<a download="capture.csv"></a>`);
    link.href = URL.createObjectURL(file);
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1e3);
  };

  const controls = () => {
    const actions = {pause: () => pause(!view.paused), in: () => zoom(0.5), out: () => zoom(2), arm, csv: save,
      captured: () => capture(plots.shown === live), marks: () => setMarks(view.marks ? null : newMarks())};
    dock.addEventListener("click", ({target}) => {
      if (target.tagName !== "BUTTON") return;
      actions[target.dataset.do]?.();
      if (target.dataset.count) resize(+target.dataset.count);
      if ("scale" in target.dataset) {
        const place = placeOf(target), {low, high} = panes.children[place].scale;
        setScale(place, layout.panes[place].range ? null : [rounded(low), rounded(high)]);
      }
      target.blur();
    });
    dock.addEventListener("change", ({target}) => {
      const place = placeOf(target);
      if ("mark" in target.dataset) setMarks([...dock.querySelectorAll("[data-mark]")].map(({value}) => +value));
      else if ("end" in target.dataset) {
        const range = [...panes.children[place].querySelectorAll("[data-end]")].map(({value}) => +value);
        setScale(place, range[0] < range[1] ? range : layout.panes[place].range);
      } else if (place >= 0) choose(place, target.value);
    });
    const level = () => { for (const name of ["signal", "edge", "level"]) find(name).hidden = find("on").value !== "level"; };
    find("on").addEventListener("change", level);
    level();
    find("window").value = WINDOWS.indexOf(view.window);
    find("window").addEventListener("change", ({target}) => {
      view.window = WINDOWS[target.value];
      view.end = null;
      remember();
      pause(false);
      target.blur();
    });
    bench.listeners.push(({capture: [state, t_s]}) => {
      dock.querySelector("[data-capture]").textContent = state === "off" ? "" : state + (t_s === null ? "" : ` at ${t_s.toFixed(3)} s`);
      for (const name of ["captured", "csv"]) find(name).hidden = state !== "complete";
    });
  };

  // Cursor, zoom by the wheel, pan by dragging, groups by a click on their bars, plots that change places.
  const pointer = () => {
    let drag = null, moved = -1;
    const canvasOf = ({target}) => target.tagName === "CANVAS" && target.parentElement.scale ? target.parentElement : null;
    const xIn = (pane, x) => x - pane.querySelector("canvas").getBoundingClientRect().x;
    const time = ({start, end, left, right}, x) => start + (x - left) / (right - left) * (end - start);
    const group = (pane, x) => Math.floor((xIn(pane, x) - pane.scale.left) / pane.scale.wide);
    const markAt = ({start, end, left, right}, x) =>
      (view.marks ?? []).findIndex((value) => Math.abs(left + (value - start) / (end - start) * (right - left) - x) < 7);
    panes.addEventListener("pointermove", (event) => {
      const pane = canvasOf(event);
      if (drag) {
        const t = time(drag.scale, xIn(drag.pane, event.clientX));
        if (drag.mark >= 0) return setMarks(view.marks.with(drag.mark, t));
        view.end = drag.end + drag.t - t;
        return draw();
      }
      if (pane?.dataset.pane === "groups") {
        const at = group(pane, event.clientX);
        return bench.showTip(at in bench.header.current_A ? bench.text(at) : "", event.clientX, event.clientY);
      }
      view.cursor = pane ? time(pane.scale, xIn(pane, event.clientX)) : null;
      draw();
    });
    panes.addEventListener("pointerleave", () => { view.cursor = null; bench.showTip(""); draw(); });
    panes.addEventListener("pointerdown", (event) => {
      const pane = canvasOf(event);
      if (!pane || event.button) return;
      if (pane.dataset.pane === "groups") {
        const at = group(pane, event.clientX);
        if (at in bench.header.current_A) bench.select(at);
        return draw();
      }
      const scale = {...pane.scale}, x = xIn(pane, event.clientX);
      drag = {pane, scale, t: time(scale, x), end: plots.range()[1], mark: markAt(scale, x)};
      view.cursor = null;
      event.target.setPointerCapture(event.pointerId);
    });
    panes.addEventListener("pointerup", () => { drag = null; });
    panes.addEventListener("wheel", (event) => {
      const pane = canvasOf(event), factor = event.deltaY < 0 ? 0.8 : 1.25;
      if (!pane) return;
      event.preventDefault();
      const x = xIn(pane, event.clientX), {low, high, left} = pane.scale, middle = (low + high) / 2;
      if (x < left) setScale(placeOf(pane), [low, high].map((value) => rounded(middle + factor * (value - middle))));
      else if (pane.dataset.pane !== "groups") zoom(factor, time(pane.scale, x));
    }, {passive: false});
    panes.addEventListener("dblclick", (event) => {
      const pane = canvasOf(event);
      if (pane && xIn(pane, event.clientX) < pane.scale.left) return setScale(placeOf(pane), null);
      view.end = null;
      draw();
    });
    panes.addEventListener("dragstart", ({target}) => { moved = placeOf(target); });
    panes.addEventListener("dragover", (event) => { if (moved >= 0) event.preventDefault(); });
    panes.addEventListener("drop", (event) => {
      const place = placeOf(event.target);
      event.preventDefault();
      if (moved >= 0 && place >= 0) exchange(moved, place);
      moved = -1;
    });
  };

  const setHeight = (height) =>
    document.documentElement.style.setProperty("--dock", `${Math.max(130, Math.min(0.7 * innerHeight, height))}px`);
  const edge = () => {
    const handle = dock.querySelector(".edge");
    if (layout.height) setHeight(layout.height);
    handle.addEventListener("pointerdown", ({pointerId}) => handle.setPointerCapture(pointerId));
    handle.addEventListener("pointermove", ({clientY, buttons}) => {
      if (!buttons) return;
      layout.height = innerHeight - clientY;
      setHeight(layout.height);
      remember();
    });
  };

  addEventListener("DOMContentLoaded", () => {
    dock = bench.element(`<section id="bench-dock" aria-label="plots"><div class="edge"></div>${tools()}<div class="panes"></div></section>`);
    document.body.append(dock);
    panes = dock.querySelector(".panes");
    recall();
    controls();
    pointer();
    edge();
    build();
    new ResizeObserver(fit).observe(panes);
    bench.listeners.push((header) => { plots.take(header); if (!view.paused) draw(); });
  });
}
