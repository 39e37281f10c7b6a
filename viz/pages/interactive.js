const config = {displaylogo: false, responsive: true, doubleClick: "reset", plotlyServerURL: "",
  modeBarButtons: [["zoom2d", "pan2d", "resetScale2d"]]};
const plots = Object.keys(figures).map((name) => document.getElementById(name));
const colours = getComputedStyle(document.documentElement);
const [ink, faint, paper] = ["--ink", "--faint", "--paper"].map((name) => colours.getPropertyValue(name));

async function draw() {
  const packed = Uint8Array.from(atob(document.getElementById("library").textContent), (c) => c.charCodeAt(0));
  const unpacked = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const script = document.createElement("script");
  script.textContent = await new Response(unpacked).text();
  document.head.append(script);
  for (const plot of plots) {
    const {data, layout} = figures[plot.id];
    Object.assign(layout, {paper_bgcolor: paper, plot_bgcolor: paper});
    layout.font.color = ink;
    for (const name of Object.keys(layout).filter((name) => /^[xy]axis/.test(name))) {
      Object.assign(layout[name], {gridcolor: faint, zerolinecolor: faint, linecolor: ink, spikecolor: ink});
    }
    await Plotly.newPlot(plot, data, layout, config);
  }
}

draw();
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
