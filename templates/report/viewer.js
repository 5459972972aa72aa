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
  const value = (c, axis, i) => data.low[axis] + (data.high[axis] - data.low[axis]) * data.curves[c][axis][i] / data.steps;
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

  function drawBox(chosen, reach) {
    pen.strokeStyle = pen.fillStyle = getComputedStyle(element("viewer-state")).color;
    pen.lineWidth = 0.7;
    pen.globalAlpha = 0.45;
    for (let k = 0; k < 3; k++) {
      for (const [s, t] of [[-1, -1], [-1, 1], [1, -1], [1, 1]]) {
        const ends = [-1, 1].map((e) => {
          const corner = [0, 0, 0];
          corner[k] = e * reach[k];
          corner[(k + 1) % 3] = s * reach[(k + 1) % 3];
          corner[(k + 2) % 3] = t * reach[(k + 2) % 3];
          return placed(corner);
        });
        pen.beginPath();
        pen.moveTo(ends[0][0], ends[0][1]);
        pen.lineTo(ends[1][0], ends[1][1]);
        pen.stroke();
      }
    }
    pen.globalAlpha = 1;
    pen.font = "14px sans-serif";
    chosen.forEach((a, k) => {
      const end = reach.map((r) => -r);
      end[k] = reach[k] + 0.16;
      const [x, y] = placed(end);
      pen.fillText(data.names[a], x - 4, y + 5);
    });
  }

  function drawCurve(c, points) {
    pen.strokeStyle = pen.fillStyle = colour(c);
    pen.lineWidth = 1.2;
    for (let band = 0; band < bands; band++) {
      pen.globalAlpha = 0.3 + (0.7 * band) / (bands - 1);
      pen.beginPath();
      for (let i = 1; i < points.length; i++) {
        const depth = Math.floor((points[i][2] / 3.6 + 0.5) * bands);
        if (Math.min(bands - 1, Math.max(0, depth)) !== band) continue;
        if (data.joined) {
          pen.moveTo(points[i - 1][0], points[i - 1][1]);
          pen.lineTo(points[i][0], points[i][1]);
        } else {
          pen.rect(points[i][0] - 0.8, points[i][1] - 0.8, 1.6, 1.6);
        }
      }
      if (data.joined) pen.stroke(); else pen.fill();
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
    const at = (c, i) => placed(chosen.map((a, k) => (value(c, a, i) - middle[k]) / half[k]));
    for (let c = data.curves.length - 1; c >= 0; c--) {
      if (!boxes[c].checked) continue;
      drawCurve(c, data.curves[c][0].map((_, i) => at(c, i)));
      const [x, y] = at(c, sameTime(c, row));
      pen.beginPath();
      pen.arc(x, y, 4.5, 0, 7);
      pen.fill();
    }
    canvas.dataset.view = [view.yaw, view.pitch, view.zoom].map((v) => v.toFixed(3)).join(" ");
    const shown = data.names.map((n, a) => `${n} = ${rounded(value(0, a, row), decimals(a))}`);
    element("viewer-state").textContent = shown.slice(0, 13).join(", ") + (shown.length > 13 ? ", …" : "");
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
