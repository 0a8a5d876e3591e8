// Draws the charts of a page, and makes it ready for paper: charts as wide as the sheet, every fold open.
"use strict";
(() => {
  const PAPER = 680;  // CSS pixels between the margins of an A4 sheet
  const charts = [...document.querySelectorAll("script[data-for]")].map((holder) => document.getElementById(holder.dataset.for));
  const drawn = charts.map((chart) => {
    const figure = JSON.parse(document.querySelector(`script[data-for=${chart.id}]`).textContent);
    return Plotly.newPlot(chart, figure.data, figure.layout, { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d"] });
  });
  const root = document.documentElement;
  Promise.all(drawn).then(() => root.dataset.export && putOut(root.dataset.export)).then(() => { root.dataset.drawn = "yes"; });

  // Every figure as an address that holds its data, for files of their own.
  async function putOut(format) {
    const figures = [];
    for (const place of document.querySelectorAll(".chart, .scene")) {
      if (place.classList.contains("scene")) figures.push(place.picture(format));
      else figures.push(await Plotly.toImage(place, { format, width: 1000, height: place.layout.height || 420, scale: format === "png" ? 2 : 1 }));
    }
    const list = document.createElement("pre");
    list.id = "figure-files"; list.textContent = JSON.stringify(figures);
    document.body.append(list);
  }

  function nameChoice(chart) {
    const menu = (chart.layout.updatemenus || [])[0], place = document.querySelector(`[data-choice=${chart.id}]`);
    if (menu && place) place.textContent = `Shown: ${menu.buttons[menu.active || 0].label}.`;
  }
  let opened = [];
  function toPaper() {
    opened = [...document.querySelectorAll("details:not([open])")];
    for (const fold of opened) fold.open = true;
    for (const chart of charts) {
      nameChoice(chart);
      Plotly.relayout(chart, { width: PAPER });
    }
  }
  function toScreen() {
    for (const fold of opened) fold.open = false;
    for (const chart of charts) Plotly.relayout(chart, { width: null, autosize: true });
  }
  window.addEventListener("beforeprint", toPaper);
  window.addEventListener("afterprint", toScreen);
})();
