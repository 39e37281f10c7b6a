// Panel of viser: names of its controls for screen readers, folders by keyboard, and the section of the present mode.
{
  const ICONS = {"tabler-icon-adjustments": "configuration and diagnostics", "tabler-icon-arrow-back": "back to the controls",
    "tabler-icon-list-search": "command palette"};
  const SECTION = {hold: "point"};  // the other modes have a section of their name, or none

  const nameOf = (control) => {
    for (let box = control.parentElement; box && box.id !== "root"; box = box.parentElement) {
      const label = box.querySelector("label");
      if (label) return label.innerText;
    }
    return null;
  };

  const folders = () => [...document.querySelectorAll("#root svg.tabler-icon-chevron-down, #root svg.tabler-icon-chevron-up")]
    .filter(({parentElement}) => parentElement.className.includes("mantine-Paper-root"))
    .map((icon) => ({head: icon.parentElement, open: icon.classList.contains("tabler-icon-chevron-up")}));

  const name = () => {
    document.getElementById("root").setAttribute("role", "main");
    const unnamed = "[role=slider][aria-label=''], [role=slider]:not([aria-label]), input:not([type=hidden]):not([aria-label]), textarea:not([aria-label])";
    for (const control of document.querySelectorAll(`#root :is(${unnamed})`)) {
      const label = !control.labels?.length && nameOf(control);
      if (label) control.setAttribute("aria-label", label);
    }
    for (const button of document.querySelectorAll("#root button:not([aria-label]), button[class*=closeButton]:not([aria-label])")) {
      const icon = !button.innerText.trim() && [...button.querySelector("svg")?.classList ?? []].find((each) => each in ICONS);
      const close = button.className.includes("closeButton") && "close";
      if (icon || close) button.setAttribute("aria-label", ICONS[icon] ?? close);
    }
    for (const {head, open} of folders()) {
      head.setAttribute("aria-expanded", open);
      if (head.role === "button") continue;
      [head.role, head.tabIndex] = ["button", 0];
      head.addEventListener("keydown", (event) => event.key === "Enter" && head.click());
    }
  };

  // Open the section of a mode and close those of the others, once when the mode begins.
  const SECTIONS = ["point", "trajectory", "jog", "manual", "replay"];
  const follow = (mode) => {
    const sections = folders().filter(({head}) => SECTIONS.some((section) => head.innerText.startsWith(section)));
    for (const {head, open} of sections) {
      if (open !== head.innerText.startsWith(SECTION[mode] ?? mode)) head.click();
    }
    return sections.length === SECTIONS.length;
  };

  addEventListener("DOMContentLoaded", () => {
    let present = "";
    setInterval(name, 250);
    bench.listeners.push(({mode}) => { if (mode !== present && follow(mode)) present = mode; });
  });
}
