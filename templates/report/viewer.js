// The trajectory in space, turned by mouse, touch and keys.
if (document.getElementById("viewer")) {
  const element = (id) => document.getElementById(id);
  const canvas = element("viewer-canvas");
  const pen = canvas.getContext("2d");
  const data = JSON.parse(element("viewer-data").textContent);
  const selects = [...document.querySelectorAll("#viewer select")];
  const boxes = [...document.querySelectorAll("#viewer input[type=checkbox]")];
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const bands = 8; // of distance, paler towards the back
  let view, turning = false;

  // Column `axis` of curve `c` at row `i`: numbers were stored as integers from 0 to data.steps.
  const scaled = (axis, i) => data.low[axis] + ((data.high[axis] - data.low[axis]) * i) / data.steps;
  const value = (c, axis, i) => scaled(axis, data.curves[c][axis][i]);
  const axes = () => selects.map((s) => Number(s.value));

  // The row of curve `c` at the time of row `row` of the first: curves need not have the same rows.
  function sameTime(c, row) {
    const times = data.curves[c].at(-1), i = times.findIndex((t) => t >= data.curves[0].at(-1)[row]);
    return i < 0 ? times.length - 1 : i;
  }

  // What is left of a number after rounding.
  const decimals = (axis) => Math.max(0, Math.min(12, 3 - Math.floor(Math.log10(data.high[axis] - data.low[axis] || 1))));

  const rounded = (number, digits) => number.toFixed(digits).replace(/^-(0\.?0*)$/, "$1").replace("-", "−");

  // From a point of the chosen axes, each from -1 to 1, to the screen: [x, y, towards the viewer].
  function placed(point) {
    const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
    const [x, y, z] = point;
    const across = cy * x + sy * y, deep = cy * y - sy * x;
    const size = 0.29 * Math.min(canvas.clientWidth, canvas.clientHeight) * view.zoom;
    return [canvas.clientWidth / 2 + size * across, canvas.clientHeight / 2 - size * (cp * z + sp * deep), sp * z - cp * deep];
  }

  function colour(index) {
    return getComputedStyle(document.querySelectorAll("#viewer .swatch")[index]).color;
  }

  // Axes of comparable length share their unit.
  function frame(chosen) {
    const spans = chosen.map((a) => data.high[a] - data.low[a]);
    const largest = Math.max(...spans), shared = spans.every((s) => 4 * s > largest);
    const middle = chosen.map((a) => (data.high[a] + data.low[a]) / 2);
    const half = spans.map((s) => (shared ? largest : s || 1) / 2);
    return { middle, half, reach: spans.map((s, k) => s / 2 / half[k]) };
  }

  // The four edges along axis k, as pairs of ends.
  function edges(k, reach) {
    return [[-1, -1], [-1, 1], [1, -1], [1, 1]].map(([s, t]) => [-1, 1].map((e) => {
      const corner = [0, 0, 0];
      corner[k] = e * reach[k];
      corner[(k + 1) % 3] = s * reach[(k + 1) % 3];
      corner[(k + 2) % 3] = t * reach[(k + 2) % 3];
      return placed(corner);
    }));
  }

  // An edge in front of everything: the lowest one or, upwards, the one on the left.
  function labelled(k, listed) {
    const place = ([p, q]) => (k === 2 ? -p[0] - q[0] : p[1] + q[1]);
    return listed.reduce((best, edge) => (place(edge) > place(best) ? edge : best));
  }

  function drawBox(chosen, reach) {
    pen.strokeStyle = pen.fillStyle = getComputedStyle(element("viewer-state")).color;
    pen.lineWidth = 0.7;
    const [cx, cy] = placed([0, 0, 0]);
    chosen.forEach((a, k) => {
      const listed = edges(k, reach);
      pen.globalAlpha = 0.35;
      for (const [[x1, y1], [x2, y2]] of listed) {
        pen.beginPath();
        pen.moveTo(x1, y1);
        pen.lineTo(x2, y2);
        pen.stroke();
      }
      pen.globalAlpha = 1;
      const [[x1, y1], [x2, y2]] = labelled(k, listed);
      const [mx, my] = [(x1 + x2) / 2, (y1 + y2) / 2], away = 1 / (Math.hypot(mx - cx, my - cy) || 1);
      const [ox, oy] = [(mx - cx) * away, (my - cy) * away];
      pen.textAlign = ox < -0.3 ? "right" : ox > 0.3 ? "left" : "center";
      pen.textBaseline = "middle";
      const write = (text, x, y, out) => pen.fillText(text, x + out * ox, y + out * oy);
      pen.font = "italic 14px sans-serif";
      write(data.names[a], mx, my, 24);
      pen.font = "12px sans-serif";
      const end = (number) => rounded(number, Math.max(0, decimals(a) - 2));
      write(end(data.low[a]), x1 + 0.1 * (x2 - x1), y1 + 0.1 * (y2 - y1), 10);
      write(end(data.high[a]), x2 + 0.1 * (x1 - x2), y2 + 0.1 * (y1 - y2), 10);
    });
  }

  // Points on the screen, null where a line ends; paler towards the back.
  function drawCurve(points, colour, width, [faint, full], joined) {
    pen.strokeStyle = pen.fillStyle = colour;
    pen.lineWidth = width;
    for (let band = 0; band < bands; band++) {
      pen.globalAlpha = faint + ((full - faint) * band) / (bands - 1);
      pen.beginPath();
      for (let i = 1; i < points.length; i++) {
        if (!points[i] || !points[i - 1]) continue;
        const depth = Math.floor((points[i][2] / 3.6 + 0.5) * bands);
        if (Math.min(bands - 1, Math.max(0, depth)) !== band) continue;
        if (joined) {
          pen.moveTo(points[i - 1][0], points[i - 1][1]);
          pen.lineTo(points[i][0], points[i][1]);
        } else {
          pen.rect(points[i][0] - 0.8, points[i][1] - 0.8, 1.6, 1.6);
        }
      }
      if (joined) pen.stroke(); else pen.fill();
    }
    pen.globalAlpha = 1;
  }

  function draw() {
    const scale = window.devicePixelRatio || 1;
    canvas.width = canvas.clientWidth * scale;
    canvas.height = canvas.clientHeight * scale;
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    const chosen = axes(), { middle, half, reach } = frame(chosen), row = Number(element("viewer-time").value);
    drawBox(chosen, reach);
    const at = (given) => placed(given.map((v, k) => (v - middle[k]) / half[k]));
    if (data.leaf && chosen.every((a) => data.axes.includes(a)) && new Set(chosen).size === 3) {
      const [first, ...others] = chosen.map((a) => data.leaf[data.axes.indexOf(a)].map((i) => scaled(a, i)));
      const gap = data.leaf[0].map((i) => i === null);
      const net = first.map((v, i) => (gap[i] ? null : at([v, ...others.map((o) => o[i])])));
      drawCurve(net, getComputedStyle(canvas).color, 0.6, [0.2, 0.8], true);
    }
    for (let c = data.curves.length - 1; c >= 0; c--) {
      if (!boxes[c].checked) continue;
      const point = (i) => at(chosen.map((a) => value(c, a, i)));
      drawCurve(data.curves[c][0].map((_, i) => point(i)), colour(c), 1.2, [0.3, 1], data.joined);
      const [x, y] = point(sameTime(c, row));
      pen.beginPath();
      pen.arc(x, y, 4.5, 0, 7);
      pen.fill();
    }
    canvas.dataset.view = [view.yaw, view.pitch, view.zoom].map((v) => v.toFixed(3)).join(" ");
    const shown = data.names.map((n, a) => `${n} = ${rounded(value(0, a, row), decimals(a))}`);
    const told = shown.slice(0, 13).join(", ") + (shown.length > 13 ? ", …" : "");
    // A screen reader speaks it whenever it is set.
    if (element("viewer-state").textContent !== told) element("viewer-state").textContent = told;
  }

  function turn(yaw, pitch) {
    view.yaw += yaw;
    view.pitch = Math.max(-1.57, Math.min(1.57, view.pitch + pitch));
    draw();
  }

  function zoom(factor) {
    view.zoom = Math.max(0.2, Math.min(20, view.zoom * factor));
    draw();
  }

  function reset() {
    view = { yaw: 0.66, pitch: 0.38, zoom: 1 };
    selects.forEach((s, k) => { s.value = data.axes[k]; });
    boxes.forEach((b, k) => { b.checked = k === 0; });
    draw();
  }

  const keys = {
    ArrowLeft: () => turn(0.1, 0), ArrowRight: () => turn(-0.1, 0), ArrowUp: () => turn(0, -0.1),
    ArrowDown: () => turn(0, 0.1), "+": () => zoom(1.2), "=": () => zoom(1.2), "-": () => zoom(1 / 1.2), 0: reset,
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    keys[event.key]();
  });
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons) turn(-event.movementX * 0.01, event.movementY * 0.01);
  });
  canvas.addEventListener("wheel", (event) => {
    // The page scrolls on, unless the view has been clicked.
    if (document.activeElement !== canvas) return;
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * 0.001));
  }, { passive: false });

  const spin = () => {
    if (!turning) return;
    turn(0.01, 0);
    requestAnimationFrame(spin);
  };
  element("viewer-turn").addEventListener("click", () => {
    // Who asks for less motion gets one step at a time.
    if (still.matches) return turn(0.26, 0);
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
