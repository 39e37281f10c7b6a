// Coils over the scene: number and value under the pointer, a menu on click, marks of selected and failed ones.
{
  let hovered = -1, pressed = null, canvas = null, menu = null, tip = null, last = "";

  const scene = () => document.querySelector("#root canvas[data-engine]");

  // Rotation of the scene's frame into that of three.js, from the root of the scene.
  const turned = ([x, y, z]) => {
    const tree = window.__viserSceneTree?.getState();
    const root = tree?.get?.("") ?? tree?.[""];
    const [w, a, b, c] = root?.wxyz ?? [Math.SQRT1_2, -Math.SQRT1_2, 0, 0];
    const t = [2 * (b * z - c * y), 2 * (c * x - a * z), 2 * (a * y - b * x)];
    return [x + w * t[0] + b * t[2] - c * t[1], y + w * t[1] + c * t[0] - a * t[2], z + w * t[2] + a * t[1] - b * t[0]];
  };

  const times = (m, [x, y, z, w]) => [0, 1, 2, 3].map((i) => m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i] * w);

  // Place on the page, depth and radius in pixels of every coil, and whether the ball hides it.
  bench.places = () => {
    const camera = window.__viserMutable?.camera, box = scene()?.getBoundingClientRect();
    if (!camera || !box || !bench.fixed) return [];
    const view = camera.matrixWorldInverse.elements, project = camera.projectionMatrix.elements;
    const centre = times(view, [0, 0, 0, 1]);
    return bench.fixed.coils.map((coil) => {
      const seen = times(view, [...turned(coil), 1]), [x, y, , w] = times(project, seen);
      const range = Math.hypot(...seen.slice(0, 3)), ahead = seen.slice(0, 3).map((value) => value / range);
      const along = ahead.reduce((sum, value, i) => sum + value * centre[i], 0);
      const off = Math.sqrt(Math.max(0, centre[0] ** 2 + centre[1] ** 2 + centre[2] ** 2 - along ** 2));
      return {x: box.x + box.width * (1 + x / w) / 2, y: box.y + box.height * (1 - y / w) / 2, depth: w,
        radius: box.height / 2 * project[5] * bench.fixed.radius / w, hidden: along < range && off < bench.fixed.ball};
    });
  };

  bench.groupOf = (coil) => bench.fixed.groups.findIndex((pair) => pair.includes(coil));

  const under = (x, y) => {
    let best = -1, depth = Infinity;
    bench.places().forEach((place, coil) => {
      const near = Math.hypot(place.x - x, place.y - y) < place.radius;
      if (near && !place.hidden && place.depth < depth) [best, depth] = [coil, place.depth];
    });
    return best;
  };

  bench.text = (group) => {
    const {current_A, temperature_C, failed} = bench.header;
    const warm = temperature_C ? `, ${temperature_C[group].toFixed(1)} °C` : "";
    const bad = failed.includes(group) ? ", failed" : "";
    return `group ${group}: ${current_A[group].toFixed(2)} A${warm}${bad}`;
  };

  bench.showTip = (text, x, y) => {
    tip.hidden = !text;
    tip.textContent = text;
    tip.style.left = `${Math.min(x + 14, innerWidth - tip.offsetWidth - 4)}px`;
    tip.style.top = `${Math.max(4, y - 30)}px`;
  };

  bench.select = (group, alone = false) => {
    const on = bench.selected.includes(group);
    if (alone) bench.selected = [group];
    else bench.selected = on ? bench.selected.filter((other) => other !== group) : [...bench.selected, group].slice(-6);
    bench.query = {run: "", after: ""};  // the earlier rows of the group are needed too
  };

  const open = (coil, x, y) => {
    const group = bench.groupOf(coil), name = String(group).padStart(2, "0");
    if (!bench.selected.includes(group)) bench.select(group);
    const fault = (mode) => ["add_fault", {fault: {target: `coil.${name}`, mode}}];
    const actions = {"Drive alone at 1 A": ["manual", {group, current_A: 1}], "Open circuit": fault("open"),
      "Short circuit": fault("short"), "Clear its faults": ["clear_faults", {target: `coil.${name}`}],
      "Remove from the plots": null};
    menu.replaceChildren(bench.element(`<b>coil ${coil}, ${bench.text(group)}</b>`));
    for (const [label, action] of Object.entries(actions)) {
      const button = bench.element(`<button>${label}</button>`);
      button.onclick = () => { action ? bench.send(...action) : bench.select(group); close(); };
      menu.append(button);
    }
    menu.hidden = false;
    bench.showTip("");
    menu.style.left = `${Math.min(x, innerWidth - menu.offsetWidth - 4)}px`;
    menu.style.top = `${Math.min(y, innerHeight - menu.offsetHeight - 4)}px`;
  };
  const close = () => { menu.hidden = true; };

  const draw = () => {
    requestAnimationFrame(draw);
    const camera = window.__viserMutable?.camera, below = scene();
    if (!camera || !below || !bench.fixed) return;
    const box = below.getBoundingClientRect(), {failed} = bench.header;
    const now = [hovered, bench.selected, failed, box.x, box.y, box.width, box.height,
      Array.from(camera.matrixWorldInverse.elements, (value) => value.toFixed(4))].join();
    if (now === last) return;
    last = now;
    const ratio = devicePixelRatio;
    Object.assign(canvas.style, {left: `${box.x}px`, top: `${box.y}px`, width: `${box.width}px`, height: `${box.height}px`});
    [canvas.width, canvas.height] = [box.width * ratio, box.height * ratio];
    const paint = canvas.getContext("2d"), light = document.documentElement.dataset.mantineColorScheme === "light";
    paint.scale(ratio, ratio);
    paint.font = `bold ${getComputedStyle(document.body).fontSize} sans-serif`;
    paint.textAlign = "center";
    bench.places().forEach(({x, y, radius, hidden}, coil) => {
      const group = bench.groupOf(coil), place = bench.selected.indexOf(group), bad = failed.includes(group);
      if (place < 0 && !bad && coil !== hovered) return;
      [x, y] = [x - box.x, y - box.y];
      paint.globalAlpha = hidden ? 0.35 : 1;
      paint.lineWidth = coil === hovered ? 4 : 2.5;
      paint.strokeStyle = bad ? bench.fixed.failed : place < 0 ? (light ? "#000" : "#fff") : bench.fixed.selected[place];
      paint.beginPath();
      paint.arc(x, y, radius, 0, 7);
      const d = 0.7 * radius;
      if (bad) { paint.moveTo(x - d, y - d); paint.lineTo(x + d, y + d); paint.moveTo(x + d, y - d); paint.lineTo(x - d, y + d); }
      paint.stroke();
      paint.lineWidth = 3;
      paint.strokeStyle = light ? "#fff" : "#000";
      paint.fillStyle = light ? "#000" : "#fff";
      paint.strokeText(group, x, y - radius - 3);
      paint.fillText(group, x, y - radius - 3);
    });
  };

  addEventListener("DOMContentLoaded", () => {
    canvas = bench.element(`<canvas id="bench-coils" aria-hidden="true"></canvas>`);
    menu = bench.element(`<div id="bench-menu" role="dialog" aria-label="coil" hidden></div>`);
    tip = bench.element(`<div id="bench-tip" role="tooltip" hidden></div>`);
    document.body.append(canvas, menu, tip);
    draw();
  });
  addEventListener("pointermove", ({target, clientX, clientY, buttons}) => {
    if (target !== scene() || buttons) { if (hovered >= 0) bench.showTip(""); hovered = -1; return; }
    const before = hovered;
    hovered = under(clientX, clientY);
    if (hovered >= 0) bench.showTip(`coil ${hovered}, ${bench.text(bench.groupOf(hovered))}`, clientX, clientY);
    else if (before >= 0) bench.showTip("");
  });
  addEventListener("pointerdown", ({target, clientX, clientY, button}) => {
    if (!menu?.contains(target)) close();
    pressed = target === scene() && button === 0 ? [clientX, clientY] : null;
  }, true);
  addEventListener("pointerup", ({clientX, clientY}) => {
    if (!pressed || Math.hypot(clientX - pressed[0], clientY - pressed[1]) > 4) return;
    const coil = under(clientX, clientY);
    if (coil >= 0) open(coil, clientX, clientY);
  }, true);
}
