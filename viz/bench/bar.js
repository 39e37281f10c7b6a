// Bar of the bench: STOP, run, speed, modes, role and status. Every button sends one command.
const bench = {header: {}, fixed: null, listeners: [], selected: [], query: {run: "", after: ""}};
{
  const MODES = ["off", "hold", "point", "trajectory", "jog", "manual", "replay"];
  const SPEEDS = {"0.1×": 0.1, "0.2×": 0.2, "0.5×": 0.5, "1×": 1, "2×": 2, "5×": 5, "10×": 10, "as fast as possible": 1e6};

  bench.element = (html) => {
    const made = document.createElement("template");
    made.innerHTML = html.trim();
    return made.content.firstElementChild;
  };

  // A command goes through viser's socket, as the value of a hidden button; until it is open, commands wait.
  let waiting = [];
  bench.send = (name, given = {}) => {
    const value = JSON.stringify([name, given]);
    if (waiting) waiting.push([name, given]);
    else window.__viserMutable?.sendMessage({type: "GuiUpdateMessage", uuid: bench.header.remote, updates: {value}});
  };

  bench.page = () => [...document.querySelectorAll("[data-page]")].at(-1)?.dataset.page;

  const buttons = (names, attribute) =>
    names.map((name) => `<button data-${attribute}="${name}" aria-pressed="false">${name}</button>`).join("");

  const build = () => {
    const speeds = Object.keys(SPEEDS).map((name) => `<option>${name}</option>`).join("");
    const bar = bench.element(`<header id="bench-bar"><h1>bench</h1><div class="row">
      <button class="stop" data-send="stop">STOP</button>
      <select title="what STOP does: currents off at once, or hold and then off" aria-label="what STOP does" data-stop><option value="off">currents off</option><option value="hold">hold first</option></select>
      <span class="set">${buttons(["start", "pause", "step", "reset"], "send")}</span>
      <select aria-label="speed" title="speed" data-speed>${speeds}<option hidden></option></select>
      <span class="set">${buttons(MODES, "mode")}</span>
      <span class="role"><span class="badge quiet" data-role>connecting</span><button data-ask hidden></button>
      <button data-theme title="light or dark" aria-label="light or dark">◐</button></span>
      </div><div id="bench-status" data-bench="status"></div></header>`);
    document.body.append(bar);
    const find = (what) => bar.querySelector(`[data-${what}]`);
    bar.addEventListener("click", ({target, detail}) => {
      const {send, mode} = target.dataset;
      // A press of STOP has been sent already; the Enter key has not.
      if (send && !(send === "stop" && detail)) bench.send(send);
      if (mode) bench.send("enter", {mode});
      if (target === find("theme")) bench.send("theme");
      if (target === find("ask")) bench.send(...JSON.parse(target.dataset.ask));
      if (target.tagName === "BUTTON") target.blur();
    });
    find("speed").addEventListener("change", ({target}) => {
      bench.send("speed", {factor: SPEEDS[target.value]});
      target.blur();
    });
    find("stop").addEventListener("change", ({target}) => {
      bench.send("stop_mode", {mode: target.value});
      target.blur();
    });
    const size = () => document.documentElement.style.setProperty("--bar", `${bar.offsetHeight}px`);
    new ResizeObserver(size).observe(bar);
    bench.listeners.push((header) => show(bar, find, header));
  };

  // Change only what differs: what the pointer is over keeps its explanation.
  const follow = (old, next) => {
    if (old.children.length !== next.children.length) return old.replaceChildren(...next.childNodes);
    [...next.children].forEach((part, place) => {
      const present = old.children[place];
      if (part.className === "badges" || part.className === "cells") follow(present, part);
      else if (present.outerHTML !== part.outerHTML) present.replaceWith(part);
    });
  };

  const show = (bar, find, header) => {
    follow(bar.querySelector("#bench-status"), bench.element(`<div>${header.status}</div>`));
    for (const button of bar.querySelectorAll("[data-mode]")) {
      button.setAttribute("aria-pressed", button.dataset.mode === header.mode);
    }
    bar.querySelector("[data-send=start]").setAttribute("aria-pressed", header.running);
    const select = find("speed"), name = Object.keys(SPEEDS).find((name) => SPEEDS[name] === header.speed);
    select.options[select.options.length - 1].text = `${header.speed}×`;
    if (document.activeElement !== select) select.value = name ?? `${header.speed}×`;
    if (document.activeElement !== find("stop")) find("stop").value = header.stop_mode;
    const own = `page ${bench.page()}`, operates = header.operator === own;
    const role = find("role"), ask = find("ask");
    role.textContent = operates ? "OPERATOR" : header.operator ? `WATCHING ${header.operator}` : "WATCHING, no operator";
    role.className = `badge ${operates ? "good" : "quiet"}`;
    const next = operates ? header.asking[0] : null;
    const label = next ? `Grant control to ${next}` : header.operator ? "Ask to operate" : "Take over";
    ask.hidden = operates ? !next : header.asking.includes(own);
    if (ask.textContent !== label) ask.textContent = label;
    ask.dataset.ask = JSON.stringify(next ? ["grant", {to: next}] : ["ask", {}]);
  };

  const decode = (buffer) => {
    const length = new DataView(buffer).getUint32(0, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    const numbers = new Float64Array(buffer, 4 + length), {count} = header;
    header.column = (place) => numbers.subarray(place * count, (place + 1) * count);
    return header;
  };

  bench.fetch = async (path, query) => {
    const answer = await fetch(`${path}?${new URLSearchParams(query)}`);
    if (!answer.ok) throw new Error(answer.statusText);
    return decode(await answer.arrayBuffer());
  };

  const ask = async () => {
    try {
      const {query} = bench, header = await bench.fetch("/bench.data", {...query, groups: bench.selected.join()});
      header.query = query;
      if (!header.status) throw new Error("no status yet");
      bench.header = header;
      if (header.fixed) bench.fixed = header.fixed;
      for (const listener of bench.listeners) listener(header);
    } catch {
      const role = document.querySelector("#bench-bar [data-role]");
      role.textContent = "NO CONNECTION";
      role.className = "badge bad";
    }
    setTimeout(ask, 100);
  };

  const resized = () => bench.send("resized", {width: innerWidth, font: parseFloat(getComputedStyle(document.documentElement).fontSize)});
  addEventListener("resize", resized);
  addEventListener("DOMContentLoaded", () => {
    build();
    ask();
    const timer = setInterval(() => {
      if (bench.page() === undefined || !bench.header.remote) return;
      clearInterval(timer);
      const commands = waiting;
      waiting = null;
      for (const command of commands) bench.send(...command);
      resized();
    }, 200);
  });
}
