const config = {displaylogo: false, responsive: true, doubleClick: "reset", plotlyServerURL: "",
  modeBarButtons: [["zoom2d", "pan2d", "resetScale2d"]]};
const plots = Object.keys(figures).map((name) => document.getElementById(name));
for (const plot of plots) {
  Plotly.newPlot(plot, figures[plot.id].data, figures[plot.id].layout, config);
}
for (const button of document.querySelectorAll("[data-run]")) {
  button.addEventListener("click", () => {
    const on = button.getAttribute("aria-pressed") === "false";
    button.setAttribute("aria-pressed", on);
    for (const plot of plots) {
      const its = plot.data.flatMap((trace, i) => (trace.meta === button.dataset.run ? [i] : []));
      Plotly.restyle(plot, {visible: on}, its);
    }
  });
}
// Axes that can be logarithmic, with range and note of that scale; a note states what is outside.
const scale = document.getElementById("logarithmic"), plot = plots[0], axes = plot.layout.meta;
const notes = (plot.layout.annotations ?? []).map((annotation) => annotation.name);
const linear = axes.map(({axis}) => ({range: [...plot.layout[axis].range],
  note: plot.layout.annotations[notes.indexOf(axis)]?.text}));
scale.addEventListener("click", () => {
  const on = scale.getAttribute("aria-pressed") === "false";
  scale.setAttribute("aria-pressed", on);
  const changes = {};
  for (const [i, {axis, range, note}] of axes.entries()) {
    changes[`${axis}.type`] = on ? "log" : "linear";
    changes[`${axis}.range`] = on ? [...range] : [...linear[i].range];
    const place = notes.indexOf(axis);
    if (place >= 0) changes[`annotations[${place}].text`] = on ? note : linear[i].note;
  }
  Plotly.relayout(plot, changes);
});
