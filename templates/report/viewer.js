// The viewer of a report: the trajectory in space, which mouse, touch and keys turn.
if (document.getElementById("viewer")) {
  const element = (id) => document.getElementById(id);
  const canvas = element("viewer-canvas");
  const data = JSON.parse(element("viewer-data").textContent);
  const selects = [...document.querySelectorAll("#viewer select")];
  const boxes = [...document.querySelectorAll("#viewer input[type=checkbox]")];
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const view = freshView();
  const space = inSpace(canvas, view, draw, reset), pen = space.pen;
  let turning = false;

  // Numbers are stored as integers from 0 to data.steps. value(c, axis, i) is the number of curve `c` in
  // column `axis` and row `i`.
  const scaled = (axis, i) => data.low[axis] + ((data.high[axis] - data.low[axis]) * i) / data.steps;
  const value = (c, axis, i) => scaled(axis, data.curves[c][axis][i]);
  const axes = () => selects.map((s) => Number(s.value));

  // Return the row of curve `c` at the time of row `row` of the first curve. If no row has this time,
  // return the next later row.
  function sameTime(c, row) {
    const times = data.curves[c].at(-1), i = times.findIndex((t) => t >= data.curves[0].at(-1)[row]);
    return i < 0 ? times.length - 1 : i;
  }

  function colour(index) {
    return getComputedStyle(document.querySelectorAll("#viewer .swatch")[index]).color;
  }

  function draw() {
    space.begin();
    const chosen = axes(), row = Number(element("viewer-time").value);
    const bounds = chosen.map((a) => ({ name: data.names[a], low: data.low[a], high: data.high[a] }));
    const { middle, half, reach } = framed(bounds);
    space.box(bounds.map((axis, k) => ({ ...axis, reach: reach[k] })), getComputedStyle(element("viewer-state")).color);
    const at = (given) => space.placed(given.map((v, k) => (v - middle[k]) / half[k]));
    if (data.leaf && chosen.every((a) => data.axes.includes(a)) && new Set(chosen).size === 3) {
      const [first, ...others] = chosen.map((a) => data.leaf[data.axes.indexOf(a)].map((i) => scaled(a, i)));
      const gap = data.leaf[0].map((i) => i === null);
      const net = first.map((v, i) => (gap[i] ? null : at([v, ...others.map((o) => o[i])])));
      space.curve(net, getComputedStyle(canvas).color, 0.6, [0.2, 0.8], true);
    }
    for (let c = data.curves.length - 1; c >= 0; c--) {
      if (!boxes[c].checked) continue;
      const point = (i) => at(chosen.map((a) => value(c, a, i)));
      space.curve(data.curves[c][0].map((_, i) => point(i)), colour(c), 1.2, [0.3, 1], data.joined);
      const [x, y] = point(sameTime(c, row));
      pen.beginPath();
      pen.arc(x, y, 4.5, 0, 7);
      pen.fill();
    }
    canvas.dataset.view = [view.yaw, view.pitch, view.zoom].map((v) => v.toFixed(3)).join(" ");
    const shown = data.names.map((n, a) => `${n} = ${rounded(value(0, a, row), digitsBetween(data.low[a], data.high[a]))}`);
    const told = shown.slice(0, 13).join(", ") + (shown.length > 13 ? ", …" : "");
    // Screen readers speak the text whenever it is set, even if it does not change. So set it only if it
    // changes.
    if (element("viewer-state").textContent !== told) element("viewer-state").textContent = told;
  }

  function reset() {
    Object.assign(view, freshView());
    selects.forEach((s, k) => { s.value = data.axes[k]; });
    boxes.forEach((b, k) => { b.checked = k === 0; });
    draw();
  }

  const spin = () => {
    if (!turning) return;
    space.turn(0.01, 0);
    requestAnimationFrame(spin);
  };
  element("viewer-turn").addEventListener("click", () => {
    // With reduced motion, each click turns the view once.
    if (still.matches) return space.turn(0.26, 0);
    turning = !turning;
    element("viewer-turn").textContent = turning ? "Stop" : "Turn";
    spin();
  });
  element("viewer-reset").addEventListener("click", reset);
  element("viewer-time").addEventListener("input", draw);
  for (const control of [...selects, ...boxes]) control.addEventListener("change", draw);
  document.documentElement.addEventListener("themechange", draw);
  new ResizeObserver(draw).observe(canvas);
  element("viewer").hidden = false;
  reset();
}
