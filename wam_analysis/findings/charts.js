// Draws the charts of the page with uPlot: drag to zoom, double click to see all.
(function () {
  "use strict";
  const all = JSON.parse(document.getElementById("charts").textContent);
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const drawn = [];
  function short(value, step, largest) {
    if (largest < 1e-3) return value ? value.toExponential(1) : "0";
    let digits = 0;  // 2.5 has one more than 2
    while (digits < 9 && Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-6) digits++;
    return value.toFixed(digits);
  }
  function axis(label, size) {
    const labels = (plot, values, index, space, step) => {
      const largest = Math.max(...values.map(Math.abs));  // null counts as 0
      return values.map((value) => (value === null ? "" : short(value, step, largest)));
    };
    return { values: labels, label, size, stroke: style("--ink"), grid: { stroke: style("--line"), width: 1 }, ticks: { stroke: style("--line") } };
  }
  function range(plot, low, high) {
    const least = 1e-4 * Math.max(Math.abs(low), Math.abs(high));  // a flat line is no row of rounding errors
    const room = Math.max(0.05 * (high - low), high - low < least ? least : 1e-5);
    return [low - room, high + room];
  }
  function draw(chart, figure) {
    const place = figure.querySelector("div");
    const series = chart.series.map((one) => ({
      label: one.label, width: 1.5, spanGaps: false,
      stroke: one.colour === "ink" ? style("--ink") : one.colour,
      dash: one.dashed ? [6, 4] : undefined,
      points: { show: false },
    }));
    const options = {
      width: place.clientWidth, height: chart.height,
      series: [{ label: chart.across }, ...series],
      axes: [axis(chart.across, 46), axis(chart.up, 70)],
      scales: { x: { time: false }, y: { range } },
      cursor: chart.key ? { sync: { key: chart.key } } : {},
    };
    return new uPlot(options, [chart.x, ...chart.series.map((one) => one.y)], place);
  }
  function drawAll() {
    while (drawn.length) drawn.pop().destroy();
    for (const figure of document.querySelectorAll("figure.chart")) {
      drawn.push(draw(all[Number(figure.dataset.chart)], figure));
    }
  }
  drawAll();
  dark.addEventListener("change", drawAll);
  let waiting = 0;
  window.addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => {
      for (const one of drawn) one.setSize({ width: one.root.parentNode.clientWidth, height: one.height });
    }, 100);
  });
})();
