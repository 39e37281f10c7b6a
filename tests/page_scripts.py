"""Scripts that the tests evaluate in a page of the browser."""

# Middle of an element whose box is the same in two frames and whose middle nothing else covers. The last
# element that was looked for stays known to the page.
MIDDLE = """(async () => {
  const place = %s;
  const find = () => {
    if (!place.startsWith("text=")) return document.querySelector(place);
    const words = place.slice(5);
    const all = [...document.querySelectorAll("body *")].filter(
      (each) => each.innerText?.trim() === words && each.getClientRects().length);
    return all[all.length - 1];
  };
  const frame = () => new Promise(requestAnimationFrame);
  const box = (element) => {
    const {x, y, width, height} = element.getBoundingClientRect();
    return [x, y, width, height];
  };
  const element = window.pressed = find();
  if (!element) return null;
  element.scrollIntoView({block: "nearest"});
  await frame();
  const before = box(element);
  await frame();
  const [x, y, width, height] = box(element);
  const same = element.isConnected && width && height && before.join() === [x, y, width, height].join();
  const middle = [x + width / 2, y + height / 2];
  return same && element.contains(document.elementFromPoint(...middle)) ? middle : null;
})()"""

# Between these two, events of the mouse reach only the element that was looked for.
GUARD = """(() => {
  const {pressed} = window;
  const kinds = ["pointerdown", "mousedown", "pointerup", "mouseup", "click"];
  let clicked = false;
  const guard = (event) => {
    if (!pressed.contains(event.target)) {
      event.stopImmediatePropagation();
      event.preventDefault();
    } else {
      clicked ||= event.type === "click";
    }
  };
  for (const kind of kinds) window.addEventListener(kind, guard, true);
  window.endGuard = () => {
    for (const kind of kinds) window.removeEventListener(kind, guard, true);
    return clicked;
  };
  return true;
})()"""
END_GUARD = "endGuard()"

# Callbacks of frames are called in the first frame after an interval, not in the next one.
SLOW = """(() => {
  const next = window.requestAnimationFrame.bind(window), due = new Map();
  let count = 0;
  window.requestAnimationFrame = (draw) => (due.set(++count, draw), count);
  window.cancelAnimationFrame = (id) => { due.delete(id); };
  setInterval(() => due.size && next((time) => {
    const draws = [...due.values()];
    due.clear();
    for (const draw of draws) draw(time);
  }), %f);
})()"""

DRAWN = """new Promise((done) => {
  const draw = (left) => left ? requestAnimationFrame(() => draw(left - 1)) : done(true);
  draw(%d);
})"""
