// Drawing of points in space on a canvas, for the live panel and for the viewer. Mouse, touch and keys turn
// the view.
const rounded = (number, digits) => number.toFixed(digits).replace(/^-(0\.?0*)$/, "$1").replace("-", "−");

// The number of digits after the point with which numbers between two bounds can be distinguished.
const digitsBetween = (low, high) => Math.max(0, Math.min(12, 3 - Math.floor(Math.log10(high - low || 1))));

function inSpace(canvas, view, redraw, reset) {
  const pen = canvas.getContext("2d");
  const bands = 8; // number of bands by distance from the viewer; those in the back are paler

  // The image [x, y, depth] of a point with coordinates from -1 to 1; depth increases towards the viewer.
  function placed(point) {
    const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
    const [x, y, z] = point;
    const across = cy * x + sy * y, deep = cy * y - sy * x;
    const size = (canvas.clientWidth > 260 ? 0.29 : 0.25) * Math.min(canvas.clientWidth, canvas.clientHeight) * view.zoom;
    return [canvas.clientWidth / 2 + size * across, canvas.clientHeight / 2 - size * (cp * z + sp * deep), sp * z - cp * deep];
  }

  // The four edges of the box along axis k, as pairs of ends on the screen.
  function edges(k, reach) {
    return [[-1, -1], [-1, 1], [1, -1], [1, 1]].map(([s, t]) => [-1, 1].map((e) => {
      const corner = [0, 0, 0];
      corner[k] = e * reach[k];
      corner[(k + 1) % 3] = s * reach[(k + 1) % 3];
      corner[(k + 2) % 3] = t * reach[(k + 2) % 3];
      return placed(corner);
    }));
  }

  // The edge at which an axis is labelled: the lowest one, or for the vertical axis the leftmost one.
  function labelled(k, listed) {
    const place = ([p, q]) => (k === 2 ? -p[0] - q[0] : p[1] + q[1]);
    return listed.reduce((best, edge) => (place(edge) > place(best) ? edge : best));
  }

  // Clear the canvas, and give it the resolution of the screen.
  function begin() {
    const scale = window.devicePixelRatio || 1;
    canvas.width = canvas.clientWidth * scale;
    canvas.height = canvas.clientHeight * scale;
    pen.setTransform(scale, 0, 0, scale, 0, 0);
  }

  // Draw the box of three axes {name, low, high, reach}. On small canvases the ends have no numbers.
  function box(axes, colour) {
    const roomy = canvas.clientWidth > 260, reach = axes.map((axis) => axis.reach);
    pen.strokeStyle = pen.fillStyle = colour;
    pen.lineWidth = 0.7;
    const [cx, cy] = placed([0, 0, 0]);
    axes.forEach((axis, k) => {
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
      pen.font = `italic ${roomy ? 14 : 11}px sans-serif`;
      write(axis.name, mx, my, roomy ? 24 : 9);
      if (!roomy) return;
      pen.font = "12px sans-serif";
      const end = (number) => rounded(number, Math.max(0, digitsBetween(axis.low, axis.high) - 2));
      write(end(axis.low), x1 + 0.1 * (x2 - x1), y1 + 0.1 * (y2 - y1), 10);
      write(end(axis.high), x2 + 0.1 * (x1 - x2), y2 + 0.1 * (y1 - y2), 10);
    });
  }

  // Draw points on the screen, as a line if `joined`, else as dots. A null in the list interrupts the line.
  // Parts in the back are paler.
  function curve(points, colour, width, [faint, full], joined) {
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

  function turn(yaw, pitch) {
    view.yaw += yaw;
    view.pitch = Math.max(-1.57, Math.min(1.57, view.pitch + pitch));
    redraw();
  }

  function zoom(factor) {
    view.zoom = Math.max(0.2, Math.min(20, view.zoom * factor));
    redraw();
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
    // The wheel zooms only after a click on the view; otherwise it scrolls the page.
    if (document.activeElement !== canvas) return;
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * 0.001));
  }, { passive: false });

  return { pen, begin, placed, box, curve, turn };
}

// Return numbers that place axes {low, high} in the picture: their middles, the half-lengths by which
// they are scaled, and their half-lengths after scaling (`reach`). Axes of similar lengths have the same
// scale.
function framed(axes) {
  const spans = axes.map(({ low, high }) => high - low);
  const largest = Math.max(...spans), shared = spans.every((s) => 4 * s > largest);
  const middle = axes.map(({ low, high }) => (high + low) / 2);
  const half = spans.map((s) => (shared ? largest : s || 1) / 2);
  return { middle, half, reach: spans.map((s, k) => s / 2 / half[k]) };
}

const freshView = () => ({ yaw: 0.66, pitch: 0.38, zoom: 1 });
