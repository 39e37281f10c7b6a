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
