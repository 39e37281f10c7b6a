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
const scale = document.getElementById("logarithmic"), plot = plots[0], axes = plot.layout.meta;
const ranges = axes.map((axis) => [...plot.layout[axis].range]);
scale.addEventListener("click", async () => {
  const on = scale.getAttribute("aria-pressed") === "false";
  scale.setAttribute("aria-pressed", on);
  for (const [i, axis] of axes.entries()) {
    const linear = {[`${axis}.type`]: "linear", [`${axis}.range`]: [...ranges[i]]};
    await Plotly.relayout(plot, on ? {[`${axis}.type`]: "log", [`${axis}.autorange`]: true} : linear);
    const [low, high] = plot.layout[axis].range;
    if (on) await Plotly.relayout(plot, {[`${axis}.range`]: [Math.max(low, high - 4), high]});
  }
});
